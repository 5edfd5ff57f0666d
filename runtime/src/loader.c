/* From the bytes of a container to a checked gust_model. A model file is never trusted: every count, index
 * and number is checked here once, so that nothing behind this file needs to. */
#define _POSIX_C_SOURCE 200809L

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "archive.h"
#include "container.h"
#include "gustform/gust_model.h"
#include "kernel_library.h"
#include "loader_sampled.h"
#include "memory.h"
#include "model.h"
#include "reader.h"
#include "text.h"

enum { N_COUNTS = 8, N_TEXT_TABLES_OF_TYPE = 8, N_TEXT_TABLES_OF_MODEL = 2, MAX_GRID_LINES = 1000000 };

/* -- the parts of a model ------------------------------------------------------------------------------- */

static bool read_counts(gust_reader *load)
{
    gust_model *model = load->model;
    const int32_t *counts = NULL;
    if (!gust_read_integers(load, "counts", N_COUNTS, &counts)) {
        return false;
    }
    /* Every counted thing takes at least one byte of the file, which bounds what is allocated for it. */
    for (int i = 0; i < N_COUNTS; ++i) {
        if (counts[i] < 0) {
            return gust_refuse(load, GUST_BAD_TABLE, "\"counts\"[%d] is negative (%d): build the model again",
                               i, counts[i]);
        }
    }
    model->n_unknowns = counts[0];
    model->n_nonzeros = counts[1];
    model->n_types = counts[2];
    model->n_inputs = counts[3];
    model->n_series = counts[4];
    model->n_tables = counts[5];
    model->n_schedule = counts[6];
    model->n_channels = counts[7];
    const int64_t directory = load->container.n_sections;
    if (model->n_types > directory || model->n_series > directory || model->n_tables > directory) {
        return gust_refuse(load, GUST_BAD_TABLE,
                           "more types, series or tables than sections: build the model again");
    }
    if (model->n_unknowns == 0) {
        return gust_refuse(load, GUST_BAD_TABLE, "the model has no unknowns: there is nothing to simulate");
    }
    return true;
}

static bool allocate_parts(gust_reader *load)
{
    gust_model *model = load->model;
    const size_t n_text_tables = (size_t)model->n_types * N_TEXT_TABLES_OF_TYPE +
                                 (size_t)model->n_sampled * GUST_TEXT_TABLES_OF_SAMPLED +
                                 N_TEXT_TABLES_OF_MODEL;
    model->types = gust_allocate((size_t)model->n_types, sizeof *model->types);
    model->series = gust_allocate((size_t)model->n_series, sizeof *model->series);
    model->tables = gust_allocate((size_t)model->n_tables, sizeof *model->tables);
    model->paths = gust_allocate((size_t)model->n_series, sizeof *model->paths);
    model->text_tables = gust_allocate(n_text_tables, sizeof *model->text_tables);
    return (model->types != NULL && model->series != NULL && model->tables != NULL && model->paths != NULL &&
            model->text_tables != NULL) ||
           gust_read_no_memory(load);
}

static bool read_pattern(gust_reader *load)
{
    gust_model *model = load->model;
    const int32_t n = model->n_unknowns;
    if (!gust_read_indices(load, "column_start", (int64_t)n + 1, 0,
                           model->n_nonzeros < INT32_MAX ? model->n_nonzeros + 1 : INT32_MAX,
                           &model->column_start) ||
        !gust_read_indices(load, "row_index", model->n_nonzeros, 0, n, &model->row_index)) {
        return false;
    }
    if (model->column_start[0] != 0 || model->column_start[n] != model->n_nonzeros) {
        return gust_refuse(load, GUST_BAD_TABLE,
                           "\"column_start\" does not run from 0 to the number of nonzeros");
    }
    for (int32_t column = 0; column < n; ++column) {
        if (model->column_start[column + 1] < model->column_start[column]) {
            return gust_refuse(load, GUST_BAD_TABLE, "\"column_start\" decreases at column %d", column);
        }
        for (int32_t k = model->column_start[column] + 1; k < model->column_start[column + 1]; ++k) {
            if (model->row_index[k] <= model->row_index[k - 1]) {
                return gust_refuse(load, GUST_BAD_TABLE, "the rows of column %d are not sorted", column);
            }
        }
    }
    return true;
}

static bool read_unknowns(gust_reader *load)
{
    gust_model *model = load->model;
    const int64_t n = model->n_unknowns;
    if (!gust_read_finite(load, "start", n, &model->start) ||
        !gust_read_finite(load, "start_derivative", n, &model->start_derivative) ||
        !gust_read_finite(load, "nominal", n, &model->nominal) ||
        !gust_read_bytes(load, "differential", n, &model->differential) ||
        !gust_read_finite(load, "input_value", model->n_inputs, &model->input_value)) {
        return false;
    }
    for (int64_t i = 0; i < n; ++i) {
        if (!(model->nominal[i] > 0.0)) {
            return gust_refuse(load, GUST_BAD_TABLE,
                               "the nominal value of unknown %lld is %g: it must be greater than 0",
                               (long long)i, model->nominal[i]);
        }
        if (model->differential[i] > 1) {
            return gust_refuse(load, GUST_BAD_TABLE, "\"differential\"[%lld] is %d, not 0 or 1", (long long)i,
                               model->differential[i]);
        }
    }
    return true;
}

static bool read_table(gust_reader *load, int32_t number)
{
    gust_table *table = &load->model->tables[number];
    snprintf(load->prefix, sizeof load->prefix, "table.%d.", number);
    const double *grid = NULL;
    const int32_t *size = NULL;
    if (!gust_read_finite(load, "grid", 4, &grid) ||
        !gust_read_indices(load, "size", 2, 2, MAX_GRID_LINES, &size)) {
        return false;
    }
    if (!(grid[1] > 0.0) || !(grid[3] > 0.0)) {
        return gust_refuse(load, GUST_BAD_TABLE,
                           "the grid of table %d has steps %g and %g: both must be greater than 0", number,
                           grid[1], grid[3]);
    }
    const double *coefficient = NULL;
    if (!gust_read_finite(load, "coefficient", ((int64_t)size[0] + 2) * ((int64_t)size[1] + 2), &coefficient)) {
        return false;
    }
    *table = (gust_table){.x_start = grid[0],
                          .x_step_inverse = 1.0 / grid[1],
                          .y_start = grid[2],
                          .y_step_inverse = 1.0 / grid[3],
                          .n_x = size[0],
                          .n_y = size[1],
                          .coefficient = coefficient};
    return true;
}

static bool check_samples(gust_reader *load, const gust_model_series *series)
{
    for (int64_t i = 0; i < series->n_samples; ++i) {
        if (!isfinite(series->value[i])) {
            return gust_refuse(load, GUST_BAD_SERIES, "series \"%s\": sample %lld is %g: it must be a number",
                               series->name, (long long)i, series->value[i]);
        }
        if (!series->uniform && !isfinite(series->time[i])) {
            return gust_refuse(load, GUST_BAD_SERIES, "series \"%s\": the time of sample %lld is %g",
                               series->name, (long long)i, series->time[i]);
        }
        if (!series->uniform && i > 0 && !(series->time[i] > series->time[i - 1])) {
            return gust_refuse(
                load, GUST_BAD_SERIES,
                "series \"%s\": the time of sample %lld (%g s) is not after that of the one before (%g s)",
                series->name, (long long)i, series->time[i], series->time[i - 1]);
        }
    }
    return true;
}

/* The samples of a series that is held in the model. */
static bool read_samples(gust_reader *load, gust_model_series *series)
{
    const void *value = NULL;
    if (!gust_read_sized(load, "value", GUST_F64, &value, &series->n_samples)) {
        return false;
    }
    series->value = value;
    if (series->n_samples < 1) {
        return gust_refuse(load, GUST_BAD_SERIES, "series \"%s\" is empty", series->name);
    }
    return (series->uniform || gust_read_doubles(load, "time", series->n_samples, &series->time)) &&
           check_samples(load, series);
}

static bool read_series(gust_reader *load, int32_t number)
{
    gust_model *model = load->model;
    gust_model_series *series = &model->series[number];
    snprintf(load->prefix, sizeof load->prefix, "series.%d.", number);
    const int32_t *kind = NULL;
    const double *timing = NULL;
    const void *slots = NULL;
    if (!gust_read_text(load, "name", &series->name) || !gust_read_text(load, "unit", &series->unit) ||
        !gust_read_indices(load, "kind", 4, 0, 3, &kind) || !gust_read_doubles(load, "timing", 3, &timing) ||
        !gust_read_sized(load, "slots", GUST_I32, &slots, &series->n_slots) ||
        !gust_read_indices(load, "slots", series->n_slots, 0, model->n_inputs, &series->slots)) {
        return false;
    }
    if (kind[0] > GUST_SERIES_PCHIP || kind[3] > 1) {
        return gust_refuse(load, GUST_BAD_TABLE, "series \"%s\" is of an unknown kind (%d, %d, %d, %d)",
                           series->name, kind[0], kind[1], kind[2], kind[3]);
    }
    series->interpolation = kind[0];
    series->source = kind[1];
    series->on_end = kind[2];
    series->uniform = kind[3];
    series->t0 = timing[0];
    series->dt = timing[1];
    series->t_end = timing[2];
    if (!isfinite(series->t0) || isnan(series->t_end) || !(series->t_end >= series->t0)) {
        return gust_refuse(load, GUST_BAD_SERIES,
                           "series \"%s\" runs from %g s to %g s: it must end after it begins", series->name,
                           series->t0, series->t_end);
    }
    if (series->uniform && !(series->dt > 0.0 && isfinite(series->dt))) {
        return gust_refuse(load, GUST_BAD_SERIES,
                           "series \"%s\" has a sample step of %g s: it must be greater than 0", series->name,
                           series->dt);
    }
    if (series->source == GUST_SERIES_INLINE && !read_samples(load, series)) {
        return false;
    }
    if (series->on_end == GUST_SERIES_END_REPEAT && !isfinite(series->t_end) && series->n_samples > 0) {
        series->t_end = series->uniform ? series->t0 + (double)(series->n_samples - 1) * series->dt
                                        : series->time[series->n_samples - 1];
    }
    if (series->on_end == GUST_SERIES_END_REPEAT && !(isfinite(series->t_end) && series->t_end > series->t0)) {
        return gust_refuse(load, GUST_BAD_SERIES,
                           "series \"%s\" is to be repeated but has no length (%g s to %g s)", series->name,
                           series->t0, series->t_end);
    }
    if (series->source == GUST_SERIES_FILE) {
        const char *path = NULL;
        if (!gust_read_text(load, "path", &path)) {
            return false;
        }
        if (path[0] == '\0') {
            return gust_refuse(load, GUST_BAD_TABLE, "series \"%s\" has no path", series->name);
        }
        series->path = path;
        const char *completed = gust_read_path(load->folder, path);
        if (completed != NULL) {
            memcpy(&model->paths[number], &completed, sizeof completed);
            series->path = completed;
        }
    }
    return true;
}

/* The local Jacobian of each instance must land where its rows and columns say. */
static bool check_positions(gust_reader *load, const gust_model_type *type)
{
    const gust_model *model = load->model;
    const gust_kernel *kernel = type->kernel;
    for (int32_t k = 0; k < kernel->n_nonzeros; ++k) {
        if (kernel->jacobian_row[k] < 0 || kernel->jacobian_row[k] >= kernel->n_unknowns + kernel->n_flows ||
            kernel->jacobian_column[k] < 0 ||
            kernel->jacobian_column[k] >= kernel->n_unknowns + kernel->n_external) {
            return gust_refuse(load, GUST_BAD_KERNEL,
                               "type \"%s\": entry %d of the kernel's Jacobian is outside it", type->name, k);
        }
    }
    for (int32_t i = 0; i < type->n_instances; ++i) {
        const int32_t *external = type->external + (int64_t)i * kernel->n_external;
        const int32_t *flow_row = type->flow_row + (int64_t)i * kernel->n_flows;
        const int32_t *position = type->jacobian_position + (int64_t)i * kernel->n_nonzeros;
        for (int32_t k = 0; k < kernel->n_nonzeros; ++k) {
            const int32_t local_row = kernel->jacobian_row[k];
            const int32_t local_column = kernel->jacobian_column[k];
            const int32_t row = local_row < kernel->n_unknowns ? type->first_unknown[i] + local_row
                                                               : flow_row[local_row - kernel->n_unknowns];
            const int32_t column = local_column < kernel->n_unknowns
                                       ? type->first_unknown[i] + local_column
                                       : external[local_column - kernel->n_unknowns];
            if (position[k] < model->column_start[column] || position[k] >= model->column_start[column + 1] ||
                model->row_index[position[k]] != row) {
                return gust_refuse(
                    load, GUST_BAD_TABLE,
                    "instance \"%s\": entry %d of its Jacobian belongs in row %d, column %d, but "
                    "\"jacobian_position\" says %d: build the model again",
                    type->instance_name[i], k, row, column, position[k]);
            }
        }
    }
    return true;
}

static bool check_parameters(gust_reader *load, const gust_model_type *type)
{
    for (int32_t i = 0; i < type->n_instances; ++i) {
        for (int32_t k = 0; k < type->kernel->n_parameters; ++k) {
            const double value = type->parameters[(int64_t)i * type->kernel->n_parameters + k];
            if (isnan(value)) {
                return gust_refuse(load, GUST_BAD_TABLE, "parameter %s.%s is not a number: give it a value",
                                   type->instance_name[i], type->parameter_name[k]);
            }
        }
    }
    return true;
}

static bool check_whens(gust_reader *load, const gust_model_type *type)
{
    for (int32_t k = 0; k < type->kernel->n_roots; ++k) {
        if (type->root_kind[k] > GUST_ROOT_WHEN) {
            return gust_refuse(load, GUST_BAD_TABLE, "type \"%s\": root %d is of unknown kind %d", type->name,
                               k, type->root_kind[k]);
        }
    }
    for (int32_t k = 0; k < type->kernel->n_whens; ++k) {
        if ((type->when_root[k] < 0) == (type->when_period[k] < 0)) {
            return gust_refuse(
                load, GUST_BAD_TABLE,
                "type \"%s\": when-clause %d must have either a condition or a period (has root %d, parameter "
                "%d)",
                type->name, k, type->when_root[k], type->when_period[k]);
        }
        if (type->when_root[k] >= 0 && type->root_kind[type->when_root[k]] != GUST_ROOT_WHEN) {
            return gust_refuse(load, GUST_BAD_TABLE,
                               "type \"%s\": when-clause %d waits for root %d, which is a kink", type->name, k,
                               type->when_root[k]);
        }
    }
    return true;
}

static bool read_kernel(gust_reader *load, gust_model_type *type)
{
    if (!gust_read_text(load, "kernel", &type->kernel_path)) {
        return false;
    }
    if (type->kernel_path[0] == '\0') {
        return gust_refuse(load, GUST_BAD_TABLE, "type \"%s\" names no kernel library", type->name);
    }
    /* Without a slash dlopen would search the system folders. */
    const char *folder = load->folder != NULL ? load->folder : ".";
    const char *completed = gust_read_path(folder, type->kernel_path);
    if (completed == NULL && type->kernel_path[0] != '/') {
        return gust_read_no_memory(load);
    }
    type->kernel = gust_kernel_open(completed != NULL ? completed : type->kernel_path, &type->library,
                                    load->message, load->message_size);
    if (completed != NULL) {
        char *unused = NULL;
        memcpy(&unused, &completed, sizeof unused);
        gust_release(unused);
    }
    if (type->kernel == NULL) {
        load->status = GUST_BAD_KERNEL;
        return false;
    }
    return true;
}

static bool read_type(gust_reader *load, int32_t number)
{
    gust_model *model = load->model;
    gust_model_type *type = &model->types[number];
    snprintf(load->prefix, sizeof load->prefix, "type.%d.", number);
    const int32_t *counts = NULL;
    if (!gust_read_text(load, "name", &type->name) || !gust_read_integers(load, "counts", 2, &counts)) {
        return false;
    }
    if (counts[0] < 0 || counts[0] > INT32_MAX - model->n_instances) {
        return gust_refuse(load, GUST_BAD_TABLE, "type \"%s\" has %d instances", type->name, counts[0]);
    }
    if (!read_kernel(load, type)) {
        return false;
    }
    const gust_kernel *kernel = type->kernel;
    const int64_t ni = counts[0];
    const int32_t n = model->n_unknowns;
    type->n_instances = counts[0];
    model->n_instances += counts[0];
    if (kernel->n_unknowns > n || kernel->n_inputs > model->n_inputs) {
        return gust_refuse(
            load, GUST_BAD_TABLE,
            "the kernel of type \"%s\" has %d unknowns and %d inputs, more than the whole model: "
            "build it again",
            type->name, kernel->n_unknowns, kernel->n_inputs);
    }
    return gust_read_texts(load, "instance_names", ni, &type->instance_name) &&
           gust_read_texts(load, "unknown_names", kernel->n_unknowns, &type->unknown_name) &&
           gust_read_texts(load, "equation_names", kernel->n_unknowns, &type->equation_name) &&
           gust_read_texts(load, "external_names", kernel->n_external, &type->external_name) &&
           gust_read_texts(load, "flow_names", kernel->n_flows, &type->flow_name) &&
           gust_read_texts(load, "root_names", kernel->n_roots, &type->root_name) &&
           gust_read_texts(load, "when_names", kernel->n_whens, &type->when_name) &&
           gust_read_texts(load, "parameter_names", kernel->n_parameters, &type->parameter_name) &&
           gust_read_indices(load, "first_unknown", ni, 0, n - kernel->n_unknowns + 1, &type->first_unknown) &&
           gust_read_indices(load, "external", ni * kernel->n_external, 0, n, &type->external) &&
           gust_read_indices(load, "flow_row", ni * kernel->n_flows, 0, n, &type->flow_row) &&
           gust_read_indices(load, "jacobian_position", ni * kernel->n_nonzeros, 0, model->n_nonzeros,
                             &type->jacobian_position) &&
           gust_read_indices(load, "first_input", ni, 0, model->n_inputs - kernel->n_inputs + 1,
                             &type->first_input) &&
           gust_read_indices(load, "table", ni * kernel->n_tables, 0, model->n_tables, &type->table) &&
           gust_read_doubles(load, "parameters", ni * kernel->n_parameters, &type->parameters) &&
           gust_read_finite(load, "discrete", ni * kernel->n_discrete, &type->discrete) &&
           gust_read_bytes(load, "root_kind", kernel->n_roots, &type->root_kind) &&
           gust_read_indices(load, "when_root", kernel->n_whens, -1, kernel->n_roots, &type->when_root) &&
           gust_read_indices(load, "when_period", kernel->n_whens, -1, kernel->n_parameters,
                             &type->when_period) &&
           check_positions(load, type) && check_parameters(load, type) && check_whens(load, type);
}

/* Which rows belong to no instance; no unknown may belong to two, no flow may end in an owned row. */
static bool find_unowned(gust_reader *load)
{
    gust_model *model = load->model;
    const int32_t n = model->n_unknowns;
    uint8_t *owned = gust_allocate((size_t)n, 1);
    model->unowned = gust_allocate((size_t)n, sizeof *model->unowned);
    if (owned == NULL || model->unowned == NULL) {
        gust_release(owned);
        return gust_read_no_memory(load);
    }
    bool good = true;
    for (int32_t t = 0; t < model->n_types && good; ++t) {
        const gust_model_type *type = &model->types[t];
        for (int32_t i = 0; i < type->n_instances && good; ++i) {
            for (int32_t k = 0; k < type->kernel->n_unknowns && good; ++k) {
                const int32_t unknown = type->first_unknown[i] + k;
                if (owned[unknown]) {
                    good = gust_refuse(load, GUST_BAD_TABLE,
                                       "unknown %d belongs to \"%s\" and to another instance", unknown,
                                       type->instance_name[i]);
                }
                owned[unknown] = 1;
            }
        }
    }
    for (int32_t t = 0; t < model->n_types && good; ++t) {
        const gust_model_type *type = &model->types[t];
        const int64_t n_rows = (int64_t)type->n_instances * type->kernel->n_flows;
        for (int64_t k = 0; k < n_rows && good; ++k) {
            if (owned[type->flow_row[k]]) {
                good = gust_refuse(load, GUST_BAD_TABLE,
                                   "a flow of \"%s\" is added to row %d, which belongs to an instance",
                                   type->instance_name[k / type->kernel->n_flows], type->flow_row[k]);
            }
        }
    }
    for (int32_t row = 0; row < n; ++row) {
        if (!owned[row]) {
            model->unowned[model->n_unowned++] = row;
        }
    }
    gust_release(owned);
    return good;
}

static bool read_schedule(gust_reader *load)
{
    gust_model *model = load->model;
    const int64_t n = model->n_schedule;
    const double *time = NULL;
    const double *value = NULL;
    const int32_t *target = NULL;
    load->prefix[0] = '\0';
    if (!gust_read_finite(load, "schedule_time", n, &time) ||
        !gust_read_doubles(load, "schedule_value", n, &value) ||
        !gust_read_integers(load, "schedule_target", 3 * n, &target)) {
        return false;
    }
    model->schedule = gust_allocate((size_t)n, sizeof *model->schedule);
    if (model->schedule == NULL) {
        return gust_read_no_memory(load);
    }
    for (int64_t i = 0; i < n; ++i) {
        const int32_t *to = target + 3 * i;
        if (to[0] < 0 || to[0] >= model->n_types || to[1] < 0 || to[1] >= model->types[to[0]].n_instances ||
            to[2] < 0 || to[2] >= model->types[to[0]].kernel->n_parameters) {
            return gust_refuse(load, GUST_BAD_TABLE,
                               "scheduled change %lld has no such target: type %d, instance %d, parameter %d",
                               (long long)i, to[0], to[1], to[2]);
        }
        if (isnan(value[i]) || (i > 0 && time[i] < time[i - 1])) {
            return gust_refuse(load, GUST_BAD_TABLE,
                               "scheduled change %lld (at %g s, to %g) is not a number or out of order",
                               (long long)i, time[i], value[i]);
        }
        model->schedule[i] = (gust_schedule_entry){time[i], to[0], to[1], to[2], value[i]};
    }
    return true;
}

static bool read_channels(gust_reader *load)
{
    gust_model *model = load->model;
    const int64_t n = model->n_channels;
    const int32_t *channel = NULL;
    const char **names = NULL;
    const char **units = NULL;
    if (!gust_read_integers(load, "channel", 3 * n, &channel) ||
        !gust_read_texts(load, "channel_names", n, &names) ||
        !gust_read_texts(load, "channel_units", n, &units)) {
        return false;
    }
    model->channels = gust_allocate((size_t)n, sizeof *model->channels);
    if (model->channels == NULL) {
        return gust_read_no_memory(load);
    }
    for (int64_t i = 0; i < n; ++i) {
        const int32_t *at = channel + 3 * i;
        bool good = at[1] >= 0;
        if (at[0] == GUST_CHANNEL_UNKNOWN) {
            good = good && at[1] < model->n_unknowns;
        } else if (at[0] == GUST_CHANNEL_OUTPUT) {
            int32_t instance = at[1];
            int32_t t = 0;
            while (t < model->n_types && instance >= model->types[t].n_instances) {
                instance -= model->types[t++].n_instances;
            }
            good = good && t < model->n_types && at[2] >= 0 && at[2] < model->types[t].kernel->n_outputs;
        } else {
            good = false;
        }
        if (!good) {
            return gust_refuse(load, GUST_BAD_TABLE,
                               "channel \"%s\" (kind %d: %d, %d) does not exist: build the model again",
                               names[i], at[0], at[1], at[2]);
        }
        model->channels[i] = (gust_channel){at[0], at[1], at[2], names[i], units[i]};
    }
    return true;
}

static bool read_model(gust_reader *load)
{
    gust_model *model = load->model;
    if (!gust_read_text(load, "metadata", &model->metadata) || !read_counts(load) ||
        !gust_read_sampled_counts(load) || !allocate_parts(load) || !read_pattern(load) ||
        !read_unknowns(load)) {
        return false;
    }
    for (int32_t k = 0; k < model->n_tables; ++k) {
        if (!read_table(load, k)) {
            return false;
        }
    }
    for (int32_t k = 0; k < model->n_series; ++k) {
        if (!read_series(load, k)) {
            return false;
        }
    }
    for (int32_t k = 0; k < model->n_types; ++k) {
        if (!read_type(load, k)) {
            return false;
        }
    }
    return find_unowned(load) && read_schedule(load) && read_channels(load) && gust_read_sampled(load);
}

/* Hash of all sections, for telling models apart. What may differ between two builds of the same model is left
 * out: metadata, and the folders of kernels (whose names say what is in them) and series. */
static uint64_t identity_of(const gust_container *container)
{
    uint64_t hash = GUST_HASH_START;
    for (uint32_t k = 0; k < container->n_sections; ++k) {
        const gust_section *found = &container->sections[k];
        const uint8_t *data = found->data;
        size_t bytes = (size_t)found->count * gust_dtype_size(found->dtype);
        const char *dot = strrchr(found->name, '.');
        if (strcmp(found->name, "metadata") == 0) {
            continue;
        }
        if (dot != NULL && (strcmp(dot, ".kernel") == 0 || strcmp(dot, ".path") == 0)) {
            for (size_t i = bytes; i > 0; --i) {
                if (data[i - 1] == '/') {
                    data += i;
                    bytes -= i;
                    break;
                }
            }
        }
        hash = gust_hash(hash, found->name, strlen(found->name) + 1);
        hash = gust_hash(hash, data, bytes);
    }
    return hash;
}

/* Takes over `data` (from gust_allocate), whatever the result. */
static gust_status build(uint8_t *data, size_t n_bytes, const char *folder, gust_model **model, char *message,
                         size_t size)
{
    gust_reader load = {.folder = folder, .message = message, .message_size = size, .status = GUST_OK};
    load.model = gust_allocate(1, sizeof *load.model);
    if (load.model == NULL) {
        gust_release(data);
        gust_text(message, size, "out of memory while reading the model");
        return GUST_OUT_OF_MEMORY;
    }
    load.model->bytes = data;
    if (!gust_container_open(&load.container, data, n_bytes, message, size)) {
        load.status = GUST_BAD_CONTAINER;
    } else if (read_model(&load)) {
        load.model->identity = identity_of(&load.container);
        *model = load.model;
    }
    gust_container_close(&load.container);
    if (*model == NULL) {
        gust_model_destroy(&load.model);
    }
    return load.status;
}

gust_status gust_model_parse(const void *source, size_t n_bytes, gust_model **model, char *message, size_t size)
{
    gust_text(message, size, "%s", "");
    if (model == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    *model = NULL;
    if (source == NULL) {
        gust_text(message, size, "no bytes to read a model from");
        return GUST_BAD_ARGUMENT;
    }
    uint8_t *copy = gust_allocate(n_bytes, 1);
    if (copy == NULL) {
        gust_text(message, size, "out of memory for a model of %zu bytes", n_bytes);
        return GUST_OUT_OF_MEMORY;
    }
    memcpy(copy, source, n_bytes);
    return build(copy, n_bytes, NULL, model, message, size);
}

/* The whole file into *data (from gust_allocate). */
static gust_status read_file(const char *path, uint8_t **data, size_t *n_bytes, char *message, size_t size)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL) {
        gust_text(message, size, "model file \"%s\" cannot be opened: %s", path, strerror(errno));
        return GUST_FILE_UNREADABLE;
    }
    struct stat facts;
    if (fstat(fileno(file), &facts) != 0 || !S_ISREG(facts.st_mode)) {
        gust_text(message, size, "model file \"%s\" is not an ordinary file", path);
        fclose(file);
        return GUST_FILE_UNREADABLE;
    }
    *n_bytes = (size_t)facts.st_size;
    *data = gust_allocate(*n_bytes, 1);
    if (*data == NULL) {
        gust_text(message, size, "out of memory for model file \"%s\" of %zu bytes", path, *n_bytes);
        fclose(file);
        return GUST_OUT_OF_MEMORY;
    }
    const size_t got = fread(*data, 1, *n_bytes, file);
    fclose(file);
    if (got != *n_bytes) {
        gust_text(message, size, "model file \"%s\": only %zu of %zu bytes could be read", path, got, *n_bytes);
        gust_release(*data);
        *data = NULL;
        return GUST_FILE_UNREADABLE;
    }
    return GUST_OK;
}

gust_status gust_model_load(const char *path, gust_model **model, char *message, size_t size)
{
    gust_text(message, size, "%s", "");
    if (model == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    *model = NULL;
    if (path == NULL) {
        gust_text(message, size, "no path to read a model from");
        return GUST_BAD_ARGUMENT;
    }
    uint8_t *data = NULL;
    size_t n_bytes = 0;
    const gust_status status = read_file(path, &data, &n_bytes, message, size);
    if (status != GUST_OK) {
        return status;
    }
    const char *slash = strrchr(path, '/');
    char *folder = slash != NULL ? strndup(path, slash == path ? 1 : (size_t)(slash - path)) : strdup(".");
    if (folder == NULL) {
        gust_release(data);
        return GUST_OUT_OF_MEMORY;
    }
    const gust_status built = build(data, n_bytes, folder, model, message, size);
    free(folder);
    return built;
}
