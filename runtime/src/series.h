/* Time series that drive inputs.
 *
 * Linear and PCHIP series are evaluated wherever the integrator asks: no stop and no restart at a sample,
 * since a restart would cost more steps than a smooth wind needs in all. Held series are steps: their slots
 * change only in gust_series_update, at times the integrator stops for, so that a step never sees both sides.
 * The same holds for the jump back of a repeated series.
 *
 * The integrator sees a series only where it evaluates it. After a long calm its steps are long, and a short
 * gust between two evaluations would not exist for it; gust_series_limit looks at the samples a step would
 * pass over and says how far it may go.
 *
 * PCHIP: cubic in each interval, slopes by F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300:
 * monotone where the samples are, C1. Slopes at the first and last sample: the one-sided three-point formula,
 * limited so that the shape is kept (C. Moler, Numerical Computing with MATLAB, SIAM 2004, 3.6); the same as
 * SciPy's PchipInterpolator. */
#ifndef GUSTFORM_SERIES_H
#define GUSTFORM_SERIES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "archive.h"
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
    double latest;       /* value at the time last evaluated, unless held */
    double size;         /* largest |value| in the window */
    int64_t cubic_of;    /* number of the sample whose interval `cubic` holds for, -1 for none */
    double cubic[4];     /* value = sum of cubic[i] (t - time of the sample)^i */
    double end;          /* last time with data, s */
    double shift;        /* what has been repeated so far, s */
    double next;         /* next time at which gust_series_update has something to do, s */
    int64_t saved_first; /* from a checkpoint, for gust_series_reopen */
} gust_series;

typedef struct gust_series_set {
    gust_series *series;
    int32_t n_series;
    bool opened;
    double evaluated_at; /* the time for which the slots that are interpolated hold */
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

/* Writes the slots of all interpolated series for time t. false: see set->failure and set->message. */
bool gust_series_evaluate(gust_series_set *set, double t, double *inputs);

/* At a time gust_series_next named: writes held slots as from t on, starts repetitions. *changed is set if
 * a slot got another value. */
bool gust_series_update(gust_series_set *set, double t, double *inputs, bool *changed);

/* Next time at which gust_series_update must be called, s. */
double gust_series_next(const gust_series_set *set);

/* For checkpoints: where in the data each series is. After loading, gust_series_reopen reads the same windows
 * again; false: see set->failure. */
void gust_series_archive(gust_series_set *set, gust_archive *archive);
bool gust_series_reopen(gust_series_set *set);

/* Latest time to which a step from t may go, if it is meant to be `step` long: as far as the samples of every
 * interpolated series stay within `tolerance` (of the series' size) of the straight line between its ends,
 * and at least to the next sample. *limit is infinite if the step may be taken. false: see set->failure. */
bool gust_series_limit(gust_series_set *set, double t, double step, double tolerance, double *limit);

#endif
