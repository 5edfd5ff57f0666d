/* Capacitor behind a resistor at a node: C v' = (w - v) / R; the flow into the branch is (w - v) / R.
 * p: R (ohm), C (F); w0: potential of the node (V). */
#include "gustform/gust_kernel.h"

static void prepare(const double *p, double *c)
{
    (void)p;
    (void)c;
}

static void residual(const gust_point *at, double *r, double *flow)
{
    const double i = (at->w[0] - at->y[0]) / at->p[0];
    r[0] = at->p[1] * at->yp[0] - i;
    flow[0] = i;
}

static const int32_t ROW[] = {0, 0, 1, 1};
static const int32_t COLUMN[] = {0, 1, 0, 1};

static void jacobian(const gust_point *at, double *value)
{
    const double g = 1.0 / at->p[0];
    value[0] = at->cj * at->p[1] + g;
    value[1] = -g;
    value[2] = -g;
    value[3] = g;
}

static void outputs(const gust_point *at, double *value)
{
    value[0] = (at->w[0] - at->y[0]) / at->p[0];
}

static const gust_kernel KERNEL = {.abi = GUST_KERNEL_ABI,
                                   .type_name = "branch",
                                   .n_unknowns = 1,
                                   .n_external = 1,
                                   .n_parameters = 2,
                                   .n_flows = 1,
                                   .n_nonzeros = 4,
                                   .n_outputs = 1,
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
