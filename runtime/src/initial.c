#include "initial.h"

#include <math.h>
#include <string.h>

#include "diagnose.h"
#include "lanes.h"
#include "memory.h"
#include "text.h"

gust_status gust_initial_create(gust_initial *initial, gust_system *system, const gust_options *options,
                                klu_symbolic *symbolic, const klu_common *common)
{
    const gust_model *model = system->model;
    /* Rounded up as gust_lu_solve wants it. */
    const size_t n = (size_t)gust_lane_padded(model->n_unknowns);
    const size_t n_nonzeros = (size_t)model->n_nonzeros;
    *initial = (gust_initial){.system = system, .options = options};
    const bool started = gust_factors_start(&initial->factors, model->n_unknowns, model->column_start,
                                            model->row_index, symbolic, common);
    initial->factors.growth_check = 1;
    initial->residual = gust_allocate(n, sizeof(double));
    initial->values = gust_allocate(n_nonzeros, sizeof(double));
    initial->values_1 = gust_allocate(n_nonzeros, sizeof(double));
    initial->correction = gust_allocate(n, sizeof(double));
    initial->next_correction = gust_allocate(n, sizeof(double));
    initial->weight = gust_allocate(n, sizeof(double));
    initial->trial_y = gust_allocate(n, sizeof(double));
    initial->trial_yp = gust_allocate(n, sizeof(double));
    const bool complete = started && initial->residual != NULL && initial->values != NULL &&
                          initial->values_1 != NULL && initial->correction != NULL &&
                          initial->next_correction != NULL && initial->weight != NULL &&
                          initial->trial_y != NULL && initial->trial_yp != NULL;
    return complete ? GUST_OK : GUST_OUT_OF_MEMORY;
}

void gust_initial_free(gust_initial *initial)
{
    gust_factors_free(&initial->factors);
    gust_release(initial->residual);
    gust_release(initial->values);
    gust_release(initial->values_1);
    gust_release(initial->correction);
    gust_release(initial->next_correction);
    gust_release(initial->weight);
    gust_release(initial->trial_y);
    gust_release(initial->trial_yp);
    *initial = (gust_initial){0};
}

static gust_status series_failure(const gust_initial *initial, char *message, size_t size)
{
    gust_text(message, size, "%s", initial->system->series.message);
    return initial->system->series.failure;
}

static gust_status not_finite(const gust_initial *initial, double t, int32_t row, char *message, size_t size)
{
    char name[240];
    gust_model_equation_name(initial->system->model, row, name, sizeof name);
    gust_text(message, size,
              "at t = %.9g s the equation %s gives %g: look for a division by zero or a root of a negative "
              "number, and at the start values it uses",
              t, name, initial->residual[row]);
    return GUST_NOT_FINITE;
}

/* 1 / tolerance of each z: of an algebraic unknown as in the error test; of a derivative as if it acted for
 * one second, the time scale of the field. */
static void set_weights(gust_initial *initial, const double *y, const double *yp)
{
    const gust_model *model = initial->system->model;
    const double rtol = initial->options->rtol;
    const double atol = gust_options_absolute(initial->options);
    for (int32_t i = 0; i < model->n_unknowns; ++i) {
        const double size = fabs(model->differential[i] ? yp[i] : y[i]);
        initial->weight[i] = 1.0 / (rtol * size + atol * model->nominal[i]);
    }
}

static double weighted_norm(const gust_initial *initial, const double *vector)
{
    const int32_t n = initial->system->model->n_unknowns;
    double sum = 0.0;
    for (int32_t i = 0; i < n; ++i) {
        const double term = vector[i] * initial->weight[i];
        sum += term * term;
    }
    return sqrt(sum / n);
}

static bool set_matrix(gust_initial *initial, double t, const double *y, const double *yp)
{
    gust_system *system = initial->system;
    const gust_model *model = system->model;
    if (!gust_system_jacobian(system, t, y, yp, 0.0, initial->values) ||
        !gust_system_jacobian(system, t, y, yp, 1.0, initial->values_1)) {
        return false;
    }
    for (int32_t column = 0; column < model->n_unknowns; ++column) {
        if (model->differential[column]) {
            for (int32_t k = model->column_start[column]; k < model->column_start[column + 1]; ++k) {
                initial->values[k] = initial->values_1[k] - initial->values[k];
            }
        }
    }
    return true;
}

/* y, yp minus `factor` times the correction into trial_y, trial_yp. */
static void try_step(gust_initial *initial, const double *y, const double *yp, const double *correction,
                     double factor)
{
    const gust_model *model = initial->system->model;
    for (int32_t i = 0; i < model->n_unknowns; ++i) {
        const double change = factor * correction[i];
        initial->trial_y[i] = model->differential[i] ? y[i] : y[i] - change;
        initial->trial_yp[i] = model->differential[i] ? yp[i] - change : yp[i];
    }
}

static void keep_trial(const gust_initial *initial, double *y, double *yp)
{
    const size_t bytes = (size_t)initial->system->model->n_unknowns * sizeof(double);
    memcpy(y, initial->trial_y, bytes);
    memcpy(yp, initial->trial_yp, bytes);
}

static gust_status singular(gust_initial *initial, double t, bool thorough, char *message, size_t size)
{
    const gust_model *model = initial->system->model;
    gust_text(message, size, "at t = %.9g s the equations do not determine all unknowns (singular Jacobian)",
              t);
    if (thorough) {
        gust_diagnose_singular(model, initial->values, initial->factors.singular_column, message, size);
    } else if (initial->factors.singular_column >= 0) {
        char name[240];
        gust_model_unknown_name(model, initial->factors.singular_column, name, sizeof name);
        gust_text_append(message, size, "; look at %s", name);
    }
    return GUST_SINGULAR;
}

static gust_status not_consistent(gust_initial *initial, double t, const double *y, const double *yp,
                                  int iterations, char *message, size_t size)
{
    const gust_model *model = initial->system->model;
    gust_text(message, size,
              "at t = %.9g s no consistent values were found in %d iterations: try start values nearer to the "
              "solution, or a larger initial_iterations",
              t, iterations);
    if (gust_system_residual(initial->system, t, y, yp, initial->residual)) {
        gust_diagnose_rows(model, initial->residual, initial->values, message, size);
    }
    for (int32_t i = 0; i < model->n_unknowns; ++i) {
        initial->trial_y[i] = model->differential[i] ? yp[i] : y[i];
        initial->next_correction[i] = initial->correction[i] * initial->weight[i];
    }
    gust_diagnose_unknowns(model, initial->next_correction, initial->trial_y,
                           "corrections (differential ones: of the derivative), in tolerances", message, size);
    return GUST_NOT_CONSISTENT;
}

enum { MAX_HALVINGS = 17 }; /* a step of 1e-5 of Newton's gets nowhere */

typedef enum damped { DAMPED_ACCEPTED, DAMPED_CONVERGED, DAMPED_REJECTED, DAMPED_SERIES } damped;

/* One damped Newton step from y, yp along initial->correction of size `norm`. */
static damped damped_step(gust_initial *initial, double t, double *y, double *yp, double norm)
{
    gust_system *system = initial->system;
    const double tolerance = initial->options->initial_tolerance;
    double factor = 1.0;
    for (int halvings = 0; halvings < MAX_HALVINGS; ++halvings, factor *= 0.5) {
        try_step(initial, y, yp, initial->correction, factor);
        if (!gust_system_residual(system, t, initial->trial_y, initial->trial_yp, initial->residual)) {
            return DAMPED_SERIES;
        }
        if (gust_system_not_finite(system, initial->residual) >= 0) {
            continue;
        }
        gust_factors_solve(&initial->factors, initial->residual, initial->next_correction);
        const double next = weighted_norm(initial, initial->next_correction);
        if (factor == 1.0 && next < tolerance) {
            keep_trial(initial, y, yp);
            try_step(initial, y, yp, initial->next_correction, 1.0);
            keep_trial(initial, y, yp);
            return DAMPED_CONVERGED;
        }
        if (next <= (1.0 - 0.25 * factor) * norm) {
            keep_trial(initial, y, yp);
            return DAMPED_ACCEPTED;
        }
        /* Within the tolerance and no longer getting smaller: this is rounding. */
        if (factor == 1.0 && norm < 1.0) {
            return DAMPED_CONVERGED;
        }
    }
    return DAMPED_REJECTED;
}

gust_status gust_initial_solve(gust_initial *initial, double t, double *y, double *yp, bool thorough,
                               char *message, size_t size)
{
    gust_system *system = initial->system;
    const int limit = (int)initial->options->initial_iterations;
    for (int iteration = 1; iteration <= limit; ++iteration) {
        if (!gust_system_residual(system, t, y, yp, initial->residual) || !set_matrix(initial, t, y, yp)) {
            return series_failure(initial, message, size);
        }
        const int32_t row = gust_system_not_finite(system, initial->residual);
        if (row >= 0) {
            return not_finite(initial, t, row, message, size);
        }
        if (!gust_factors_set(&initial->factors, initial->values)) {
            return singular(initial, t, thorough, message, size);
        }
        ++initial->iterations;
        set_weights(initial, y, yp);
        gust_factors_solve(&initial->factors, initial->residual, initial->correction);
        const double norm = weighted_norm(initial, initial->correction);
        if (!isfinite(norm)) {
            return singular(initial, t, thorough, message, size);
        }
        if (norm < initial->options->initial_tolerance) {
            try_step(initial, y, yp, initial->correction, 1.0);
            keep_trial(initial, y, yp);
            return GUST_OK;
        }
        switch (damped_step(initial, t, y, yp, norm)) {
        case DAMPED_ACCEPTED:
            break;
        case DAMPED_CONVERGED:
            return GUST_OK;
        case DAMPED_SERIES:
            return series_failure(initial, message, size);
        case DAMPED_REJECTED:
            return not_consistent(initial, t, y, yp, iteration, message, size);
        }
    }
    return not_consistent(initial, t, y, yp, limit, message, size);
}

double gust_initial_step(gust_initial *initial, double t, const double *y, double *yp, double longest)
{
    gust_system *system = initial->system;
    const gust_model *model = system->model;
    const int32_t n = model->n_unknowns;
    const double rtol = initial->options->rtol;
    const double atol = gust_options_absolute(initial->options);
    /* d/dt of F = 0 at fixed z gives the same matrix times (y'' of differential, y' of algebraic unknowns):
     * M z' = -(F_t + F_y y'), the right-hand side by a difference over so little time that no unknown moves
     * by more than a ten-thousandth of its nominal value. */
    double fastest = 0.0;
    for (int32_t i = 0; i < n; ++i) {
        if (model->differential[i]) {
            fastest = fmax(fastest, fabs(yp[i]) / model->nominal[i]);
        }
    }
    const double little = 1e-4 / (1.0 + fastest) + 1e-12 * fabs(t);
    for (int32_t i = 0; i < n; ++i) {
        initial->trial_y[i] = model->differential[i] ? y[i] + little * yp[i] : y[i];
    }
    if (!gust_system_residual(system, t, y, yp, initial->residual) ||
        !gust_system_residual(system, t + little, initial->trial_y, yp, initial->correction)) {
        return 1e-6;
    }
    for (int32_t i = 0; i < n; ++i) {
        initial->correction[i] = (initial->residual[i] - initial->correction[i]) / little;
    }
    if (gust_system_not_finite(system, initial->correction) >= 0) {
        return 1e-6;
    }
    gust_factors_solve(&initial->factors, initial->correction, initial->correction);
    double sum = 0.0;
    for (int32_t i = 0; i < n; ++i) {
        if (model->differential[i]) {
            const double term = initial->correction[i] / (rtol * fabs(y[i]) + atol * model->nominal[i]);
            sum += term * term;
        } else {
            yp[i] = initial->correction[i];
        }
    }
    const double curvature = sqrt(sum / n);
    /* Error of one step of order 1: h^2 y'' / 2; half of the tolerance is aimed at. */
    const double step = 1.0 / sqrt(curvature + 1e-300);
    return fmin(step, longest);
}
