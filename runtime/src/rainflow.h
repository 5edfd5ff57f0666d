/* Rainflow cycle counting of a stream: ASTM E1049-85 (2017), 5.4.4, three points at a time; the first and last
 * sample count as reversals, what is left at the end as half cycles. Counts are those of the Python package
 * `rainflow` 3.2, which states the same algorithm.
 *
 * The ranges between points that are still open decrease strictly, since two that do not have been counted. So
 * wind-like signals keep a few dozen, and only one that dies away evenly keeps more: an oscillation damped by
 * 0.5 % has lost all digits of a double after 2300 reversals. The room is for GUST_RAINFLOW_OPEN points; if it
 * should not do, the smallest open range is counted as a full cycle at once and `forced` tells so. */
#ifndef GUSTFORM_RAINFLOW_H
#define GUSTFORM_RAINFLOW_H

#include <stdint.h>

#include "archive.h"

enum { GUST_RAINFLOW_OPEN = 4096 };

/* What has been counted. */
typedef struct gust_rainflow_counts {
    int64_t full;
    int64_t half;
    int64_t forced; /* of the full ones */
    double largest; /* range */
    double *damage; /* [n_exponents] sum of n_i R_i^m */
    double *cycles; /* [n_ranges + 1] by range: bins of `width`, above them */
} gust_rainflow_counts;

typedef struct gust_rainflow {
    int32_t n_exponents;
    double *exponents; /* m of each sum; [n_exponents] */
    int32_t n_ranges;
    double width;
    gust_rainflow_counts counts;
    int64_t seen; /* samples, counted to 3 */
    double x;     /* last sample that differed from the one before */
    double d;     /* and by how much */
    int32_t n_open;
    double *open; /* [GUST_RAINFLOW_OPEN] reversals; NULL: nothing is counted */
} gust_rainflow;

/* n_exponents = 0 and n_ranges = 0: nothing is kept. false: out of memory. Free with gust_rainflow_free. */
bool gust_rainflow_create(gust_rainflow *rainflow, const double *exponents, int32_t n_exponents, double width,
                          int32_t n_ranges);
void gust_rainflow_free(gust_rainflow *rainflow);

/* A second one to finish copies in; the same as gust_rainflow_create with another's settings. */
void gust_rainflow_copy(gust_rainflow *to, const gust_rainflow *from);

void gust_rainflow_add(gust_rainflow *rainflow, const double *x, int32_t n);

/* The last sample becomes a reversal, what is open is counted: nothing may be added after that. */
void gust_rainflow_finish(gust_rainflow *rainflow);

void gust_rainflow_archive(gust_rainflow *rainflow, gust_archive *archive);

#endif
