#include "loader_sampled.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "controller_library.h"
#include "gustform/gust_model.h"
#include "memory.h"

enum { KIND = 6, PER_MEASUREMENT = 3 };

bool gust_read_sampled_counts(gust_reader *load)
{
    const void *found = NULL;
    int64_t size = 0;
    if (!gust_read_sized(load, "sampled", GUST_I32, &found, &size)) {
        return false;
    }
    if (size == 0) {
        return true;
    }
    const int32_t *counts = found;
    /* Each has a section at least. */
    const int64_t most = load->container.n_sections;
    if (size != 3 || counts[0] < 0 || counts[1] < 0 || counts[2] < 0 || counts[0] > most || counts[1] > most) {
        return gust_refuse(load, GUST_BAD_TABLE,
                           "\"sampled\" does not hold three counts: build the model again");
    }
    load->model->n_libraries = counts[0];
    load->model->n_sampled = counts[1];
    load->model->n_sampled_changes = counts[2];
    return true;
}

static bool read_library(gust_reader *load, int32_t number)
{
    gust_model_library *library = &load->model->libraries[number];
    snprintf(load->prefix, sizeof load->prefix, "library.%d.", number);
    if (!gust_read_text(load, "path", &library->path)) {
        return false;
    }
    if (library->path[0] == '\0') {
        return gust_refuse(load, GUST_BAD_TABLE, "controller library %d has no path", number);
    }
    /* Without a slash dlopen would search the system folders. */
    const char *completed = gust_read_path(load->folder != NULL ? load->folder : ".", library->path);
    if (completed == NULL && library->path[0] != '/') {
        return gust_read_no_memory(load);
    }
    library->controller = gust_controller_open(completed != NULL ? completed : library->path, &library->library,
                                               load->message, load->message_size);
    char *unused = NULL;
    memcpy(&unused, &completed, sizeof unused);
    gust_release(unused);
    if (library->controller == NULL) {
        load->status = GUST_BAD_CONTROLLER;
        return false;
    }
    return true;
}

static bool read_measurements(gust_reader *load, gust_model_sampled *block)
{
    const gust_model *model = load->model;
    const gust_model_type *type = &model->types[block->type];
    const int32_t count = block->info.n_measurements;
    const int32_t *found = NULL;
    if (!gust_read_integers(load, "measurement", (int64_t)PER_MEASUREMENT * count, &found)) {
        return false;
    }
    block->measurement = gust_allocate((size_t)count, sizeof *block->measurement);
    if (block->measurement == NULL) {
        return gust_read_no_memory(load);
    }
    for (int32_t k = 0; k < count; ++k) {
        const int32_t *at = found + (int64_t)PER_MEASUREMENT * k;
        const int32_t end = at[0] == GUST_CHANNEL_UNKNOWN ? model->n_unknowns : type->kernel->n_outputs;
        if ((at[0] != GUST_CHANNEL_UNKNOWN && at[0] != GUST_CHANNEL_OUTPUT) || at[1] < 0 || at[1] >= end ||
            (at[2] != 1 && at[2] != -1)) {
            return gust_refuse(
                load, GUST_BAD_TABLE,
                "measurement \"%s\" of the sampled block \"%s\" does not exist (%d: %d, sign %d): "
                "build the model again",
                block->info.measurement_name[k], block->info.name, at[0], at[1], at[2]);
        }
        block->measurement[k] = (gust_measurement){at[0], at[1], at[2]};
    }
    return true;
}

static bool read_kind(gust_reader *load, gust_model_sampled *block)
{
    const gust_model *model = load->model;
    const int32_t *kind = NULL;
    const double *period = NULL;
    if (!gust_read_text(load, "name", &block->info.name) || !gust_read_integers(load, "kind", KIND, &kind) ||
        !gust_read_finite(load, "period", 1, &period)) {
        return false;
    }
    const bool placed =
        kind[0] >= 0 && kind[0] < model->n_types && kind[1] >= 0 && kind[1] < model->types[kind[0]].n_instances;
    if (!placed || kind[2] < -1 || kind[2] >= model->n_libraries || kind[3] < 0 || kind[3] > 1 ||
        (kind[4] != 4 && kind[4] != 8) || kind[5] < 0) {
        return gust_refuse(
            load, GUST_BAD_TABLE,
            "the sampled block \"%s\" is of an unknown kind (type %d, instance %d, library %d, delay "
            "%d, size %d, states at %d): build the model again",
            block->info.name, kind[0], kind[1], kind[2], kind[3], kind[4], kind[5]);
    }
    if (!(period[0] > 0.0)) {
        return gust_refuse(load, GUST_BAD_TABLE,
                           "the sample period of \"%s\" is %g s: it must be greater than 0", block->info.name,
                           period[0]);
    }
    block->type = kind[0];
    block->instance = kind[1];
    block->library = kind[2];
    block->info.delay = kind[3];
    block->info.real_size = kind[4];
    block->state_offset = (uint32_t)kind[5];
    block->info.period = period[0];
    return true;
}

static bool same_names(const gust_controller_signal *signals, const char *const *names, int32_t count)
{
    for (int32_t k = 0; k < count; ++k) {
        if (strcmp(signals[k].name, names[k]) != 0) {
            return false;
        }
    }
    return true;
}

/* What the block says of its controller must be what the controller says of itself. */
static bool check_controller(gust_reader *load, const gust_model_sampled *block, const char *const *monitors)
{
    if (block->library < 0) {
        return true;
    }
    const gust_controller *controller = load->model->libraries[block->library].controller;
    const gust_sampled_info *info = &block->info;
    const uint64_t states = (uint64_t)block->n_states * controller->real_size;
    const bool same = controller->n_inputs == (uint32_t)info->n_measurements &&
                      controller->n_outputs == (uint32_t)info->n_commands &&
                      controller->n_monitors == (uint32_t)block->n_monitors &&
                      (int64_t)controller->n_parameters == block->n_parameters &&
                      controller->real_size == (uint32_t)info->real_size &&
                      controller->period == info->period && block->state_offset % controller->real_size == 0 &&
                      block->state_offset + states <= controller->context_size &&
                      same_names(controller->inputs, info->measurement_name, info->n_measurements) &&
                      same_names(controller->outputs, info->command_name, info->n_commands) &&
                      same_names(controller->monitors, monitors, block->n_monitors);
    return same ||
           gust_refuse(load, GUST_BAD_CONTROLLER,
                       "the controller in \"%s\" is not the one that \"%s\" was made for: build the model "
                       "again",
                       load->model->libraries[block->library].path, info->name);
}

static bool read_block(gust_reader *load, int32_t number, int64_t first_start)
{
    gust_model *model = load->model;
    gust_model_sampled *block = &model->sampled[number];
    snprintf(load->prefix, sizeof load->prefix, "sampled.%d.", number);
    if (!read_kind(load, block)) {
        return false;
    }
    gust_sampled_info *info = &block->info;
    const gust_model_type *type = &model->types[block->type];
    const void *sized = NULL;
    int64_t measurements = 0;
    int64_t commands = 0;
    int64_t monitors = 0;
    int64_t states = 0;
    if (!gust_read_sized(load, "measurement", GUST_I32, &sized, &measurements) ||
        !gust_read_sized(load, "command", GUST_I32, &sized, &commands) ||
        !gust_read_sized(load, "monitor", GUST_I32, &sized, &monitors) ||
        !gust_read_sized(load, "parameters", GUST_F64, &sized, &block->n_parameters) ||
        !gust_read_sized(load, "states", GUST_F64, &sized, &states)) {
        return false;
    }
    if (measurements % PER_MEASUREMENT != 0 || measurements / PER_MEASUREMENT > INT32_MAX ||
        commands > INT32_MAX || monitors > INT32_MAX || states > INT32_MAX) {
        return gust_refuse(load, GUST_BAD_TABLE, "the sampled block \"%s\" has too many values", info->name);
    }
    info->n_measurements = (int32_t)(measurements / PER_MEASUREMENT);
    info->n_commands = (int32_t)commands;
    block->n_monitors = (int32_t)monitors;
    block->n_states = (int32_t)states;
    const char **measured = NULL;
    const char **measured_unit = NULL;
    const char **commanded = NULL;
    const char **commanded_unit = NULL;
    const char **monitored = NULL;
    if (!gust_read_texts(load, "measurement_names", info->n_measurements, &measured) ||
        !gust_read_texts(load, "measurement_units", info->n_measurements, &measured_unit) ||
        !gust_read_texts(load, "command_names", commands, &commanded) ||
        !gust_read_texts(load, "command_units", commands, &commanded_unit) ||
        !gust_read_texts(load, "monitor_names", monitors, &monitored)) {
        return false;
    }
    info->measurement_name = measured;
    info->measurement_unit = measured_unit;
    info->command_name = commanded;
    info->command_unit = commanded_unit;
    if (!read_measurements(load, block) ||
        !gust_read_indices(load, "command", commands, 0, type->kernel->n_discrete, &block->command) ||
        !gust_read_indices(load, "monitor", monitors, 0, type->kernel->n_discrete, &block->monitor) ||
        !gust_read_finite(load, "parameters", block->n_parameters, &block->parameters) ||
        !gust_read_finite(load, "states", states, &block->states) ||
        !check_controller(load, block, monitored)) {
        return false;
    }
    double *start = model->sampled_starts + first_start;
    for (int32_t k = 0; k < info->n_commands; ++k) {
        const double value =
            type->discrete[(int64_t)block->instance * type->kernel->n_discrete + block->command[k]];
        start[k] = info->real_size == 4 ? (double)(float)value : value;
    }
    info->command_start = start;
    return true;
}

static bool read_changes(gust_reader *load)
{
    gust_model *model = load->model;
    const int64_t n = model->n_sampled_changes;
    const double *time = NULL;
    const double *value = NULL;
    const int32_t *target = NULL;
    load->prefix[0] = '\0';
    if (!gust_read_finite(load, "sampled_change_time", n, &time) ||
        !gust_read_finite(load, "sampled_change_value", n, &value) ||
        !gust_read_integers(load, "sampled_change_target", 2 * n, &target)) {
        return false;
    }
    model->sampled_changes = gust_allocate((size_t)n, sizeof *model->sampled_changes);
    if (model->sampled_changes == NULL) {
        return gust_read_no_memory(load);
    }
    for (int64_t i = 0; i < n; ++i) {
        const int32_t *to = target + 2 * i;
        if (to[0] < 0 || to[0] >= model->n_sampled || to[1] < 0 ||
            to[1] >= model->sampled[to[0]].n_parameters || (i > 0 && time[i] < time[i - 1])) {
            return gust_refuse(
                load, GUST_BAD_TABLE,
                "change %lld of a sampled block (at %g s) has no such target (block %d, parameter %d) "
                "or is out of order",
                (long long)i, time[i], to[0], to[1]);
        }
        model->sampled_changes[i] = (gust_sampled_change){time[i], to[0], to[1], value[i]};
    }
    return true;
}

/* Commands of all blocks together, bounded by what the file holds. */
static bool count_commands(gust_reader *load, int64_t *total)
{
    *total = 0;
    for (int32_t k = 0; k < load->model->n_sampled; ++k) {
        const void *found = NULL;
        int64_t count = 0;
        snprintf(load->prefix, sizeof load->prefix, "sampled.%d.", k);
        if (!gust_read_sized(load, "command", GUST_I32, &found, &count)) {
            return false;
        }
        *total += count;
    }
    return true;
}

bool gust_read_sampled(gust_reader *load)
{
    gust_model *model = load->model;
    int64_t commands = 0;
    if (!count_commands(load, &commands)) {
        return false;
    }
    model->libraries = gust_allocate((size_t)model->n_libraries, sizeof *model->libraries);
    model->sampled = gust_allocate((size_t)model->n_sampled, sizeof *model->sampled);
    model->sampled_starts = gust_allocate((size_t)commands, sizeof *model->sampled_starts);
    if (model->libraries == NULL || model->sampled == NULL || model->sampled_starts == NULL) {
        return gust_read_no_memory(load);
    }
    for (int32_t k = 0; k < model->n_libraries; ++k) {
        if (!read_library(load, k)) {
            return false;
        }
    }
    int64_t first = 0;
    for (int32_t k = 0; k < model->n_sampled; ++k) {
        if (!read_block(load, k, first)) {
            return false;
        }
        first += model->sampled[k].info.n_commands;
    }
    return read_changes(load);
}
