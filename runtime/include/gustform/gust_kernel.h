/* The compiled form of one unit type: what generated code provides and the runtime calls.
 *
 * A unit type is the flattened DAE of one thing a user would name (a turbine, a generator, a line):
 *
 *     0 = F(t, y, y', w, u, d, p)      n_unknowns rows, one for each local unknown
 *     f = f(t, y, y', w, u, d, p)      n_flows flows into the unit at its connectors
 *
 * y are its own unknowns (states first, then algebraic ones), w the unknowns it shares with others
 * (connector potentials and wired signals), u inputs (constants or time series), d discrete values,
 * p parameters. Everything that depends on p alone is computed once by prepare() into c.
 *
 * Generated code owns nothing: every array belongs to the caller, no function allocates, keeps state or
 * can fail. All functions may be called from several threads with different arguments.
 */
#ifndef GUSTFORM_GUST_KERNEL_H
#define GUSTFORM_GUST_KERNEL_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Raised whenever a struct of this header changes; the loader refuses any other value. */
#define GUST_KERNEL_ABI 1

/* C2 bicubic B-spline on a uniform grid; outside the grid the argument is clamped to its edge.
 * value(i, j) coefficients are stored row by row, (n_x + 2) x (n_y + 2). */
typedef struct gust_table {
    double x_start;        /* first grid line of x */
    double x_step_inverse; /* 1 / spacing */
    double y_start;
    double y_step_inverse;
    int32_t n_x; /* grid lines, at least 2 */
    int32_t n_y;
    const double *coefficient; /* [(n_x + 2) * (n_y + 2)] */
} gust_table;

/* Where and with which values one instance is evaluated. */
typedef struct gust_point {
    double t;                        /* simulated time, s */
    double cj;                       /* weight of dF/dy' in the Jacobian; 0 where not used */
    const double *y;                 /* [n_unknowns] */
    const double *yp;                /* [n_unknowns] time derivatives */
    const double *w;                 /* [n_external] */
    const double *u;                 /* [n_inputs] */
    const double *d;                 /* [n_discrete] */
    const double *p;                 /* [n_parameters] */
    const double *c;                 /* [n_constants] from prepare() */
    const gust_table *const *tables; /* [n_tables] */
} gust_point;

typedef struct gust_kernel {
    uint32_t abi;          /* GUST_KERNEL_ABI of the header it was compiled with */
    const char *type_name; /* for messages only */
    int32_t n_unknowns;
    int32_t n_external;
    int32_t n_inputs;
    int32_t n_parameters;
    int32_t n_constants;
    int32_t n_discrete;
    int32_t n_tables;
    int32_t n_flows;
    int32_t n_nonzeros; /* of the local Jacobian */
    int32_t n_outputs;
    int32_t n_roots;
    int32_t n_whens;
    /* Local Jacobian pattern. Row r < n_unknowns is residual row r, row n_unknowns + k is flow k;
     * column c < n_unknowns is y[c], column n_unknowns + k is w[k]. */
    const int32_t *jacobian_row;    /* [n_nonzeros] */
    const int32_t *jacobian_column; /* [n_nonzeros] */

    /* c(p). Called once before a run and again whenever a parameter of the instance changes. */
    void (*prepare)(const double *p, double *c);
    /* F into residual[n_unknowns], f into flow[n_flows]. */
    void (*residual)(const gust_point *at, double *residual, double *flow);
    /* d(F, f)/d(y, w) + cj d(F, f)/dy' into value[n_nonzeros], in pattern order. */
    void (*jacobian)(const gust_point *at, double *value);
    /* Every variable that can be recorded, into value[n_outputs]. */
    void (*outputs)(const gust_point *at, double *value);
    /* Zero-crossing functions into value[n_roots]. */
    void (*roots)(const gust_point *at, double *value);
    /* When-clause number `clause`: writes the y and d it changes (others are left as they are). The
     * values read through `at` are those before the event; y and d must not alias at->y, at->d. */
    void (*when)(const gust_point *at, int32_t clause, double *y, double *d);
} gust_kernel;

/* The one symbol a kernel library exports: const gust_kernel *gust_kernel_get(void); */
typedef const gust_kernel *(*gust_kernel_getter)(void);

/* Table look-up used by generated code: value and both partial derivatives (0 where clamped).
 * static inline, so that a kernel library needs nothing but libm. */
static inline void gust_table_evaluate(const gust_table *table, double x, double y, double *value, double *dx,
                                       double *dy)
{
    double s = (x - table->x_start) * table->x_step_inverse;
    double r = (y - table->y_start) * table->y_step_inverse;
    const double s_max = (double)(table->n_x - 1);
    const double r_max = (double)(table->n_y - 1);
    double s_slope = table->x_step_inverse;
    double r_slope = table->y_step_inverse;
    if (!(s > 0.0)) { /* also NaN */
        s_slope = s < 0.0 ? 0.0 : s_slope;
        s = 0.0;
    } else if (s > s_max) {
        s = s_max;
        s_slope = 0.0;
    }
    if (!(r > 0.0)) {
        r_slope = r < 0.0 ? 0.0 : r_slope;
        r = 0.0;
    } else if (r > r_max) {
        r = r_max;
        r_slope = 0.0;
    }
    int32_t i = (int32_t)s;
    int32_t j = (int32_t)r;
    i = i > table->n_x - 2 ? table->n_x - 2 : i;
    j = j > table->n_y - 2 ? table->n_y - 2 : j;
    const double a = s - (double)i;
    const double b = r - (double)j;
    const double a1 = 1.0 - a;
    const double b1 = 1.0 - b;
    const double sixth = 1.0 / 6.0;
    const double wa[4] = {a1 * a1 * a1 * sixth, (4.0 + a * a * (3.0 * a - 6.0)) * sixth,
                          (4.0 + a1 * a1 * (3.0 * a1 - 6.0)) * sixth, a * a * a * sixth};
    const double wb[4] = {b1 * b1 * b1 * sixth, (4.0 + b * b * (3.0 * b - 6.0)) * sixth,
                          (4.0 + b1 * b1 * (3.0 * b1 - 6.0)) * sixth, b * b * b * sixth};
    const double da[4] = {-0.5 * a1 * a1, a * (1.5 * a - 2.0), a1 * (2.0 - 1.5 * a1), 0.5 * a * a};
    const double db[4] = {-0.5 * b1 * b1, b * (1.5 * b - 2.0), b1 * (2.0 - 1.5 * b1), 0.5 * b * b};
    double sum = 0.0;
    double sum_x = 0.0;
    double sum_y = 0.0;
    const double *row = table->coefficient + (int64_t)i * (table->n_y + 2) + j;
    for (int32_t k = 0; k < 4; ++k, row += table->n_y + 2) {
        const double along = wb[0] * row[0] + wb[1] * row[1] + wb[2] * row[2] + wb[3] * row[3];
        const double slope = db[0] * row[0] + db[1] * row[1] + db[2] * row[2] + db[3] * row[3];
        sum += wa[k] * along;
        sum_x += da[k] * along;
        sum_y += wa[k] * slope;
    }
    *value = sum;
    *dx = sum_x * s_slope;
    *dy = sum_y * r_slope;
}

#ifdef __cplusplus
}
#endif

#endif
