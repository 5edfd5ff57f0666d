#include "controls.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "moment.h"
#include "text.h"

/* -- life ----------------------------------------------------------------------------------------------- */

static bool create_control(gust_control *control, const gust_model *model, const gust_model_sampled *what)
{
    const size_t commands = (size_t)what->info.n_commands;
    *control = (gust_control){.what = what, .statistics = {.first_error = NAN}};
    if (what->library >= 0) {
        control->controller = model->libraries[what->library].controller;
        control->n_context = ((int64_t)control->controller->context_size + 7) / 8;
    }
    control->context = gust_allocate((size_t)control->n_context, sizeof *control->context);
    control->measurement = gust_allocate((size_t)what->info.n_measurements, sizeof(double));
    control->command = gust_allocate(commands, sizeof(double));
    control->waiting = gust_allocate(commands, sizeof(double));
    return control->context != NULL && control->measurement != NULL && control->command != NULL &&
           control->waiting != NULL;
}

gust_status gust_controls_create(gust_controls *controls, const gust_model *model)
{
    *controls = (gust_controls){.model = model};
    controls->control = gust_allocate((size_t)model->n_sampled, sizeof *controls->control);
    if (controls->control == NULL) {
        return GUST_OUT_OF_MEMORY;
    }
    for (int32_t k = 0; k < model->n_sampled; ++k) {
        ++controls->n_controls;
        if (!create_control(&controls->control[k], model, &model->sampled[k])) {
            return GUST_OUT_OF_MEMORY;
        }
    }
    return GUST_OK;
}

void gust_controls_free(gust_controls *controls)
{
    for (int32_t k = 0; k < controls->n_controls; ++k) {
        gust_release(controls->control[k].context);
        gust_release(controls->control[k].measurement);
        gust_release(controls->control[k].command);
        gust_release(controls->control[k].waiting);
    }
    gust_release(controls->control);
    *controls = (gust_controls){0};
}

/* -- one block ------------------------------------------------------------------------------------------ */

static double rounded(const gust_model_sampled *what, double value)
{
    return what->info.real_size == (int32_t)sizeof(float) ? (double)(float)value : value;
}

static double *held(const gust_control *control, const gust_system *system)
{
    const gust_block *block = &system->assembly.blocks[control->what->type];
    return block->discrete + (int64_t)control->what->instance * block->type->kernel->n_discrete;
}

/* The states stand one after the other in the context; the table of a controller does not name them. */
static void set_states(const gust_control *control)
{
    const gust_controller *controller = control->controller;
    const gust_model_sampled *what = control->what;
    for (int32_t k = 0; k < what->n_states; ++k) {
        const gust_controller_signal state = {.offset =
                                                  what->state_offset + (uint32_t)k * controller->real_size};
        gust_controller_set(controller, control->context, &state, what->states[k]);
    }
}

static void note_errors(gust_control *control, uint32_t errors, double t)
{
    gust_sampled_statistics *statistics = &control->statistics;
    if (errors == 0) {
        return;
    }
    statistics->first_error = statistics->bad_samples == 0 ? t : statistics->first_error;
    ++statistics->bad_samples;
    for (uint32_t bit = 0; bit < GUST_SAMPLED_ERRORS; ++bit) {
        statistics->errors[bit] += (errors >> bit) & 1U;
    }
}

static gust_status start_control(gust_control *control, double t0, char *message, size_t size)
{
    const gust_model_sampled *what = control->what;
    const gust_controller *controller = control->controller;
    control->start = t0;
    control->count = 0;
    control->next = t0;
    control->statistics = (gust_sampled_statistics){.first_error = NAN};
    for (int32_t k = 0; k < what->info.n_commands; ++k) {
        control->command[k] = what->info.command_start[k];
    }
    if (control->step != NULL) {
        return GUST_OK;
    }
    if (controller == NULL) {
        gust_text(message, size,
                  "the sampled block \"%s\" has no controller in the model: set one with gust_sim_set_sampled",
                  what->info.name);
        return GUST_BAD_ORDER;
    }
    controller->startup(control->context);
    for (int64_t k = 0; k < what->n_parameters; ++k) {
        gust_controller_set(controller, control->context, &controller->parameters[k], what->parameters[k]);
    }
    const uint32_t errors = controller->recalibrate(control->context);
    if (errors != 0) {
        gust_text(message, size,
                  "the controller of \"%s\" refuses its parameters (error signal %#x): look at their ranges",
                  what->info.name, errors);
        return GUST_CONTROLLER_FAILED;
    }
    set_states(control);
    for (int32_t k = 0; k < what->info.n_commands; ++k) {
        gust_controller_set(controller, control->context, &controller->outputs[k], control->command[k]);
    }
    return GUST_OK;
}

static gust_status step_host(gust_control *control, double t, char *message, size_t size)
{
    const gust_sampled_info *info = &control->what->info;
    const int answer = control->step(control->host, t, control->measurement, control->command);
    for (int32_t k = 0; answer == 0 && k < info->n_commands; ++k) {
        control->command[k] = rounded(control->what, control->command[k]);
        if (!isfinite(control->command[k])) {
            gust_text(message, size, "at t = %.9g s the host's controller of \"%s\" gave %s = %g", t,
                      info->name, info->command_name[k], control->command[k]);
            return GUST_CONTROLLER_FAILED;
        }
    }
    if (answer == 0) {
        return GUST_OK;
    }
    gust_text(message, size, "at t = %.9g s the host's controller of \"%s\" answered %d", t, info->name,
              answer);
    return answer > 0 ? GUST_CONTROLLER_STOPPED : GUST_CONTROLLER_FAILED;
}

static void step_library(gust_control *control, double t)
{
    const gust_controller *controller = control->controller;
    for (uint32_t k = 0; k < controller->n_inputs; ++k) {
        gust_controller_set(controller, control->context, &controller->inputs[k], control->measurement[k]);
    }
    note_errors(control, controller->step(control->context), t);
    for (uint32_t k = 0; k < controller->n_outputs; ++k) {
        control->command[k] = gust_controller_get(controller, control->context, &controller->outputs[k]);
    }
}

static void measure(gust_control *control, gust_system *system, double t, const double *y, const double *yp)
{
    const gust_model_sampled *what = control->what;
    gust_assembly *assembly = &system->assembly;
    gust_assembly_outputs(assembly, &assembly->blocks[what->type], what->instance, t, y, yp);
    for (int32_t k = 0; k < what->info.n_measurements; ++k) {
        const gust_measurement *from = &what->measurement[k];
        const double value = from->kind == GUST_CHANNEL_UNKNOWN ? y[from->a] : assembly->output[from->a];
        control->measurement[k] = rounded(what, from->sign * value);
    }
}

/* -- all of them ---------------------------------------------------------------------------------------- */

gust_status gust_controls_start(gust_controls *controls, gust_system *system, double t0, char *message,
                                size_t size)
{
    bool changed = false;
    controls->next_change = 0;
    for (int32_t k = 0; k < controls->n_controls; ++k) {
        gust_control *control = &controls->control[k];
        const gust_status status = start_control(control, t0, message, size);
        if (status != GUST_OK) {
            return status;
        }
        memcpy(control->waiting, control->command, (size_t)control->what->info.n_commands * sizeof(double));
        control->due = true;
        for (int32_t i = 0; control->step != NULL && i < control->what->n_monitors; ++i) {
            held(control, system)[control->what->monitor[i]] = NAN; /* a host gives commands only */
        }
    }
    gust_controls_hold(controls, system, &changed);
    return GUST_OK;
}

double gust_controls_next(const gust_controls *controls)
{
    double next = INFINITY;
    if (controls->next_change < controls->model->n_sampled_changes) {
        next = controls->model->sampled_changes[controls->next_change].time;
    }
    for (int32_t k = 0; k < controls->n_controls; ++k) {
        next = controls->control[k].next < next ? controls->control[k].next : next;
    }
    return next;
}

/* What a step is without samples, s, on the systems this is for. With the tolerances in proportion to the time
 * between two samples, the errors over some time stay what rtol is known for: measured on the load step at 1
 * kHz and rtol 1e-6, 0.008 mHz in the frequency instead of 0.24 mHz, for 1.4 times the time. */
static const double STEP_WITHOUT_SAMPLES = 0.1;

double gust_controls_share(const gust_controls *controls)
{
    double share = 1.0;
    for (int32_t k = 0; k < controls->n_controls; ++k) {
        share = fmin(share, controls->control[k].what->info.period / STEP_WITHOUT_SAMPLES);
    }
    return share;
}

/* Parameters that change now. Those of a controller of the host's are the host's affair. */
static void change(gust_controls *controls, double t)
{
    const gust_model *model = controls->model;
    const double now = gust_moment_end(t);
    while (controls->next_change < model->n_sampled_changes &&
           model->sampled_changes[controls->next_change].time <= now) {
        const gust_sampled_change *entry = &model->sampled_changes[controls->next_change++];
        gust_control *control = &controls->control[entry->block];
        if (control->step == NULL) {
            gust_controller_set(control->controller, control->context,
                                &control->controller->parameters[entry->parameter], entry->value);
            control->recalibrate = true;
        }
    }
    for (int32_t k = 0; k < controls->n_controls; ++k) {
        gust_control *control = &controls->control[k];
        if (control->recalibrate) {
            control->recalibrate = false;
            control->controller->recalibrate(control->context);
        }
    }
}

gust_status gust_controls_step(gust_controls *controls, gust_system *system, double t, const double *y,
                               const double *yp, bool *any, char *message, size_t size)
{
    const double now = gust_moment_end(t);
    if (controls->n_controls == 0 || gust_controls_next(controls) > now) {
        return GUST_OK;
    }
    if (!gust_system_inputs(system, t)) {
        gust_text(message, size, "%s", system->series.message);
        return system->series.failure;
    }
    change(controls, t);
    for (int32_t k = 0; k < controls->n_controls; ++k) {
        gust_control *control = &controls->control[k];
        control->due = control->next <= now;
        if (!control->due) {
            continue;
        }
        *any = true;
        if (control->what->info.delay > 0) {
            memcpy(control->waiting, control->command, (size_t)control->what->info.n_commands * sizeof(double));
        }
        measure(control, system, t, y, yp);
        if (control->step == NULL) {
            step_library(control, t);
        } else {
            const gust_status status = step_host(control, t, message, size);
            if (status != GUST_OK) {
                return status;
            }
        }
        ++control->statistics.samples;
        ++control->count;
        control->next = control->start + (double)control->count * control->what->info.period;
    }
    return GUST_OK;
}

void gust_controls_hold(gust_controls *controls, gust_system *system, bool *changed)
{
    for (int32_t k = 0; k < controls->n_controls; ++k) {
        gust_control *control = &controls->control[k];
        if (!control->due) {
            continue;
        }
        control->due = false;
        const gust_model_sampled *what = control->what;
        const double *acting = what->info.delay > 0 ? control->waiting : control->command;
        double *target = held(control, system);
        for (int32_t i = 0; i < what->info.n_commands; ++i) {
            double *value = &target[what->command[i]];
            *changed = *changed || *value != acting[i];
            *value = acting[i];
        }
        /* What the controller tells of itself has no delay, and no equation reads it: nothing changes by it.
         * Before the first sample it is what the table says. */
        for (int32_t i = 0; control->step == NULL && control->count > 0 && i < what->n_monitors; ++i) {
            target[what->monitor[i]] =
                gust_controller_get(control->controller, control->context, &control->controller->monitors[i]);
        }
    }
}

void gust_controls_archive(gust_controls *controls, gust_archive *archive)
{
    if (controls->n_controls == 0) {
        return;
    }
    gust_archive_small_index(archive, "sampled.next_change", &controls->next_change, 0,
                             controls->model->n_sampled_changes);
    for (int32_t k = 0; k < controls->n_controls; ++k) {
        gust_control *control = &controls->control[k];
        gust_sampled_statistics *statistics = &control->statistics;
        gust_archive_same(archive, "sampled.host", control->step != NULL ? 1.0 : 0.0);
        gust_archive_doubles(archive, "sampled.start", &control->start, 1);
        gust_archive_index(archive, "sampled.count", &control->count, 0, INT64_MAX / 2);
        gust_archive_doubles(archive, "sampled.next", &control->next, 1);
        gust_archive_longs(archive, "sampled.context", control->context, control->n_context);
        gust_archive_doubles(archive, "sampled.command", control->command, control->what->info.n_commands);
        gust_archive_longs(archive, "sampled.samples", &statistics->samples, 1);
        gust_archive_longs(archive, "sampled.bad_samples", &statistics->bad_samples, 1);
        gust_archive_longs(archive, "sampled.errors", statistics->errors, GUST_SAMPLED_ERRORS);
        gust_archive_doubles(archive, "sampled.first_error", &statistics->first_error, 1);
    }
}
