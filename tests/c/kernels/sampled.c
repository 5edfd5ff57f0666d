/* Plant x' = -a x + d under a sampled controller: every T seconds d = -k x. p: a (1/s), k (1/s), T (s). */
#include "gustform/gust_kernel.h"

static void prepare(const double *p, double *c)
{
    (void)p;
    (void)c;
}

static void residual(const gust_point *at, double *r, double *flow)
{
    (void)flow;
    r[0] = at->yp[0] + at->p[0] * at->y[0] - at->d[0];
}

static const int32_t ROW[] = {0};
static const int32_t COLUMN[] = {0};

static void jacobian(const gust_point *at, double *value)
{
    value[0] = at->cj + at->p[0];
}

static void when(const gust_point *at, int32_t clause, double *y, double *d)
{
    (void)clause;
    (void)y;
    d[0] = -at->p[1] * at->y[0];
    d[1] = at->d[1] + 1.0;
}

static void outputs(const gust_point *at, double *value)
{
    value[0] = at->d[0];
    value[1] = at->d[1];
}

static const gust_kernel KERNEL = {.abi = GUST_KERNEL_ABI,
                                   .type_name = "sampled",
                                   .n_unknowns = 1,
                                   .n_parameters = 3,
                                   .n_discrete = 2,
                                   .n_nonzeros = 1,
                                   .n_outputs = 2,
                                   .n_whens = 1,
                                   .jacobian_row = ROW,
                                   .jacobian_column = COLUMN,
                                   .prepare = prepare,
                                   .residual = residual,
                                   .jacobian = jacobian,
                                   .outputs = outputs,
                                   .when = when};

const gust_kernel *gust_kernel_get(void);

const gust_kernel *gust_kernel_get(void)
{
    return &KERNEL;
}
