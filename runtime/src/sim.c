/* The life of a simulation, as gust_sim.h promises it. */
#include <math.h>
#include <string.h>

#include "gustform/gust_sim.h"
#include "memory.h"
#include "simulation.h"
#include "text.h"
#include "vector.h"

/* -- create and destroy --------------------------------------------------------------------------------- */

gust_status gust_sim_create(const gust_model *model, gust_sim **sim)
{
    if (sim == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    *sim = NULL;
    if (model == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    gust_sim *made = gust_allocate(1, sizeof *made);
    if (made == NULL) {
        return GUST_OUT_OF_MEMORY;
    }
    made->model = model;
    gust_options_reset(&made->options);
    atomic_init(&made->time, 0.0);
    atomic_init(&made->stop, 0);
    gust_status status = gust_system_create(&made->system, model);
    if (status == GUST_OK) {
        status = gust_sampler_create(&made->sampler, &made->system);
    }
    if (status == GUST_OK) {
        status = gust_controls_create(&made->controls, model);
    }
    made->probe.next_time = INFINITY;
    if (status == GUST_OK) {
        status = gust_sink_create(&made->sink, &made->system, NULL);
    }
    if (status != GUST_OK) {
        gust_sim_destroy(&made);
        return status;
    }
    *sim = made;
    return GUST_OK;
}

static void free_solver(gust_sim *sim)
{
    gust_initial_free(&sim->initial);
    gust_solver_free(&sim->solver);
    gust_events_free(&sim->events);
}

void gust_sim_destroy(gust_sim **sim)
{
    if (sim == NULL || *sim == NULL) {
        return;
    }
    gust_sim *old = *sim;
    free_solver(old);
    gust_checkpoint_free(old);
    gust_sink_free(&old->sink);
    gust_sink_free(&old->probe);
    gust_sampler_free(&old->sampler);
    gust_controls_free(&old->controls);
    gust_system_free(&old->system);
    gust_release(old);
    *sim = NULL;
}

/* -- before initialise ---------------------------------------------------------------------------------- */

static gust_status only_before(gust_sim *sim, const char *what)
{
    if (sim->phase == GUST_PHASE_CREATED) {
        return GUST_OK;
    }
    gust_text(sim->message, sizeof sim->message, "%s is possible before initialise only", what);
    return GUST_BAD_ORDER;
}

gust_status gust_sim_set_option(gust_sim *sim, const char *name, double value)
{
    if (sim == NULL || name == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    const gust_status order = only_before(sim, "setting an option");
    if (order != GUST_OK) {
        return order;
    }
    const gust_option_info *info = NULL;
    double *option = gust_options_find(&sim->options, name, &info);
    if (option == NULL) {
        gust_text(sim->message, sizeof sim->message, "there is no option \"%s\"; there are:", name);
        for (int i = 0; gust_option_list(i) != NULL; ++i) {
            gust_text_append(sim->message, sizeof sim->message, " %s", gust_option_list(i)->name);
        }
        return GUST_UNKNOWN_OPTION;
    }
    if (!(value >= info->minimum && value <= info->maximum)) {
        gust_text(sim->message, sizeof sim->message, "option %s must be from %g to %g (%s); got %g", name,
                  info->minimum, info->maximum, info->sentence, value);
        return GUST_BAD_ARGUMENT;
    }
    *option = value;
    return GUST_OK;
}

gust_status gust_sim_option(const gust_sim *sim, const char *name, double *value)
{
    if (sim == NULL || name == NULL || value == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    gust_options copy = sim->options;
    const double *option = gust_options_find(&copy, name, NULL);
    if (option == NULL) {
        return GUST_UNKNOWN_OPTION;
    }
    *value = *option;
    return GUST_OK;
}

gust_status gust_sim_set_series_reader(gust_sim *sim, int32_t series, gust_series_reader reader, void *context)
{
    if (sim == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    const gust_status order = only_before(sim, "setting a reader");
    if (order != GUST_OK) {
        return order;
    }
    if (series < 0 || series >= sim->model->n_series) {
        gust_text(sim->message, sizeof sim->message, "there is no series %d: the model has %d, counted from 0",
                  series, sim->model->n_series);
        return GUST_BAD_ARGUMENT;
    }
    if (sim->model->series[series].source != GUST_SERIES_READER) {
        gust_text(sim->message, sizeof sim->message, "series \"%s\" brings its own data and takes no reader",
                  sim->model->series[series].name);
        return GUST_BAD_ARGUMENT;
    }
    sim->system.series.series[series].reader = reader;
    sim->system.series.series[series].context = context;
    return GUST_OK;
}

gust_status gust_sim_set_sink(gust_sim *sim, double interval, int32_t block_rows, gust_row_sink sink,
                              void *context)
{
    if (sim == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    const gust_status order = only_before(sim, "setting a sink");
    if (order != GUST_OK) {
        return order;
    }
    if (sink != NULL && (!(interval > 0.0 && isfinite(interval)) || block_rows < 1)) {
        gust_text(sim->message, sizeof sim->message,
                  "rows need an interval greater than 0 s and blocks at least one row; got %g s and %d",
                  interval, block_rows);
        return GUST_BAD_ARGUMENT;
    }
    sim->sink.receive = sink;
    sim->sink.context = context;
    sim->sink.interval = interval;
    sim->sink.block_rows = block_rows;
    return GUST_OK;
}

gust_status gust_sim_set_statistics(gust_sim *sim, gust_stats *stats, double start)
{
    if (sim == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    const gust_status order = only_before(sim, "setting statistics");
    if (order != GUST_OK) {
        return order;
    }
    if (stats != NULL && (gust_stats_n_columns(stats) != sim->model->n_channels || !isfinite(start))) {
        gust_text(sim->message, sizeof sim->message,
                  "the statistics are for rows of %d columns, and the simulation has %d channels (start %g s)",
                  gust_stats_n_columns(stats), sim->model->n_channels, start);
        return GUST_BAD_ARGUMENT;
    }
    gust_sink_free(&sim->probe);
    sim->probe.next_time = INFINITY;
    if (stats == NULL) {
        return GUST_OK;
    }
    const gust_status status = gust_sink_create(&sim->probe, &sim->system, stats);
    sim->probe.start = start;
    return status;
}

static gust_status block_exists(gust_sim *sim, int32_t block)
{
    if (block >= 0 && block < sim->controls.n_controls) {
        return GUST_OK;
    }
    gust_text(sim->message, sizeof sim->message,
              "there is no sampled block %d: the model has %d, counted from 0", block,
              sim->controls.n_controls);
    return GUST_BAD_ARGUMENT;
}

gust_status gust_sim_set_sampled(gust_sim *sim, int32_t block, gust_sampled_step step, void *context)
{
    if (sim == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    gust_status status = only_before(sim, "setting the controller of a sampled block");
    if (status == GUST_OK) {
        status = block_exists(sim, block);
    }
    if (status == GUST_OK) {
        sim->controls.control[block].step = step;
        sim->controls.control[block].host = context;
    }
    return status;
}

gust_status gust_sim_sampled_statistics(gust_sim *sim, int32_t block, gust_sampled_statistics *statistics)
{
    if (sim == NULL || statistics == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    const gust_status status = block_exists(sim, block);
    if (status == GUST_OK) {
        *statistics = sim->controls.control[block].statistics;
    }
    return status;
}

/* -- run ------------------------------------------------------------------------------------------------ */

/* Below this a tolerance is about round-off. */
static const double FINEST = 1e-11;

static void set_tolerances(gust_sim *sim)
{
    const double rtol = sim->options.rtol;
    const double share = gust_controls_share(&sim->controls);
    sim->solving = sim->options;
    if (share < 1.0 && rtol > FINEST) {
        sim->solving.rtol = fmax(share * rtol, FINEST);
        sim->solving.atol *= sim->solving.rtol / rtol;
    }
}

static gust_status prepare(gust_sim *sim, double t0)
{
    char *message = sim->message;
    const size_t size = sizeof sim->message;
    const gust_model *model = sim->model;
    set_tolerances(sim);
    gust_status status = gust_events_create(&sim->events, &sim->system, sim->options.kinks > 0.0);
    if (status == GUST_OK) {
        status = gust_solver_create(&sim->solver, &sim->system, &sim->events, &sim->solving, message, size);
    }
    if (status == GUST_OK) {
        status = gust_initial_create(&sim->initial, &sim->system, &sim->solving, sim->solver.symbolic,
                                     &sim->solver.common);
    }
    if (status == GUST_OK) {
        status = gust_sink_open(&sim->sink, t0);
    }
    if (status == GUST_OK && sim->probe.stats != NULL) {
        status = gust_sink_open(&sim->probe, fmax(sim->probe.start, t0));
    }
    if (status == GUST_OK) {
        status = gust_checkpoint_create(sim);
    }
    if (status == GUST_OUT_OF_MEMORY) {
        gust_text(message, size, "out of memory for the simulation");
    }
    if (status != GUST_OK) {
        return status;
    }
    status = gust_series_open(&sim->system.series, (int64_t)sim->options.series_block, t0,
                              sim->system.assembly.inputs);
    if (status != GUST_OK) {
        gust_text(message, size, "%s", sim->system.series.message);
        return status;
    }
    const gust_sampled *bad = NULL;
    if (!gust_sampler_start(&sim->sampler, &sim->system, t0, &bad)) {
        const gust_model_type *type = bad->block->type;
        gust_text(message, size, "the sample period %s.%s is not a positive number: it must be greater than 0",
                  type->instance_name[bad->instance], type->parameter_name[bad->parameter]);
        return GUST_BAD_PERIOD;
    }
    status = gust_controls_start(&sim->controls, &sim->system, t0, message, size);
    if (status != GUST_OK) {
        return status;
    }
    sim->next_event = gust_next_event(sim);
    const size_t bytes = (size_t)model->n_unknowns * sizeof(double);
    double *y = gust_vector_data(sim->solver.y);
    double *yp = gust_vector_data(sim->solver.yp);
    memcpy(y, model->start, bytes);
    memcpy(yp, model->start_derivative, bytes);
    status = gust_initial_solve(&sim->initial, t0, y, yp, true, message, size);
    if (status != GUST_OK) {
        return status;
    }
    if (!gust_events_settle(&sim->events, &sim->system, t0, y, yp)) {
        gust_text(message, size, "%s", sim->system.series.message);
        return sim->system.series.failure;
    }
    /* 1 ms bounds the very first step; the integrator doubles it as long as the error allows. */
    double step = gust_initial_step(&sim->initial, t0, y, yp, 1e-3);
    step = sim->options.first_step > 0.0 ? sim->options.first_step : step;
    step = sim->events.unsettled ? fmin(step, 1e-12 * fmax(1.0, fabs(t0))) : step;
    return gust_solver_start(&sim->solver, t0, step, message, size);
}

gust_status gust_sim_initialise(gust_sim *sim, double t0)
{
    if (sim == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    gust_status status = only_before(sim, "initialise");
    if (status != GUST_OK) {
        return status;
    }
    if (!isfinite(t0)) {
        gust_text(sim->message, sizeof sim->message, "the start time must be a number; got %g", t0);
        return GUST_BAD_ARGUMENT;
    }
    status = prepare(sim, t0);
    sim->reached = t0;
    atomic_store(&sim->time, t0);
    sim->phase = status == GUST_OK ? GUST_PHASE_READY : GUST_PHASE_ENDED;
    sim->ended_with = status;
    return status;
}

gust_status gust_sim_advance(gust_sim *sim, double until, double *reached)
{
    if (sim == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    if (reached != NULL) {
        *reached = sim->reached;
    }
    if (sim->phase == GUST_PHASE_CREATED) {
        gust_text(sim->message, sizeof sim->message, "initialise the simulation before advancing it");
        return GUST_BAD_ORDER;
    }
    if (sim->phase == GUST_PHASE_ENDED) {
        return sim->ended_with;
    }
    if (!isfinite(until) || until < sim->reached) {
        gust_text(sim->message, sizeof sim->message, "cannot advance to %g s: the simulation has reached %g s",
                  until, sim->reached);
        return GUST_BAD_ARGUMENT;
    }
    gust_status status = gust_integrate(sim, until);
    /* What has been computed must reach the receiver whatever happened; the first reason to stop counts. */
    const gust_status flushed = gust_sink_flush(&sim->sink);
    if (flushed != GUST_OK && status >= 0 && status != GUST_SINK_STOPPED) {
        status = flushed;
        gust_text(sim->message, sizeof sim->message, "at t = %.9g s: %s", sim->reached,
                  gust_status_text(flushed));
    }
    if (status == GUST_STOP_REQUESTED) {
        atomic_store(&sim->stop, 0);
    } else if (status != GUST_OK && status != GUST_SINK_STOPPED) {
        sim->phase = GUST_PHASE_ENDED;
        sim->ended_with = status;
    }
    if (reached != NULL) {
        *reached = sim->reached;
    }
    return status;
}

void gust_sim_request_stop(gust_sim *sim)
{
    if (sim != NULL) {
        atomic_store(&sim->stop, 1);
    }
}

/* -- look ----------------------------------------------------------------------------------------------- */

double gust_sim_time(const gust_sim *sim)
{
    return sim != NULL ? atomic_load_explicit(&sim->time, memory_order_relaxed) : 0.0;
}

const char *gust_sim_message(const gust_sim *sim)
{
    return sim != NULL ? sim->message : "";
}

gust_status gust_sim_statistics(const gust_sim *sim, gust_statistics *statistics)
{
    if (sim == NULL || statistics == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    *statistics = (gust_statistics){.residual_evaluations = sim->system.residual_evaluations,
                                    .jacobian_evaluations = sim->system.jacobian_evaluations,
                                    .root_evaluations = sim->system.root_evaluations,
                                    .events = sim->events.n_events,
                                    .initial_iterations = sim->initial.iterations,
                                    .rows = sim->sink.next_row,
                                    .cut_steps = sim->cut_steps};
    gust_solver_statistics(&sim->solver, statistics);
    statistics->factorisations += sim->initial.factors.factorisations;
    statistics->refactorisations += sim->initial.factors.refactorisations;
    return GUST_OK;
}

static gust_status only_after(gust_sim *sim, const char *what)
{
    if (sim->solver.ida != NULL && sim->phase != GUST_PHASE_CREATED) {
        return GUST_OK;
    }
    gust_text(sim->message, sizeof sim->message, "%s is possible after initialise only", what);
    return GUST_BAD_ORDER;
}

/* y and yp at the time reached. */
static gust_status values_reached(gust_sim *sim, const double **y, const double **yp)
{
    gust_solver *solver = &sim->solver;
    const bool at_step = sim->reached == solver->t;
    if (!at_step && !gust_solver_dense(solver, sim->reached, true)) {
        gust_text(sim->message, sizeof sim->message, "no values at t = %.9g s", sim->reached);
        return GUST_SOLVER_FAILED;
    }
    *y = gust_vector_data(at_step ? solver->y : solver->dense_y);
    *yp = gust_vector_data(at_step ? solver->yp : solver->dense_yp);
    return GUST_OK;
}

gust_status gust_sim_state(gust_sim *sim, double *time, double *y, double *yp)
{
    if (sim == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    gust_status status = only_after(sim, "reading the state");
    const double *y_reached = NULL;
    const double *yp_reached = NULL;
    if (status == GUST_OK) {
        status = values_reached(sim, &y_reached, &yp_reached);
    }
    if (status != GUST_OK) {
        return status;
    }
    const size_t bytes = (size_t)sim->model->n_unknowns * sizeof(double);
    if (time != NULL) {
        *time = sim->reached;
    }
    if (y != NULL) {
        memcpy(y, y_reached, bytes);
    }
    if (yp != NULL) {
        memcpy(yp, yp_reached, bytes);
    }
    return GUST_OK;
}

gust_status gust_sim_channels(gust_sim *sim, double *row)
{
    if (sim == NULL || row == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    gust_status status = only_after(sim, "reading channels");
    const double *y = NULL;
    const double *yp = NULL;
    if (status == GUST_OK) {
        status = values_reached(sim, &y, &yp);
    }
    if (status == GUST_OK && !gust_sink_evaluate(&sim->sink, &sim->system, sim->reached, y, yp, row)) {
        gust_text(sim->message, sizeof sim->message, "%s", sim->system.series.message);
        status = sim->system.series.failure;
    }
    return status;
}

gust_status gust_sim_residual(gust_sim *sim, double t, const double *y, const double *yp, double *residual)
{
    if (sim == NULL || y == NULL || yp == NULL || residual == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    if (!gust_system_residual(&sim->system, t, y, yp, residual)) {
        gust_text(sim->message, sizeof sim->message, "%s", sim->system.series.message);
        return sim->system.series.failure;
    }
    return GUST_OK;
}

gust_status gust_sim_jacobian(gust_sim *sim, double t, const double *y, const double *yp, double cj,
                              double *values)
{
    if (sim == NULL || y == NULL || yp == NULL || values == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    if (!gust_system_jacobian(&sim->system, t, y, yp, cj, values)) {
        gust_text(sim->message, sizeof sim->message, "%s", sim->system.series.message);
        return sim->system.series.failure;
    }
    return GUST_OK;
}
