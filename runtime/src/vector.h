/* N_Vector of one contiguous array, through SUNDIALS' public interface.
 *
 * The arrays start on a cache line and their length is rounded up to GUST_LANE_BLOCK; the rest is zero and
 * every operation keeps it so, which lets loops run over whole blocks without a tail. For some 30 unknowns
 * this is what the speed of the integrator hangs on: the distribution's serial vector takes 4 times as long. */
#ifndef GUSTFORM_VECTOR_H
#define GUSTFORM_VECTOR_H

#include <stdint.h>

#include "sundials_compat.h"

/* Before a loop whose passes do not depend on each other, even where its arrays are one and the same. */
#if defined(__clang__)
#define GUST_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#elif defined(__GNUC__)
#define GUST_INDEPENDENT _Pragma("GCC ivdep")
#else
#define GUST_INDEPENDENT
#endif

typedef struct gust_vector {
    int64_t length;
    int64_t padded; /* length rounded up; data[length .. padded - 1] is 0 */
    double *data;
} gust_vector;

/* A new zero vector, NULL without memory. The caller frees with N_VDestroy. */
N_Vector gust_vector_new(int64_t length, SUNContext context);

static inline double *gust_vector_data(N_Vector vector)
{
    return ((gust_vector *)vector->content)->data;
}

static inline int64_t gust_vector_length(N_Vector vector)
{
    return ((gust_vector *)vector->content)->length;
}

static inline int64_t gust_vector_padded(N_Vector vector)
{
    return ((gust_vector *)vector->content)->padded;
}

#endif
