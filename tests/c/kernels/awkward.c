/* Equations that fail on demand:
 *     x' = -x + p2 x^2,   0 = p0 z + p1 z^2 - u - p3 / (x - p4)
 * p0 = p1 = 0: z is not determined; p1 > 0: two solutions or none; p2 > 0: x escapes in finite time;
 * p3 > 0: not a number at x = p4. */
#include "gustform/gust_kernel.h"

static void prepare(const double *p, double *c)
{
    (void)p;
    (void)c;
}

static double fraction(const gust_point *at)
{
    return at->p[3] == 0.0 ? 0.0 : at->p[3] / (at->y[0] - at->p[4]);
}

static void residual(const gust_point *at, double *r, double *flow)
{
    (void)flow;
    const double x = at->y[0], z = at->y[1];
    r[0] = at->yp[0] + x - at->p[2] * x * x;
    r[1] = at->p[0] * z + at->p[1] * z * z - at->u[0] - fraction(at);
}

static const int32_t ROW[] = {0, 1, 1};
static const int32_t COLUMN[] = {0, 0, 1};

static void jacobian(const gust_point *at, double *value)
{
    value[0] = at->cj + 1.0 - 2.0 * at->p[2] * at->y[0];
    value[1] = at->p[3] == 0.0 ? 0.0 : fraction(at) / (at->y[0] - at->p[4]);
    value[2] = at->p[0] + 2.0 * at->p[1] * at->y[1];
}

static const gust_kernel KERNEL = {.abi = GUST_KERNEL_ABI,
                                   .type_name = "awkward",
                                   .n_unknowns = 2,
                                   .n_inputs = 1,
                                   .n_parameters = 5,
                                   .n_nonzeros = 3,
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
