#include "system.h"

#include <math.h>

gust_status gust_system_create(gust_system *system, const gust_model *model)
{
    *system = (gust_system){.model = model};
    gust_status status = gust_assembly_create(&system->assembly, model);
    if (status == GUST_OK) {
        status = gust_series_create(&system->series, model);
    }
    return status;
}

void gust_system_free(gust_system *system)
{
    gust_assembly_free(&system->assembly);
    gust_series_free(&system->series);
}

bool gust_system_inputs(gust_system *system, double t)
{
    return gust_series_evaluate(&system->series, t, system->assembly.inputs);
}

bool gust_system_residual(gust_system *system, double t, const double *y, const double *yp, double *residual)
{
    if (!gust_system_inputs(system, t)) {
        return false;
    }
    ++system->residual_evaluations;
    gust_assembly_residual(&system->assembly, t, y, yp, residual);
    return true;
}

bool gust_system_jacobian(gust_system *system, double t, const double *y, const double *yp, double cj,
                          double *values)
{
    if (!gust_system_inputs(system, t)) {
        return false;
    }
    ++system->jacobian_evaluations;
    gust_assembly_jacobian(&system->assembly, t, y, yp, cj, values);
    return true;
}

int32_t gust_system_not_finite(const gust_system *system, const double *residual)
{
    const int32_t n = system->model->n_unknowns;
    /* 0 times a finite number is 0, anything else is not: one sum tells about all rows. */
    double lane[4] = {0.0, 0.0, 0.0, 0.0};
    int32_t i = 0;
    for (; i + 4 <= n; i += 4) {
        for (int k = 0; k < 4; ++k) {
            lane[k] += 0.0 * residual[i + k];
        }
    }
    for (; i < n; ++i) {
        lane[0] += 0.0 * residual[i];
    }
    if ((lane[0] + lane[1]) + (lane[2] + lane[3]) == 0.0) {
        return -1;
    }
    for (int32_t row = 0; row < n; ++row) {
        if (!isfinite(residual[row])) {
            return row;
        }
    }
    return -1;
}
