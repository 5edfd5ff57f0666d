/* Time series that drive inputs.
 *
 * Linear series are evaluated wherever the integrator asks: no stop and no restart at a sample, since a
 * restart would cost more steps than a smooth wind needs in all. Held series are steps: their slots change
 * only in gust_series_update, at times the integrator stops for, so that a step never sees both sides.
 * The same holds for the jump back of a repeated series. */
#ifndef GUSTFORM_SERIES_H
#define GUSTFORM_SERIES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gustform/gust_sim.h"
#include "model.h"

typedef struct gust_series {
    const gust_model_series *what;
    gust_series_reader reader;
    void *context;
    int64_t first;      /* number of the first sample in the window */
    int64_t count;      /* samples in the window */
    const double *time; /* [count], NULL if uniform */
    const double *value;
    double *time_buffer; /* [capacity], NULL if the samples are in the model */
    double *value_buffer;
    int64_t capacity;
    int64_t cursor;  /* sample in the window that the last look-up used */
    int64_t n_total; /* how many samples there are; INT64_MAX while unknown */
    double step_inverse;
    double end;   /* last time with data, s */
    double shift; /* what has been repeated so far, s */
    double next;  /* next time at which gust_series_update has something to do, s */
} gust_series;

typedef struct gust_series_set {
    gust_series *series;
    int32_t n_series;
    bool opened;
    double evaluated_at; /* the time for which the linear slots hold */
    double end;          /* first time at which a series that may not end ends, s */
    int32_t ending;      /* that series */
    gust_status failure; /* of the last look-up, GUST_OK if none */
    char message[512];
} gust_series_set;

/* One window for each series of the model; nothing is read yet. Free with gust_series_free. */
gust_status gust_series_create(gust_series_set *set, const gust_model *model);
void gust_series_free(gust_series_set *set);

/* Allocates windows of `block` samples and reads the first; then writes all slots for time t. */
gust_status gust_series_open(gust_series_set *set, int64_t block, double t, double *inputs);

/* Writes the slots of all linear series for time t. false: see set->failure and set->message. */
bool gust_series_evaluate(gust_series_set *set, double t, double *inputs);

/* At a time gust_series_next named: writes held slots as from t on, starts repetitions. *changed is set if
 * a slot got another value. */
bool gust_series_update(gust_series_set *set, double t, double *inputs, bool *changed);

/* Next time at which gust_series_update must be called, s. */
double gust_series_next(const gust_series_set *set);

#endif
