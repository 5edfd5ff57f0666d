/* The equations F(t, y, y') = 0 with their inputs: time series and instances together, and counters. */
#ifndef GUSTFORM_SYSTEM_H
#define GUSTFORM_SYSTEM_H

#include <stdbool.h>
#include <stdint.h>

#include "assembly.h"
#include "series.h"

typedef struct gust_system {
    const gust_model *model;
    gust_assembly assembly;
    gust_series_set series;
    int64_t residual_evaluations;
    int64_t jacobian_evaluations;
    int64_t root_evaluations;
} gust_system;

/* Free with gust_system_free, also after an error. */
gust_status gust_system_create(gust_system *system, const gust_model *model);
void gust_system_free(gust_system *system);

/* Inputs for time t. All of these: false if a time series failed, see system->series. */
bool gust_system_inputs(gust_system *system, double t);
bool gust_system_residual(gust_system *system, double t, const double *y, const double *yp, double *residual);
bool gust_system_jacobian(gust_system *system, double t, const double *y, const double *yp, double cj,
                          double *values);

/* First row whose residual is not finite, -1 if all are. */
int32_t gust_system_not_finite(const gust_system *system, const double *residual);

#endif
