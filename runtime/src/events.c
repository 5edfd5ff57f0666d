#include "events.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "text.h"

/* -- what is watched ------------------------------------------------------------------------------------ */

static bool watch(const gust_model_type *type, int32_t root, bool kinks)
{
    if (kinks) {
        return true;
    }
    for (int32_t k = 0; k < type->kernel->n_whens; ++k) {
        if (type->when_root[k] == root) {
            return true;
        }
    }
    return false;
}

static int32_t count_watched(const gust_model_type *type, bool kinks)
{
    int32_t count = 0;
    for (int32_t k = 0; k < type->kernel->n_roots; ++k) {
        count += watch(type, k, kinks) ? 1 : 0;
    }
    return count;
}

static void list_instance(gust_events *events, const gust_block *block, int32_t instance, bool kinks)
{
    const gust_model_type *type = block->type;
    const int64_t first = events->n_watched;
    for (int32_t k = 0; k < type->kernel->n_roots; ++k) {
        if (watch(type, k, kinks)) {
            const bool is_when = type->root_kind[k] == GUST_ROOT_WHEN;
            events->direction[events->n_watched] = is_when ? 1 : 0;
            events->watched[events->n_watched++] = (gust_watched){block, instance, k, is_when};
        }
    }
    for (int32_t k = 0; k < type->kernel->n_whens; ++k) {
        for (int64_t w = first; type->when_root[k] >= 0 && w < events->n_watched; ++w) {
            if (events->watched[w].root == type->when_root[k]) {
                events->conditional[events->n_conditional++] =
                    (gust_conditional){.block = block, .instance = instance, .clause = k, .watched = w};
            }
        }
    }
}

gust_status gust_events_create(gust_events *events, const gust_system *system, bool kinks)
{
    const gust_model *model = system->model;
    *events = (gust_events){.last_event = -INFINITY};
    int64_t n_watched = 0;
    int64_t n_whens = 0;
    int32_t n_roots = 0;
    for (int32_t b = 0; b < model->n_types; ++b) {
        const gust_model_type *type = &model->types[b];
        n_watched += (int64_t)type->n_instances * count_watched(type, kinks);
        n_whens += (int64_t)type->n_instances * type->kernel->n_whens;
        n_roots = type->kernel->n_roots > n_roots ? type->kernel->n_roots : n_roots;
    }
    events->watched = gust_allocate((size_t)n_watched, sizeof *events->watched);
    events->conditional = gust_allocate((size_t)n_whens, sizeof *events->conditional);
    events->value = gust_allocate((size_t)n_watched, sizeof *events->value);
    events->direction = gust_allocate((size_t)n_watched, sizeof *events->direction);
    events->found = gust_allocate((size_t)n_watched, sizeof *events->found);
    events->scratch = gust_allocate((size_t)n_roots, sizeof *events->scratch);
    events->y_after = gust_allocate((size_t)model->n_unknowns, sizeof *events->y_after);
    events->discrete_after = gust_allocate((size_t)system->assembly.n_discrete, sizeof *events->discrete_after);
    if (events->watched == NULL || events->conditional == NULL || events->value == NULL ||
        events->direction == NULL || events->found == NULL || events->scratch == NULL ||
        events->y_after == NULL || events->discrete_after == NULL) {
        return GUST_OUT_OF_MEMORY;
    }
    for (int32_t b = 0; b < model->n_types; ++b) {
        for (int32_t i = 0; i < model->types[b].n_instances; ++i) {
            list_instance(events, &system->assembly.blocks[b], i, kinks);
        }
    }
    return GUST_OK;
}

void gust_events_free(gust_events *events)
{
    gust_release(events->watched);
    gust_release(events->conditional);
    gust_release(events->value);
    gust_release(events->direction);
    gust_release(events->found);
    gust_release(events->scratch);
    gust_release(events->y_after);
    gust_release(events->discrete_after);
    *events = (gust_events){0};
}

bool gust_events_roots(gust_events *events, gust_system *system, double t, const double *y, const double *yp,
                       double *value)
{
    if (!gust_system_inputs(system, t)) {
        return false;
    }
    ++system->root_evaluations;
    const gust_watched *last = NULL;
    for (int64_t k = 0; k < events->n_watched; ++k) {
        const gust_watched *watched = &events->watched[k];
        if (last == NULL || watched->block != last->block || watched->instance != last->instance) {
            gust_assembly_roots(&system->assembly, watched->block, watched->instance, t, y, yp,
                                events->scratch);
        }
        value[k] = events->scratch[watched->root];
        last = watched;
    }
    return true;
}

void gust_events_name(const gust_watched *watched, char *text, size_t size)
{
    const gust_model_type *type = watched->block->type;
    gust_text(text, size, "%s.%s", type->instance_name[watched->instance], type->root_name[watched->root]);
}

/* -- what happens --------------------------------------------------------------------------------------- */

/* One round of when-clauses: all that fire read the same values. *changed is set if a value became another. */
static void fire(gust_events *events, gust_system *system, const gust_sampler *sampler, bool sampled, double t,
                 double *y, const double *yp, bool *changed)
{
    gust_assembly *assembly = &system->assembly;
    const size_t y_bytes = (size_t)system->model->n_unknowns * sizeof(double);
    const size_t discrete_bytes = (size_t)assembly->n_discrete * sizeof(double);
    memcpy(events->y_after, y, y_bytes);
    memcpy(events->discrete_after, assembly->discrete, discrete_bytes);
    for (int32_t k = 0; sampled && k < sampler->n_sampled; ++k) {
        const gust_sampled *clause = &sampler->sampled[k];
        if (clause->due) {
            gust_assembly_when(assembly, clause->block, clause->instance, clause->clause, t, y, yp,
                               events->y_after, events->discrete_after);
        }
    }
    for (int64_t k = 0; k < events->n_conditional; ++k) {
        const gust_conditional *clause = &events->conditional[k];
        if (clause->fires) {
            gust_assembly_when(assembly, clause->block, clause->instance, clause->clause, t, y, yp,
                               events->y_after, events->discrete_after);
        }
    }
    *changed = *changed || memcmp(y, events->y_after, y_bytes) != 0 ||
               memcmp(assembly->discrete, events->discrete_after, discrete_bytes) != 0;
    memcpy(y, events->y_after, y_bytes);
    memcpy(assembly->discrete, events->discrete_after, discrete_bytes);
}

/* Which conditions have become true since was_true was set; that is brought up to date. */
static bool look_again(gust_events *events, gust_system *system, double t, const double *y, const double *yp,
                       bool *any)
{
    *any = false;
    if (events->n_conditional == 0) {
        return true;
    }
    if (!gust_events_roots(events, system, t, y, yp, events->value)) {
        return false;
    }
    for (int64_t k = 0; k < events->n_conditional; ++k) {
        gust_conditional *clause = &events->conditional[k];
        const bool is_true = events->value[clause->watched] > 0.0;
        clause->fires = is_true && !clause->was_true;
        clause->was_true = is_true;
        *any = *any || clause->fires;
    }
    return true;
}

bool gust_events_settle(gust_events *events, gust_system *system, double t, const double *y, const double *yp)
{
    bool any = false;
    events->unsettled = false;
    if (!look_again(events, system, t, y, yp, &any)) {
        return false;
    }
    for (int64_t k = 0; k < events->n_conditional; ++k) {
        events->unsettled = events->unsettled || events->value[events->conditional[k].watched] == 0.0;
    }
    return true;
}

bool gust_events_missed(gust_events *events, gust_system *system, double t, const double *y, const double *yp,
                        bool *any)
{
    events->unsettled = false;
    if (!look_again(events, system, t, y, yp, any)) {
        return false;
    }
    for (int64_t k = 0; k < events->n_watched; ++k) {
        events->found[k] = 0;
    }
    for (int64_t k = 0; k < events->n_conditional; ++k) {
        const gust_conditional *clause = &events->conditional[k];
        events->unsettled = events->unsettled || events->value[clause->watched] == 0.0;
        if (clause->fires) {
            events->found[clause->watched] = 1;
        }
    }
    return true;
}

/* Conditions as they are before the event; those the integrator found are the ones that fire. */
static bool look_before(gust_events *events, gust_system *system, double t, bool found, const double *y,
                        const double *yp, bool *any)
{
    *any = false;
    if (events->n_conditional == 0) {
        return true;
    }
    if (!gust_events_roots(events, system, t, y, yp, events->value)) {
        return false;
    }
    for (int64_t k = 0; k < events->n_conditional; ++k) {
        gust_conditional *clause = &events->conditional[k];
        clause->fires = found && events->found[clause->watched] > 0;
        clause->was_true = clause->fires || events->value[clause->watched] > 0.0;
        *any = *any || clause->fires;
    }
    return true;
}

static gust_status series_failure(const gust_system *system, char *message, size_t size)
{
    gust_text(message, size, "%s", system->series.message);
    return system->series.failure;
}

static gust_status bad_period(const gust_sampled *bad, double t, char *message, size_t size)
{
    const gust_model_type *type = bad->block->type;
    gust_text(message, size,
              "at t = %.9g s the sample period %s.%s is not a positive number: it must be greater than 0", t,
              type->instance_name[bad->instance], type->parameter_name[bad->parameter]);
    return GUST_BAD_PERIOD;
}

static gust_status endless(const gust_events *events, double t, char *message, size_t size)
{
    gust_text(message, size, "at t = %.9g s when-clauses trigger each other without end:", t);
    for (int64_t k = 0; k < events->n_conditional; ++k) {
        const gust_conditional *clause = &events->conditional[k];
        if (clause->fires) {
            const gust_model_type *type = clause->block->type;
            gust_text_append(message, size, "\n  %s.%s", type->instance_name[clause->instance],
                             type->when_name[clause->clause]);
        }
    }
    gust_text_append(message, size, "\nGive their conditions a hysteresis, or raise event_iterations");
    return GUST_EVENT_ITERATION;
}

static gust_status chattering(const gust_events *events, double t, char *message, size_t size)
{
    gust_text(message, size,
              "at t = %.9g s %lld events have followed each other without the time advancing:", t,
              (long long)events->in_succession);
    for (int64_t k = 0; k < events->n_watched; ++k) {
        if (events->found[k] != 0) {
            char name[240];
            gust_events_name(&events->watched[k], name, sizeof name);
            gust_text_append(message, size, "\n  %s", name);
        }
    }
    gust_text_append(message, size, "\nGive it a hysteresis, or a smooth transition");
    return GUST_CHATTERING;
}

/* Events that follow each other at (nearly) one time are a sign that the model switches for ever. */
static bool chatters(gust_events *events, const gust_options *options, double t)
{
    const bool close = t - events->last_event < options->chatter_interval;
    events->last_event = t;
    events->in_succession = close ? events->in_succession + 1 : 0;
    return (double)events->in_succession >= options->chatter_events;
}

gust_status gust_events_handle(gust_events *events, gust_system *system, gust_sampler *sampler,
                               gust_controls *controls, gust_initial *initial, const gust_options *options,
                               double t, bool found, double *y, double *yp, bool *changed, char *message,
                               size_t size)
{
    ++events->n_events;
    if (found && chatters(events, options, t)) {
        return chattering(events, t, message, size);
    }
    bool conditions = false;
    bool samples = false;
    bool stepped = false;
    /* A zero crossing is worth a restart even if no value changes: right of a limiter's the equations are
     * smooth again, and the integrator does not like to go on from a function that stays at 0. */
    *changed = found;
    if (!look_before(events, system, t, found, y, yp, &conditions)) {
        return series_failure(system, message, size);
    }
    const gust_sampled *bad = NULL;
    gust_sampler_take(sampler, t, &samples);
    if (!gust_sampler_change(sampler, system, t, changed, &bad)) {
        return bad_period(bad, t, message, size);
    }
    if (!gust_series_update(&system->series, t, system->assembly.inputs, changed)) {
        return series_failure(system, message, size);
    }
    const gust_status controlled = gust_controls_step(controls, system, t, y, yp, &stepped, message, size);
    if (controlled != GUST_OK) {
        return controlled;
    }
    if (conditions || samples) {
        fire(events, system, sampler, samples, t, y, yp, changed);
    }
    if (stepped) {
        gust_controls_hold(controls, system, changed);
    }
    int rounds = 0;
    while (*changed) {
        const gust_status status = gust_initial_solve(initial, t, y, yp, false, message, size);
        if (status != GUST_OK) {
            return status;
        }
        if (!look_again(events, system, t, y, yp, &conditions)) {
            return series_failure(system, message, size);
        }
        if (!conditions) {
            break;
        }
        if (++rounds > (int)options->event_iterations) {
            return endless(events, t, message, size);
        }
        fire(events, system, sampler, false, t, y, yp, changed);
    }
    return GUST_OK;
}

void gust_events_archive(gust_events *events, gust_archive *archive)
{
    gust_archive_ints(archive, "events.found", events->found, events->n_watched);
    gust_archive_index(archive, "events.n_events", &events->n_events, 0, INT64_MAX / 2);
    gust_archive_doubles(archive, "events.last_event", &events->last_event, 1);
    gust_archive_index(archive, "events.in_succession", &events->in_succession, 0, INT64_MAX / 2);
}
