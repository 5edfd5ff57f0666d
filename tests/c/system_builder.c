#include "system_builder.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "kernel_library.h"

typedef struct entry {
    int32_t row;
    int32_t column;
} entry;

static int by_column(const void *left, const void *right)
{
    const entry *a = left;
    const entry *b = right;
    if (a->column != b->column) {
        return a->column < b->column ? -1 : 1;
    }
    return a->row < b->row ? -1 : (a->row > b->row ? 1 : 0);
}

void kernel_path(const char *name, char *path, size_t size)
{
    snprintf(path, size, "%s/lib%s.so", GUSTFORM_TEST_KERNELS, name);
}

static const char *section_of(char *name, size_t size, int32_t type, const char *what)
{
    snprintf(name, size, "type.%d.%s", type, what);
    return name;
}

/* "what0", "what1", ... */
static void numbered(model_writer *writer, const char *section, const char *what, int32_t count)
{
    char names[BUILDER_UNKNOWNS][24];
    const char *pointers[BUILDER_UNKNOWNS];
    for (int32_t k = 0; k < count; ++k) {
        snprintf(names[k], sizeof names[k], "%s%d", what, k);
        pointers[k] = names[k];
    }
    writer_texts(writer, section, pointers, (size_t)count);
}

typedef struct linking {
    system_builder *builder;
    const gust_kernel *kernels[BUILDER_TYPES];
    void *libraries[BUILDER_TYPES];
    entry entries[4096];
    size_t n_entries;
    int32_t n_unknowns;
    int32_t column_start[BUILDER_UNKNOWNS + 1];
    int32_t row_index[4096];
    int32_t n_nonzeros;
    double start[BUILDER_UNKNOWNS];
    double nominal[BUILDER_UNKNOWNS];
    uint8_t differential[BUILDER_UNKNOWNS];
} linking;

static entry global_entry(const gust_kernel *kernel, const built_instance *instance, int32_t k)
{
    const int32_t row = kernel->jacobian_row[k];
    const int32_t column = kernel->jacobian_column[k];
    const int32_t n = kernel->n_unknowns;
    return (entry){row < n ? instance->first_unknown + row : instance->flow_row[row - n],
                   column < n ? instance->first_unknown + column : instance->external[column - n]};
}

static void number_unknowns(linking *link)
{
    system_builder *builder = link->builder;
    link->n_unknowns = builder->n_shared;
    for (int32_t k = 0; k < builder->n_shared; ++k) {
        link->start[k] = builder->shared_start[k];
    }
    for (int32_t t = 0; t < builder->n_types; ++t) {
        built_type *type = &builder->types[t];
        const gust_kernel *kernel = link->kernels[t];
        for (int32_t i = 0; i < type->n_instances; ++i) {
            type->instances[i].first_unknown = link->n_unknowns;
            for (int32_t k = 0; k < kernel->n_unknowns; ++k) {
                link->start[link->n_unknowns] = type->instances[i].start[k];
                link->differential[link->n_unknowns] = type->differential[k];
                ++link->n_unknowns;
            }
            for (int32_t k = 0; k < kernel->n_nonzeros; ++k) {
                link->entries[link->n_entries++] = global_entry(kernel, &type->instances[i], k);
            }
        }
    }
    for (int32_t k = 0; k < link->n_unknowns; ++k) {
        link->nominal[k] = 1.0;
    }
}

static void merge_pattern(linking *link)
{
    qsort(link->entries, link->n_entries, sizeof link->entries[0], by_column);
    for (size_t k = 0; k < link->n_entries; ++k) {
        if (k == 0 || by_column(&link->entries[k - 1], &link->entries[k]) != 0) {
            link->row_index[link->n_nonzeros++] = link->entries[k].row;
            ++link->column_start[link->entries[k].column + 1];
        }
    }
    for (int32_t k = 0; k < link->n_unknowns; ++k) {
        link->column_start[k + 1] += link->column_start[k];
    }
}

static int32_t position_of(const linking *link, entry wanted)
{
    for (int32_t k = link->column_start[wanted.column]; k < link->column_start[wanted.column + 1]; ++k) {
        if (link->row_index[k] == wanted.row) {
            return k;
        }
    }
    fail_msg("entry missing from the pattern");
    return -1;
}

static void write_type(linking *link, int32_t t)
{
    model_writer *writer = &link->builder->writer;
    const built_type *type = &link->builder->types[t];
    const gust_kernel *kernel = link->kernels[t];
    const int32_t ni = type->n_instances;
    char name[56];
    char path[512];
    int32_t integers[1024];
    double numbers[256];
    const char *names[BUILDER_INSTANCES];
    kernel_path(type->kernel, path, sizeof path);
    writer_text(writer, section_of(name, sizeof name, t, "kernel"), path);
    writer_text(writer, section_of(name, sizeof name, t, "name"), type->kernel);
    writer_i32(writer, section_of(name, sizeof name, t, "counts"), (int32_t[]){ni, 0}, 2);
    for (int32_t i = 0; i < ni; ++i) {
        names[i] = type->instances[i].name;
        integers[i] = type->instances[i].first_unknown;
    }
    writer_texts(writer, section_of(name, sizeof name, t, "instance_names"), names, (size_t)ni);
    writer_i32(writer, section_of(name, sizeof name, t, "first_unknown"), integers, (size_t)ni);
    numbered(writer, section_of(name, sizeof name, t, "unknown_names"), "y", kernel->n_unknowns);
    numbered(writer, section_of(name, sizeof name, t, "equation_names"), "equation ", kernel->n_unknowns);
    numbered(writer, section_of(name, sizeof name, t, "external_names"), "w", kernel->n_external);
    numbered(writer, section_of(name, sizeof name, t, "flow_names"), "flow", kernel->n_flows);
    numbered(writer, section_of(name, sizeof name, t, "root_names"), "root", kernel->n_roots);
    numbered(writer, section_of(name, sizeof name, t, "when_names"), "when", kernel->n_whens);
    numbered(writer, section_of(name, sizeof name, t, "parameter_names"), "p", kernel->n_parameters);
    size_t n = 0;
    for (int32_t i = 0; i < ni; ++i) {
        for (int32_t k = 0; k < kernel->n_external; ++k) {
            integers[n++] = type->instances[i].external[k];
        }
    }
    writer_i32(writer, section_of(name, sizeof name, t, "external"), integers, n);
    n = 0;
    for (int32_t i = 0; i < ni; ++i) {
        for (int32_t k = 0; k < kernel->n_flows; ++k) {
            integers[n++] = type->instances[i].flow_row[k];
        }
    }
    writer_i32(writer, section_of(name, sizeof name, t, "flow_row"), integers, n);
    n = 0;
    for (int32_t i = 0; i < ni; ++i) {
        for (int32_t k = 0; k < kernel->n_nonzeros; ++k) {
            integers[n++] = position_of(link, global_entry(kernel, &type->instances[i], k));
        }
    }
    writer_i32(writer, section_of(name, sizeof name, t, "jacobian_position"), integers, n);
    for (int32_t i = 0; i < ni; ++i) {
        integers[i] = type->instances[i].first_input;
    }
    writer_i32(writer, section_of(name, sizeof name, t, "first_input"), integers, (size_t)ni);
    n = 0;
    for (int32_t i = 0; i < ni; ++i) {
        for (int32_t k = 0; k < kernel->n_tables; ++k) {
            integers[n++] = type->instances[i].table[k];
        }
    }
    writer_i32(writer, section_of(name, sizeof name, t, "table"), integers, n);
    n = 0;
    for (int32_t i = 0; i < ni; ++i) {
        for (int32_t k = 0; k < kernel->n_parameters; ++k) {
            numbers[n++] = type->instances[i].parameters[k];
        }
    }
    writer_f64(writer, section_of(name, sizeof name, t, "parameters"), numbers, n);
    n = 0;
    for (int32_t i = 0; i < ni; ++i) {
        for (int32_t k = 0; k < kernel->n_discrete; ++k) {
            numbers[n++] = type->instances[i].discrete[k];
        }
    }
    writer_f64(writer, section_of(name, sizeof name, t, "discrete"), numbers, n);
    writer_u8(writer, section_of(name, sizeof name, t, "root_kind"), type->root_kind, (size_t)kernel->n_roots);
    writer_i32(writer, section_of(name, sizeof name, t, "when_root"), type->when_root, (size_t)kernel->n_whens);
    writer_i32(writer, section_of(name, sizeof name, t, "when_period"), type->when_period,
               (size_t)kernel->n_whens);
}

void builder_link(system_builder *builder)
{
    linking *link = calloc(1, sizeof *link);
    assert_non_null(link);
    link->builder = builder;
    for (int32_t t = 0; t < builder->n_types; ++t) {
        char path[512];
        char message[1024];
        kernel_path(builder->types[t].kernel, path, sizeof path);
        link->kernels[t] = gust_kernel_open(path, &link->libraries[t], message, sizeof message);
        if (link->kernels[t] == NULL) {
            fail_msg("%s", message);
        }
    }
    number_unknowns(link);
    merge_pattern(link);
    model_writer *writer = &builder->writer;
    const size_t n = (size_t)link->n_unknowns;
    const int32_t counts[8] = {link->n_unknowns,  link->n_nonzeros,  builder->n_types,    builder->n_inputs,
                               builder->n_series, builder->n_tables, builder->n_schedule, builder->n_channels};
    const double zeros[BUILDER_UNKNOWNS] = {0.0};
    writer_i32(writer, "counts", counts, 8);
    writer_i32(writer, "column_start", link->column_start, n + 1);
    writer_i32(writer, "row_index", link->row_index, (size_t)link->n_nonzeros);
    writer_f64(writer, "start", link->start, n);
    writer_f64(writer, "start_derivative", zeros, n);
    writer_f64(writer, "nominal", link->nominal, n);
    writer_u8(writer, "differential", link->differential, n);
    writer_f64(writer, "input_value", builder->inputs, (size_t)builder->n_inputs);
    writer_f64(writer, "schedule_time", builder->schedule_time, (size_t)builder->n_schedule);
    writer_i32(writer, "schedule_target", builder->schedule_target, 3 * (size_t)builder->n_schedule);
    writer_f64(writer, "schedule_value", builder->schedule_value, (size_t)builder->n_schedule);
    writer_i32(writer, "channel", builder->channel, 3 * (size_t)builder->n_channels);
    numbered(writer, "channel_names", "channel", builder->n_channels);
    numbered(writer, "channel_units", "unit", builder->n_channels);
    writer_text(writer, "metadata", "{}");
    for (int32_t t = 0; t < builder->n_types; ++t) {
        write_type(link, t);
        gust_kernel_close(link->libraries[t]);
    }
    free(link);
}

gust_model *builder_model(system_builder *builder)
{
    builder_link(builder);
    size_t size = 0;
    unsigned char *bytes = writer_bytes(&builder->writer, &size);
    writer_clear(&builder->writer);
    gust_model *model = NULL;
    char message[1024];
    const gust_status status = gust_model_parse(bytes, size, &model, message, sizeof message);
    free(bytes);
    if (status != GUST_OK) {
        fail_msg("%s: %s", gust_status_name(status), message);
    }
    return model;
}

void builder_inline_series(system_builder *builder, int32_t interpolation, int32_t on_end, int32_t slot,
                           double t0, double dt, double t_end, const double *time, const double *value,
                           size_t count)
{
    char name[56];
    const int32_t number = builder->n_series++;
    const int32_t kind[4] = {interpolation, 0, on_end, time == NULL ? 1 : 0};
    const double timing[3] = {t0, dt, t_end};
    snprintf(name, sizeof name, "series.%d.kind", number);
    writer_i32(&builder->writer, name, kind, 4);
    snprintf(name, sizeof name, "series.%d.slots", number);
    writer_i32(&builder->writer, name, &slot, 1);
    snprintf(name, sizeof name, "series.%d.timing", number);
    writer_f64(&builder->writer, name, timing, 3);
    snprintf(name, sizeof name, "series.%d.value", number);
    writer_f64(&builder->writer, name, value, count);
    if (time != NULL) {
        snprintf(name, sizeof name, "series.%d.time", number);
        writer_f64(&builder->writer, name, time, count);
    }
    snprintf(name, sizeof name, "series.%d.name", number);
    writer_text(&builder->writer, name, "wind");
    snprintf(name, sizeof name, "series.%d.unit", number);
    writer_text(&builder->writer, name, "m/s");
}

void builder_sampled(system_builder *builder, int32_t libraries, int32_t blocks, int32_t changes)
{
    const int32_t numbers[] = {libraries, blocks, changes};
    writer_i32(&builder->writer, "sampled", numbers, 3);
    if (libraries > 0) {
        char path[512];
        kernel_path("law", path, sizeof path);
        writer_text(&builder->writer, "library.0.path", path);
    }
}

static const char *of_block(int32_t number, const char *what)
{
    static char name[56];
    snprintf(name, sizeof name, "sampled.%d.%s", number, what);
    return name;
}

void builder_law(system_builder *builder, int32_t number, const int32_t kind[6], int32_t x, double period,
                 const double numbers[3])
{
    model_writer *writer = &builder->writer;
    const char *const measured[] = {"x", "double_x"};
    const char *const units[] = {"V", "V"};
    const char *const commanded[] = {"u"};
    const char *const slopes[] = {"V/s"};
    const built_type *type = &builder->types[kind[0]];
    const int32_t measurement[] = {0, x, 1, 1, 0, 1};
    const int32_t command[] = {1};
    const int32_t monitor[] = {0};
    const char *const monitored[] = {"seen"};
    const size_t n = kind[2] == LIBRARY ? 1 : 0;
    writer_text(writer, of_block(number, "name"), type->instances[kind[1]].name);
    writer_i32(writer, of_block(number, "kind"), kind, 6);
    writer_f64(writer, of_block(number, "period"), &period, 1);
    writer_i32(writer, of_block(number, "measurement"), measurement, 6);
    writer_i32(writer, of_block(number, "command"), command, 1);
    writer_i32(writer, of_block(number, "monitor"), monitor, 1);
    writer_f64(writer, of_block(number, "parameters"), numbers, 2 * n);
    writer_f64(writer, of_block(number, "states"), numbers + 2, n);
    writer_texts(writer, of_block(number, "measurement_names"), measured, 2);
    writer_texts(writer, of_block(number, "measurement_units"), units, 2);
    writer_texts(writer, of_block(number, "command_names"), commanded, 1);
    writer_texts(writer, of_block(number, "command_units"), slopes, 1);
    writer_texts(writer, of_block(number, "monitor_names"), monitored, 1);
}
