/* Bouncing ball: h' = v, v' = -g; when h < 0: v = -e v, and d counts the bounces. p: g (m/s^2), e. */
#include "gustform/gust_kernel.h"

static void prepare(const double *p, double *c)
{
    (void)p;
    (void)c;
}

static void residual(const gust_point *at, double *r, double *flow)
{
    (void)flow;
    r[0] = at->yp[0] - at->y[1];
    r[1] = at->yp[1] + at->p[0];
}

static const int32_t ROW[] = {0, 0, 1};
static const int32_t COLUMN[] = {0, 1, 1};

static void jacobian(const gust_point *at, double *value)
{
    value[0] = at->cj;
    value[1] = -1.0;
    value[2] = at->cj;
}

static void roots(const gust_point *at, double *value)
{
    value[0] = -at->y[0];
}

static void when(const gust_point *at, int32_t clause, double *y, double *d)
{
    (void)clause;
    y[1] = -at->p[1] * at->y[1];
    d[0] = at->d[0] + 1.0;
}

static void outputs(const gust_point *at, double *value)
{
    value[0] = at->y[1];
    value[1] = at->d[0];
}

static const gust_kernel KERNEL = {.abi = GUST_KERNEL_ABI,
                                   .type_name = "ball",
                                   .n_unknowns = 2,
                                   .n_parameters = 2,
                                   .n_discrete = 1,
                                   .n_nonzeros = 3,
                                   .n_outputs = 2,
                                   .n_roots = 1,
                                   .n_whens = 1,
                                   .jacobian_row = ROW,
                                   .jacobian_column = COLUMN,
                                   .prepare = prepare,
                                   .residual = residual,
                                   .jacobian = jacobian,
                                   .outputs = outputs,
                                   .roots = roots,
                                   .when = when};

const gust_kernel *gust_kernel_get(void);

const gust_kernel *gust_kernel_get(void)
{
    return &KERNEL;
}
