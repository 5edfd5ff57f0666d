/* Resistor and capacitor at a voltage source: R C v' = u - v, with the current i = (u - v) / R as an
 * algebraic unknown. p: R (ohm), C (F); u: source voltage (V); outputs: v, i, stored energy. */
#include "gustform/gust_kernel.h"

static void prepare(const double *p, double *c)
{
    c[0] = 1.0 / p[0];
}

static void residual(const gust_point *at, double *r, double *flow)
{
    (void)flow;
    r[0] = at->p[1] * at->yp[0] - at->y[1];
    r[1] = at->y[1] - (at->u[0] - at->y[0]) * at->c[0];
}

static void jacobian(const gust_point *at, double *value)
{
    value[0] = at->cj * at->p[1];
    value[1] = -1.0;
    value[2] = at->c[0];
    value[3] = 1.0;
}

static void outputs(const gust_point *at, double *value)
{
    value[0] = at->y[0];
    value[1] = at->y[1];
    value[2] = 0.5 * at->p[1] * at->y[0] * at->y[0];
}

static const int32_t ROW[] = {0, 0, 1, 1};
static const int32_t COLUMN[] = {0, 1, 0, 1};

static const gust_kernel KERNEL = {.abi = GUST_KERNEL_ABI,
                                   .type_name = "rc",
                                   .n_unknowns = 2,
                                   .n_inputs = 1,
                                   .n_parameters = 2,
                                   .n_constants = 1,
                                   .n_nonzeros = 4,
                                   .n_outputs = 3,
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
