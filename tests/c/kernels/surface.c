/* Relaxation towards a table value: x' = table(u0, u1) - x. */
#include "gustform/gust_kernel.h"

static void prepare(const double *p, double *c)
{
    (void)p;
    (void)c;
}

static void residual(const gust_point *at, double *r, double *flow)
{
    (void)flow;
    double value, dx, dy;
    gust_table_evaluate(at->tables[0], at->u[0], at->u[1], &value, &dx, &dy);
    r[0] = at->yp[0] + at->y[0] - value;
}

static const int32_t ROW[] = {0};
static const int32_t COLUMN[] = {0};

static void jacobian(const gust_point *at, double *value)
{
    value[0] = at->cj + 1.0;
}

static const gust_kernel KERNEL = {.abi = GUST_KERNEL_ABI,
                                   .type_name = "surface",
                                   .n_unknowns = 1,
                                   .n_inputs = 2,
                                   .n_tables = 1,
                                   .n_nonzeros = 1,
                                   .jacobian_row = ROW,
                                   .jacobian_column = COLUMN,
                                   .prepare = prepare,
                                   .residual = residual,
                                   .jacobian = jacobian};

const gust_kernel *gust_kernel_get(void);

const gust_kernel *gust_kernel_get(void)
{
    return &KERNEL;
}
