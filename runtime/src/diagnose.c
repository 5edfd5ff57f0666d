#include "diagnose.h"

#include <math.h>
#include <stdbool.h>

#include "memory.h"
#include "text.h"

enum { N_WORST = 5, NAME = 240, LARGEST_DENSE = 600 };

/* The indices of the largest |values| in descending order; how many of them are not 0. */
static int largest(const double *values, int32_t n, int32_t worst[N_WORST])
{
    int found = 0;
    for (int32_t i = 0; i < n; ++i) {
        const double size = isnan(values[i]) ? INFINITY : fabs(values[i]);
        int place = found;
        while (place > 0) {
            const double other = values[worst[place - 1]];
            if (!(size > (isnan(other) ? INFINITY : fabs(other)))) {
                break;
            }
            --place;
        }
        if (place >= N_WORST || size == 0.0) {
            continue;
        }
        const int last = found < N_WORST ? found : N_WORST - 1;
        for (int k = last; k > place; --k) {
            worst[k] = worst[k - 1];
        }
        worst[place] = i;
        found = found < N_WORST ? found + 1 : N_WORST;
    }
    return found;
}

static double row_scale(const gust_model *model, const double *values, int32_t row)
{
    double scale = 0.0;
    for (int32_t column = 0; column < model->n_unknowns; ++column) {
        for (int32_t k = model->column_start[column]; k < model->column_start[column + 1]; ++k) {
            if (model->row_index[k] == row) {
                scale = fmax(scale, fabs(values[k]) * model->nominal[column]);
            }
        }
    }
    return scale > 0.0 && isfinite(scale) ? scale : 1.0;
}

void gust_diagnose_rows(const gust_model *model, const double *residual, const double *values, char *message,
                        size_t size)
{
    double *scaled = gust_allocate((size_t)model->n_unknowns, sizeof *scaled);
    double *scale = gust_allocate((size_t)model->n_unknowns, sizeof *scale);
    int32_t worst[N_WORST];
    if (scaled != NULL && scale != NULL) {
        for (int32_t column = 0; column < model->n_unknowns; ++column) {
            for (int32_t k = model->column_start[column]; k < model->column_start[column + 1]; ++k) {
                const double term = fabs(values[k]) * model->nominal[column];
                if (isfinite(term)) {
                    scale[model->row_index[k]] = fmax(scale[model->row_index[k]], term);
                }
            }
        }
        for (int32_t row = 0; row < model->n_unknowns; ++row) {
            scaled[row] = scale[row] > 0.0 ? residual[row] / scale[row] : residual[row];
        }
    }
    const int found = largest(scaled != NULL && scale != NULL ? scaled : residual, model->n_unknowns, worst);
    for (int k = 0; k < found; ++k) {
        char name[NAME];
        gust_model_equation_name(model, worst[k], name, sizeof name);
        gust_text_append(message, size, "%s\n  equation %s  [off by %.6g, %.2g of its largest term]",
                         k == 0 ? "\nEquations that fit worst:" : "", name, residual[worst[k]],
                         fabs(residual[worst[k]]) / row_scale(model, values, worst[k]));
    }
    gust_release(scaled);
    gust_release(scale);
}

void gust_diagnose_unknowns(const gust_model *model, const double *weighted, const double *value,
                            const char *what, char *message, size_t size)
{
    int32_t worst[N_WORST];
    const int found = largest(weighted, model->n_unknowns, worst);
    for (int k = 0; k < found; ++k) {
        char name[NAME];
        gust_model_unknown_name(model, worst[k], name, sizeof name);
        gust_text_append(message, size, "%s%s%s\n  %s = %.9g  [%.3g]",
                         k == 0 ? "\nUnknowns with the largest " : "", k == 0 ? what : "", k == 0 ? ":" : "",
                         name, value[worst[k]], fabs(weighted[worst[k]]));
    }
}

/* Gauss elimination with complete pivoting of a[n * n] (row by row), scaled to entries of size 1. Returns
 * the rank; row[] and column[] are the order of pivots. */
static int32_t eliminate(double *a, int32_t n, int32_t *row, int32_t *column)
{
    double first = 0.0;
    for (int32_t k = 0; k < n; ++k) {
        row[k] = k;
        column[k] = k;
    }
    for (int32_t k = 0; k < n; ++k) {
        int32_t at_row = k;
        int32_t at_column = k;
        double best = -1.0;
        for (int32_t i = k; i < n; ++i) {
            for (int32_t j = k; j < n; ++j) {
                const double size = fabs(a[(int64_t)row[i] * n + column[j]]);
                if (size > best) {
                    best = size;
                    at_row = i;
                    at_column = j;
                }
            }
        }
        first = k == 0 ? best : first;
        if (!(best > 1e-13 * first)) {
            return k;
        }
        const int32_t swapped_row = row[k];
        row[k] = row[at_row];
        row[at_row] = swapped_row;
        const int32_t swapped_column = column[k];
        column[k] = column[at_column];
        column[at_column] = swapped_column;
        const double *pivot_row = a + (int64_t)row[k] * n;
        for (int32_t i = k + 1; i < n; ++i) {
            double *other = a + (int64_t)row[i] * n;
            const double factor = other[column[k]] / pivot_row[column[k]];
            other[column[k]] = factor; /* kept: needed for the left null vector */
            for (int32_t j = k + 1; factor != 0.0 && j < n; ++j) {
                other[column[j]] -= factor * pivot_row[column[j]];
            }
        }
    }
    return n;
}

/* The null vectors that belong to the first missing pivot: right[] by column, left[] by row. */
static void null_vectors(const double *a, int32_t n, int32_t rank, const int32_t *row, const int32_t *column,
                         double *right, double *left)
{
    right[column[rank]] = 1.0;
    for (int32_t k = rank - 1; k >= 0; --k) {
        double sum = 0.0;
        for (int32_t j = k + 1; j <= rank; ++j) {
            sum += a[(int64_t)row[k] * n + column[j]] * right[column[j]];
        }
        right[column[k]] = -sum / a[(int64_t)row[k] * n + column[k]];
    }
    left[row[rank]] = 1.0;
    for (int32_t k = rank - 1; k >= 0; --k) {
        double sum = 0.0;
        for (int32_t i = k + 1; i <= rank; ++i) {
            sum += a[(int64_t)row[i] * n + column[k]] * left[row[i]];
        }
        left[row[k]] = -sum;
    }
}

static void name_null_space(const gust_model *model, const double *right, const double *left, char *message,
                            size_t size)
{
    int32_t worst[N_WORST];
    char name[NAME];
    int found = largest(right, model->n_unknowns, worst);
    gust_text_append(message, size, "\nUnknowns that the equations leave open (together):");
    for (int k = 0; k < found && fabs(right[worst[k]]) > 1e-6 * fabs(right[worst[0]]); ++k) {
        gust_model_unknown_name(model, worst[k], name, sizeof name);
        gust_text_append(message, size, "\n  %s%s", name,
                         model->differential[worst[k]] ? " (its derivative)" : "");
    }
    found = largest(left, model->n_unknowns, worst);
    gust_text_append(message, size, "\nEquations that say the same or nothing (together):");
    for (int k = 0; k < found && fabs(left[worst[k]]) > 1e-6 * fabs(left[worst[0]]); ++k) {
        gust_model_equation_name(model, worst[k], name, sizeof name);
        gust_text_append(message, size, "\n  %s", name);
    }
}

static bool diagnose_dense(const gust_model *model, const double *values, char *message, size_t size)
{
    const int32_t n = model->n_unknowns;
    double *a = gust_allocate((size_t)n * (size_t)n, sizeof *a);
    double *vectors = gust_allocate(2 * (size_t)n, sizeof *vectors);
    int32_t *order = gust_allocate(2 * (size_t)n, sizeof *order);
    bool named = false;
    if (a != NULL && vectors != NULL && order != NULL) {
        for (int32_t column = 0; column < n; ++column) {
            for (int32_t k = model->column_start[column]; k < model->column_start[column + 1]; ++k) {
                a[(int64_t)model->row_index[k] * n + column] = values[k] * model->nominal[column];
            }
        }
        for (int32_t row = 0; row < n; ++row) {
            double scale = 0.0;
            for (int32_t column = 0; column < n; ++column) {
                scale = fmax(scale, fabs(a[(int64_t)row * n + column]));
            }
            for (int32_t column = 0; scale > 0.0 && column < n; ++column) {
                a[(int64_t)row * n + column] /= scale;
            }
        }
        const int32_t rank = eliminate(a, n, order, order + n);
        if (rank < n) {
            null_vectors(a, n, rank, order, order + n, vectors, vectors + n);
            name_null_space(model, vectors, vectors + n, message, size);
            named = true;
        }
    }
    gust_release(a);
    gust_release(vectors);
    gust_release(order);
    return named;
}

void gust_diagnose_singular(const gust_model *model, const double *values, int32_t column, char *message,
                            size_t size)
{
    if (model->n_unknowns <= LARGEST_DENSE && diagnose_dense(model, values, message, size)) {
        return;
    }
    if (column >= 0 && column < model->n_unknowns) {
        char name[NAME];
        gust_model_unknown_name(model, column, name, sizeof name);
        gust_text_append(message, size, "\nThe equations do not determine %s%s.", name,
                         model->differential[column] ? " (its derivative)" : "");
    }
}
