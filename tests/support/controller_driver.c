/* Runs instances of an exported controller sample by sample, all instances in each sample; for the tests.
 * Compile with -DPREFIX=<prefix> -DUPPER=<PREFIX> -include <prefix>.h, together with <prefix>.c. */
#include <stdlib.h>
#include <string.h>

#define JOIN_(a, b) a##_##b
#define JOIN(a, b)  JOIN_(a, b)
#define NAME(x)     JOIN(PREFIX, x)
#define COUNT(x)    JOIN(UPPER, x)

typedef NAME(real) real;
typedef NAME(context) context;

size_t context_size(void);
int drive(int instances, int samples, const real *parameters, const real *in, real *out, real *memory,
          uint32_t *errors);

size_t context_size(void)
{
    return sizeof(context);
}

/* in: samples x instances x inputs; out, memory, errors likewise. `parameters` or NULL: recalibrated before. */
int drive(int instances, int samples, const real *parameters, const real *in, real *out, real *memory,
          uint32_t *errors)
{
    context *c = (context *)calloc((size_t)instances, sizeof *c);
    uint32_t calibration = 0U;
    if (c == NULL) {
        return -1;
    }
    for (int k = 0; k < instances; k++) {
        (void)NAME(startup)(&c[k]);
        if (parameters != NULL) {
            memcpy(&c[k].p, parameters, sizeof c[k].p);
            calibration |= NAME(recalibrate)(&c[k]);
        }
    }
    for (int i = 0; i < samples; i++) {
        for (int k = 0; k < instances; k++) {
            memcpy(&c[k].in, in, sizeof c[k].in);
            *errors++ = NAME(step)(&c[k]);
            memcpy(out, &c[k].out, sizeof c[k].out);
            memcpy(memory, c[k].memory, sizeof c[k].memory);
            in += COUNT(N_INPUTS);
            out += COUNT(N_OUTPUTS);
            memory += COUNT(N_MEMORY);
        }
    }
    free(c);
    return (int)calibration;
}
