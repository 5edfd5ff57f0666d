/* Pendulum of length 1 in Cartesian coordinates, index reduced to 1:
 *     x' = u,  y' = v,  u' = -l x,  v' = -l y - g,  0 = u^2 + v^2 - l (x^2 + y^2) - g y
 * p: g (m/s^2). The tension l is algebraic. */
#include "gustform/gust_kernel.h"

static void prepare(const double *p, double *c)
{
    (void)p;
    (void)c;
}

static void residual(const gust_point *at, double *r, double *flow)
{
    (void)flow;
    const double x = at->y[0], y = at->y[1], u = at->y[2], v = at->y[3], l = at->y[4], g = at->p[0];
    r[0] = at->yp[0] - u;
    r[1] = at->yp[1] - v;
    r[2] = at->yp[2] + l * x;
    r[3] = at->yp[3] + l * y + g;
    r[4] = u * u + v * v - l * (x * x + y * y) - g * y;
}

static const int32_t ROW[] = {0, 0, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, 4, 4};
static const int32_t COLUMN[] = {0, 2, 1, 3, 0, 2, 4, 1, 3, 4, 0, 1, 2, 3, 4};

static void jacobian(const gust_point *at, double *value)
{
    const double x = at->y[0], y = at->y[1], u = at->y[2], v = at->y[3], l = at->y[4], g = at->p[0];
    const double entries[] = {
        at->cj, -1.0,         at->cj,           -1.0,    l,       at->cj,          x, l, at->cj,
        y,      -2.0 * l * x, -2.0 * l * y - g, 2.0 * u, 2.0 * v, -(x * x + y * y)};
    for (int k = 0; k < 15; ++k) {
        value[k] = entries[k];
    }
}

static const gust_kernel KERNEL = {.abi = GUST_KERNEL_ABI,
                                   .type_name = "pendulum",
                                   .n_unknowns = 5,
                                   .n_parameters = 1,
                                   .n_nonzeros = 15,
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
