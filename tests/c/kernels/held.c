/* Plant x' = -a x + d with d held by a controller beside it. p: a (1/s). Outputs: 2 x, d, x', monitor. */
#include "gustform/gust_kernel.h"

static void prepare(const double *p, double *c)
{
    (void)p;
    (void)c;
}

static void residual(const gust_point *at, double *r, double *flow)
{
    (void)flow;
    r[0] = at->yp[0] + at->p[0] * at->y[0] - at->d[1];
}

static const int32_t ROW[] = {0};
static const int32_t COLUMN[] = {0};

static void jacobian(const gust_point *at, double *value)
{
    value[0] = at->cj + at->p[0];
}

static void outputs(const gust_point *at, double *value)
{
    value[0] = 2.0 * at->y[0];
    value[1] = at->d[1];
    value[2] = at->yp[0];
    value[3] = at->d[0];
}

static const gust_kernel KERNEL = {.abi = GUST_KERNEL_ABI,
                                   .type_name = "held",
                                   .n_unknowns = 1,
                                   .n_parameters = 1,
                                   .n_discrete = 2,
                                   .n_nonzeros = 1,
                                   .n_outputs = 4,
                                   .jacobian_row = ROW,
                                   .jacobian_column = COLUMN,
                                   .prepare = prepare,
                                   .residual = residual,
                                   .jacobian = jacobian,
                                   .outputs = outputs};

const gust_kernel *gust_kernel_get(void);

const gust_kernel *gust_kernel_get(void)
{
    return &KERNEL;
}
