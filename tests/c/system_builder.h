/* Small systems for tests, linked as the Python linker would: instances of test kernels, shared unknowns,
 * flow sums, and the pattern that follows. */
#ifndef GUSTFORM_TEST_SYSTEM_BUILDER_H
#define GUSTFORM_TEST_SYSTEM_BUILDER_H

#include <stdbool.h>

#include "gustform/gust_model.h"
#include "model_writer.h"

enum {
    BUILDER_TYPES = 4,
    BUILDER_INSTANCES = 16,
    BUILDER_UNKNOWNS = 64,
    BUILDER_LINKS = 4,
    BUILDER_CHANNELS = 32
};

typedef struct built_instance {
    const char *name;
    int32_t external[BUILDER_LINKS]; /* global unknowns; given by the test */
    int32_t flow_row[BUILDER_LINKS];
    int32_t first_input;
    int32_t table[BUILDER_LINKS];
    double parameters[16];
    double discrete[8];
    double start[16];
    int32_t first_unknown; /* result */
} built_instance;

typedef struct built_type {
    const char *kernel; /* name of the kernel library, without folder and ending */
    int32_t n_instances;
    built_instance instances[BUILDER_INSTANCES];
    uint8_t differential[16]; /* of its unknowns */
    uint8_t root_kind[8];
    int32_t when_root[8];
    int32_t when_period[8];
} built_type;

typedef struct system_builder {
    model_writer writer;
    int32_t n_types;
    built_type types[BUILDER_TYPES];
    int32_t n_shared; /* unknowns that belong to nobody, numbered first: 0 ... n_shared - 1 */
    double shared_start[8];
    int32_t n_inputs;
    double inputs[8];
    int32_t n_series;
    int32_t n_tables;
    int32_t n_schedule;
    double schedule_time[8];
    int32_t schedule_target[24];
    double schedule_value[8];
    int32_t n_channels;
    int32_t channel[3 * BUILDER_CHANNELS];
} system_builder;

/* Links everything and writes the sections. Sections of series and tables are the test's to write. */
void builder_link(system_builder *builder);

/* Links, and loads the result; fails the test if it is refused. The caller destroys the model. */
gust_model *builder_model(system_builder *builder);

/* How many libraries (of law.c), sampled blocks and changes of their parameters there are. */
enum { NONE = -1, LIBRARY = 0 };
void builder_sampled(system_builder *builder, int32_t libraries, int32_t blocks, int32_t changes);

/* Block `number`: the controller law.c at an instance of held.c whose unknown is number x. kind: see
 * runtime/README.md; numbers: k, i, s. */
void builder_law(system_builder *builder, int32_t number, const int32_t kind[6], int32_t x, double period,
                 const double numbers[3]);

/* Path of a test kernel library. */
void kernel_path(const char *name, char *path, size_t size);

/* Values for a series that is held in the model; slots: input numbers. */
void builder_inline_series(system_builder *builder, int32_t interpolation, int32_t on_end, int32_t slot,
                           double t0, double dt, double t_end, const double *time, const double *value,
                           size_t count);

#endif
