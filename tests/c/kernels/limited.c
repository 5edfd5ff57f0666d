/* Integrator behind a limiter, driven by a rotating pair: s' = w c, c' = -w s, x' = max(s, 0). The limiter is
 * a kink at s = 0. p: w (1/s). */
#include "gustform/gust_kernel.h"

static void prepare(const double *p, double *c)
{
    (void)p;
    (void)c;
}

static void residual(const gust_point *at, double *r, double *flow)
{
    (void)flow;
    const double s = at->y[0];
    r[0] = at->yp[0] - at->p[0] * at->y[1];
    r[1] = at->yp[1] + at->p[0] * s;
    r[2] = at->yp[2] - (s > 0.0 ? s : 0.0);
}

static const int32_t ROW[] = {0, 0, 1, 1, 2, 2};
static const int32_t COLUMN[] = {0, 1, 0, 1, 0, 2};

static void jacobian(const gust_point *at, double *value)
{
    value[0] = at->cj;
    value[1] = -at->p[0];
    value[2] = at->p[0];
    value[3] = at->cj;
    value[4] = at->y[0] > 0.0 ? -1.0 : 0.0;
    value[5] = at->cj;
}

static void roots(const gust_point *at, double *value)
{
    value[0] = at->y[0];
}

static const gust_kernel KERNEL = {.abi = GUST_KERNEL_ABI,
                                   .type_name = "limited",
                                   .n_unknowns = 3,
                                   .n_parameters = 1,
                                   .n_nonzeros = 6,
                                   .n_roots = 1,
                                   .jacobian_row = ROW,
                                   .jacobian_column = COLUMN,
                                   .prepare = prepare,
                                   .residual = residual,
                                   .jacobian = jacobian,
                                   .roots = roots};

const gust_kernel *gust_kernel_get(void);

const gust_kernel *gust_kernel_get(void)
{
    return &KERNEL;
}
