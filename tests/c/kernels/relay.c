/* Things that events can do. x' = d0 with two clauses on the conditions
 *     root 0:  x - p0 > 0        clause 0: d0 = p1, d1 + 1
 *     root 1:  p2 - x > 0        clause 1: d0 = p3, d2 + 1
 * With p0 = p2 it chatters around p0; with p4 = 1 each clause also moves x beyond the other's threshold, so
 * that they trigger each other for ever at one time. */
#include "gustform/gust_kernel.h"

static void prepare(const double *p, double *c)
{
    (void)p;
    (void)c;
}

static void residual(const gust_point *at, double *r, double *flow)
{
    (void)flow;
    r[0] = at->yp[0] - at->d[0];
}

static const int32_t ROW[] = {0};
static const int32_t COLUMN[] = {0};

static void jacobian(const gust_point *at, double *value)
{
    value[0] = at->cj;
}

static void roots(const gust_point *at, double *value)
{
    value[0] = at->y[0] - at->p[0];
    value[1] = at->p[2] - at->y[0];
}

static void when(const gust_point *at, int32_t clause, double *y, double *d)
{
    if (clause == 0) {
        d[0] = at->p[1];
        d[1] = at->d[1] + 1.0;
        if (at->p[4] > 0.0) {
            y[0] = at->p[2] - 1.0;
        }
    } else {
        d[0] = at->p[3];
        d[2] = at->d[2] + 1.0;
        if (at->p[4] > 0.0) {
            y[0] = at->p[0] + 1.0;
        }
    }
}

static void outputs(const gust_point *at, double *value)
{
    value[0] = at->d[0];
    value[1] = at->d[1];
    value[2] = at->d[2];
}

static const gust_kernel KERNEL = {.abi = GUST_KERNEL_ABI,
                                   .type_name = "relay",
                                   .n_unknowns = 1,
                                   .n_parameters = 5,
                                   .n_discrete = 3,
                                   .n_nonzeros = 1,
                                   .n_outputs = 3,
                                   .n_roots = 2,
                                   .n_whens = 2,
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
