/* The loop that advances a simulation: steps, events, result rows. */
#include <float.h>
#include <math.h>

#include "moment.h"
#include "simulation.h"
#include "text.h"
#include "vector.h"

/* Rows that are due up to `t`, all within the last step or at its end. */
static gust_status write_rows(gust_sim *sim, gust_sink *sink, double t)
{
    gust_solver *solver = &sim->solver;
    const double little = gust_moment_end(t) - t;
    while (sink->next_time <= t + little) {
        const bool at_end = fabs(sink->next_time - solver->t) <= little;
        N_Vector y = at_end ? solver->y : solver->dense_y;
        N_Vector yp = at_end ? solver->yp : solver->dense_yp;
        if (!at_end && !gust_solver_dense(solver, sink->next_time, sink->derivatives)) {
            gust_text(sim->message, sizeof sim->message, "no values for the result row at t = %.9g s",
                      sink->next_time);
            return GUST_SOLVER_FAILED;
        }
        const gust_status status = gust_sink_add(sink, &sim->system, gust_vector_data(y), gust_vector_data(yp));
        if (status != GUST_OK) {
            gust_text(sim->message, sizeof sim->message, "at t = %.9g s: %s", t,
                      status < 0 && sim->system.series.failure == status ? sim->system.series.message
                                                                         : gust_status_text(status));
            return status;
        }
    }
    return GUST_OK;
}

double gust_next_event(const gust_sim *sim)
{
    const double sample = fmin(gust_sampler_next(&sim->sampler), gust_controls_next(&sim->controls));
    return fmin(sample, gust_series_next(&sim->system.series));
}

/* What the first step after an event is at most, s; the integrator doubles it as long as the error allows. */
static const double LONGEST_FIRST_STEP = 1.0;

double gust_first_step(gust_sim *sim, double t)
{
    const double next = fmin(sim->next_event, sim->system.series.end);
    const double longest = next > t ? fmin(next - t, LONGEST_FIRST_STEP) : 1e-3;
    const double estimate = gust_initial_step(&sim->initial, t, gust_vector_data(sim->solver.y),
                                              gust_vector_data(sim->solver.yp), longest);
    const double step = sim->options.first_step > 0.0 ? fmin(sim->options.first_step, longest) : estimate;
    /* Below this the integrator could not tell t + h from t. */
    const double seen = fmax(step, 1e3 * DBL_EPSILON * fmax(fabs(t), 1e-3));
    /* Where a condition is exactly 0 a very small step shows which way it goes. */
    return sim->events.unsettled ? fmin(seen, 1e-12 * fmax(1.0, fabs(t))) : seen;
}

static gust_status series_failure(gust_sim *sim)
{
    gust_text(sim->message, sizeof sim->message, "%s", sim->system.series.message);
    return sim->system.series.failure;
}

gust_status gust_begin_anew(gust_sim *sim)
{
    gust_solver *solver = &sim->solver;
    double *y = gust_vector_data(solver->y);
    double *yp = gust_vector_data(solver->yp);
    const gust_status status =
        gust_initial_solve(&sim->initial, solver->t, y, yp, false, sim->message, sizeof sim->message);
    if (status != GUST_OK) {
        const bool found =
            status != GUST_NOT_CONSISTENT && status != GUST_SINGULAR && status != GUST_NOT_FINITE;
        return found ? status : GUST_RESTART_FAILED;
    }
    if (!gust_events_settle(&sim->events, &sim->system, solver->t, y, yp)) {
        return series_failure(sim);
    }
    return gust_solver_restart(solver, solver->t, gust_first_step(sim, solver->t), sim->message,
                               sizeof sim->message);
}

static gust_status handle_event(gust_sim *sim)
{
    gust_solver *solver = &sim->solver;
    bool changed = false;
    const gust_status status =
        gust_events_handle(&sim->events, &sim->system, &sim->sampler, &sim->controls, &sim->initial,
                           &sim->options, solver->t, sim->root_found, gust_vector_data(solver->y),
                           gust_vector_data(solver->yp), &changed, sim->message, sizeof sim->message);
    sim->pending = false;
    sim->root_found = false;
    sim->next_event = gust_next_event(sim);
    if (status == GUST_NOT_CONSISTENT || status == GUST_SINGULAR || status == GUST_NOT_FINITE) {
        return GUST_RESTART_FAILED;
    }
    if (status != GUST_OK || !changed) {
        return status;
    }
    if (!gust_events_settle(&sim->events, &sim->system, solver->t, gust_vector_data(solver->y),
                            gust_vector_data(solver->yp))) {
        return series_failure(sim);
    }
    return gust_solver_restart(solver, solver->t, gust_first_step(sim, solver->t), sim->message,
                               sizeof sim->message);
}

static gust_status end_of_data(gust_sim *sim)
{
    const gust_series_set *set = &sim->system.series;
    gust_text(sim->message, sizeof sim->message,
              "series \"%s\" ends at %.9g s: the simulation stops there; extend it, or give it on_end: hold "
              "or repeat",
              set->series[set->ending].what->name, set->end);
    return GUST_END_OF_DATA;
}

/* A step cut to less than this part of the last one begins anew. */
static const double CUT = 0.1;

/* Time the next step may not pass: what happens at a known time, or a series that turns within it.
 *
 * After a calm that was stepped through in one go, the first sample of a gust is a kink which the integrator
 * would not see: its error estimate for a step far shorter than the last takes the curvature of the calm for
 * granted (measured: 1e-3 of a gust's effect lost at rtol 1e-6). So it begins anew there. */
static gust_status next_stop(gust_sim *sim, double *stop)
{
    gust_series_set *series = &sim->system.series;
    gust_solver *solver = &sim->solver;
    *stop = fmin(sim->next_event, series->end);
    if (sim->options.series_tolerance <= 0.0 || series->n_series == 0) {
        return GUST_OK;
    }
    double limit = INFINITY;
    if (!gust_series_limit(series, solver->t, gust_solver_next_step(solver), sim->options.series_tolerance,
                           &limit)) {
        return series_failure(sim);
    }
    if (limit >= *stop) {
        return GUST_OK;
    }
    ++sim->cut_steps;
    *stop = limit;
    return limit - solver->t < CUT * gust_solver_last_step(solver) ? gust_begin_anew(sim) : GUST_OK;
}

static void reach(gust_sim *sim, double t)
{
    sim->reached = t;
    atomic_store_explicit(&sim->time, t, memory_order_relaxed);
}

gust_status gust_integrate(gust_sim *sim, double until)
{
    gust_solver *solver = &sim->solver;
    gust_series_set *series = &sim->system.series;
    for (;;) {
        /* Data may have ended within the last step, if nobody knew before where they end. */
        const double valid = fmin(solver->t, series->end);
        const double now = fmin(valid, until);
        gust_status status = write_rows(sim, &sim->sink, now);
        if (status == GUST_OK) {
            status = write_rows(sim, &sim->probe, now);
        }
        reach(sim, now);
        if (status != GUST_OK) {
            return status;
        }
        if (now >= until) {
            return GUST_OK;
        }
        if (now >= series->end) {
            return end_of_data(sim);
        }
        if (atomic_load_explicit(&sim->stop, memory_order_relaxed) != 0) {
            gust_text(sim->message, sizeof sim->message, "stopped at t = %.9g s on request", now);
            return GUST_STOP_REQUESTED;
        }
        if (sim->pending || sim->next_event <= gust_moment_end(solver->t)) {
            status = handle_event(sim);
            if (status != GUST_OK) {
                return status;
            }
            if (sim->next_event <= gust_moment_end(solver->t)) {
                continue;
            }
        }
        double stop = INFINITY;
        status = next_stop(sim, &stop);
        if (status != GUST_OK) {
            return status;
        }
        switch (gust_solver_step(solver, stop, &status, sim->message, sizeof sim->message)) {
        case GUST_STEP_TAKEN:
        case GUST_STEP_AT_STOP: /* what is due there is seen at the top of the loop */
            break;
        case GUST_STEP_AT_ROOT:
            sim->pending = true;
            sim->root_found = true;
            break;
        case GUST_STEP_FAILED:
            return status;
        }
        if (sim->events.unsettled && !sim->root_found) {
            bool missed = false;
            if (!gust_events_missed(&sim->events, &sim->system, solver->t, gust_vector_data(solver->y),
                                    gust_vector_data(solver->yp), &missed)) {
                return series_failure(sim);
            }
            sim->pending = sim->pending || missed;
            sim->root_found = missed;
        }
    }
}
