/* Zero crossings and when-clauses.
 *
 * A when-clause fires when its condition becomes true (its root function rises through 0): found by the
 * integrator between events, or caused by another event at the same time. A condition that is true at the
 * start does not fire. Clauses that fire together read the values before all of them; then the algebraic
 * unknowns are solved again and the conditions looked at again, until none becomes true any more. */
#ifndef GUSTFORM_EVENTS_H
#define GUSTFORM_EVENTS_H

#include <stdbool.h>
#include <stdint.h>

#include "controls.h"
#include "initial.h"
#include "options.h"
#include "sampler.h"
#include "system.h"

/* A root function that the integrator watches. */
typedef struct gust_watched {
    const gust_block *block;
    int32_t instance;
    int32_t root; /* of its type */
    bool is_when;
} gust_watched;

/* A when-clause with a condition. */
typedef struct gust_conditional {
    const gust_block *block;
    int32_t instance;
    int32_t clause;
    int64_t watched; /* its root function */
    bool was_true;
    bool fires;
} gust_conditional;

typedef struct gust_events {
    gust_watched *watched;
    int64_t n_watched;
    gust_conditional *conditional;
    int64_t n_conditional;
    double *value;   /* [n_watched] */
    double *scratch; /* root functions of one instance */
    int *direction;  /* [n_watched] for the integrator */
    int *found;      /* [n_watched] from the integrator */
    double *y_after;
    double *discrete_after;
    bool unsettled; /* a condition is exactly 0 where the integrator starts: it would not see it become true */
    int64_t n_events;
    double last_event; /* time of the last root found, s */
    int64_t in_succession;
} gust_events;

/* Free with gust_events_free. `kinks`: limiter crossings are watched too. */
gust_status gust_events_create(gust_events *events, const gust_system *system, bool kinks);
void gust_events_free(gust_events *events);

/* All watched root functions into value[n_watched]. false if a time series failed. */
bool gust_events_roots(gust_events *events, gust_system *system, double t, const double *y, const double *yp,
                       double *value);

/* Takes the conditions as they are at t, where the integrator starts. false if a time series failed. */
bool gust_events_settle(gust_events *events, gust_system *system, double t, const double *y, const double *yp);

/* After the first step from an unsettled start: whether a condition has become true in it, marked in
 * events->found. false if a time series failed. */
bool gust_events_missed(gust_events *events, gust_system *system, double t, const double *y, const double *yp,
                        bool *any);

/* Everything that happens at t. `found`: the integrator stopped at roots, marked in events->found.
 * y, yp are the values before on entry and consistent values after on return, if *changed. */
gust_status gust_events_handle(gust_events *events, gust_system *system, gust_sampler *sampler,
                               gust_controls *controls, gust_initial *initial, const gust_options *options,
                               double t, bool found, double *y, double *yp, bool *changed, char *message,
                               size_t size);

/* For checkpoints; the conditions themselves are settled again after loading. */
void gust_events_archive(gust_events *events, gust_archive *archive);

/* Name of a watched root function, for messages. */
void gust_events_name(const gust_watched *watched, char *text, size_t size);

#endif
