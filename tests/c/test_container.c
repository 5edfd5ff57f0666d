/* Damaged and contradictory model files: refused with a message, whatever is wrong with them, never a crash. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "support.h"

/* A model with something in every section: two types, a table, a series, a schedule, channels. */
static void everything(system_builder *builder)
{
    memset(builder, 0, sizeof *builder);
    builder->n_types = 3;
    builder->n_shared = 1;
    builder->types[0] =
        (built_type){.kernel = "branch",
                     .n_instances = 2,
                     .instances = {{.name = "left", .parameters = {1.0, 0.5}, .start = {3.0}},
                                   {.name = "right", .parameters = {2.0, 0.25}, .start = {-1.0}}},
                     .differential = {1}};
    builder->types[1] =
        (built_type){.kernel = "ball",
                     .n_instances = 1,
                     .instances = {{.name = "ball", .parameters = {9.81, 0.8}, .start = {1.0, 0.0}}},
                     .differential = {1, 1},
                     .root_kind = {1},
                     .when_root = {0},
                     .when_period = {-1}};
    builder->types[2] = (built_type){
        .kernel = "surface", .n_instances = 1, .instances = {{.name = "surface"}}, .differential = {1}};
    builder->n_inputs = 2;
    builder->n_schedule = 1;
    builder->schedule_time[0] = 0.5;
    builder->schedule_target[1] = 1;
    builder->schedule_value[0] = 3.0;
    builder->n_channels = 3;
    const int32_t channel[] = {0, 0, 0, 1, 1, 0, 1, 2, 1};
    memcpy(builder->channel, channel, sizeof channel);
    builder->n_tables = 1;
    const double coefficient[16] = {1.0, 2.0, 3.0};
    writer_f64(&builder->writer, "table.0.grid", (double[]){0.0, 1.0, 0.0, 1.0}, 4);
    writer_i32(&builder->writer, "table.0.size", (int32_t[]){2, 2}, 2);
    writer_f64(&builder->writer, "table.0.coefficient", coefficient, 16);
    const double time[] = {0.0, 0.5, 2.0};
    builder_inline_series(builder, 0, 1, 0, 0.0, 0.0, 2.0, time, time, 3);
    builder_link(builder);
}

static gust_status parse(const model_writer *writer, char *message, size_t message_size)
{
    size_t size = 0;
    unsigned char *bytes = writer_bytes(writer, &size);
    gust_model *model = NULL;
    const gust_status status = gust_model_parse(bytes, size, &model, message, message_size);
    free(bytes);
    assert_true((status == GUST_OK) == (model != NULL));
    gust_model_destroy(&model);
    return status;
}

static void good(void **state)
{
    (void)state;
    static system_builder builder;
    char message[512];
    everything(&builder);
    assert_int_equal(parse(&builder.writer, message, sizeof message), GUST_OK);
    writer_clear(&builder.writer);
}

/* A damaged file may still be a model (a changed parameter); then it must also start or fail orderly. */
static void try_bytes(const unsigned char *bytes, size_t size)
{
    gust_model *model = NULL;
    char message[512] = "";
    const gust_status status = gust_model_parse(bytes, size, &model, message, sizeof message);
    if (status != GUST_OK) {
        assert_null(model);
        assert_true(strlen(message) > 0);
        return;
    }
    gust_sim *sim = NULL;
    assert_int_equal(gust_sim_create(model, &sim), GUST_OK);
    gust_sim_set_option(sim, "initial_iterations", 10);
    gust_sim_initialise(sim, 0.0); /* no further: a ball that falls with 1e150 m/s^2 bounces for ever */
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void truncated(void **state)
{
    (void)state;
    static system_builder builder;
    everything(&builder);
    size_t size = 0;
    unsigned char *bytes = writer_bytes(&builder.writer, &size);
    const size_t directory = 16 + 80 * (size_t)builder.writer.n_sections;
    for (size_t length = 0; length < size; length += length < directory ? 1 : 17) {
        unsigned char *cut = malloc(length + 1);
        assert_non_null(cut);
        memcpy(cut, bytes, length);
        gust_model *model = NULL;
        char message[512] = "";
        const gust_status status = gust_model_parse(cut, length, &model, message, sizeof message);
        /* only padding behind the last section may be missing */
        assert_true(status != GUST_OK || size - length < 64);
        gust_model_destroy(&model);
        free(cut);
    }
    free(bytes);
    writer_clear(&builder.writer);
}

static void flipped(void **state)
{
    (void)state;
    static system_builder builder;
    everything(&builder);
    size_t size = 0;
    unsigned char *bytes = writer_bytes(&builder.writer, &size);
    const size_t directory = 16 + 80 * (size_t)builder.writer.n_sections;
    /* An eleventh of the bits of the directory, a 29th of those of the data: primes, so that over the 80 bytes
     * of the entries and the 8 of the numbers all places get their turn. */
    for (size_t at = 0; at < size; ++at) {
        for (int bit = 0; bit < 8; ++bit) {
            if ((8 * at + (size_t)bit) % (at < directory ? 11 : 29) != 0) {
                continue;
            }
            bytes[at] = (unsigned char)(bytes[at] ^ (1 << bit));
            try_bytes(bytes, size);
            bytes[at] = (unsigned char)(bytes[at] ^ (1 << bit));
        }
    }
    free(bytes);
    writer_clear(&builder.writer);
}

static void missing_section(void **state)
{
    (void)state;
    static system_builder builder;
    everything(&builder);
    char message[512];
    for (uint32_t k = 0; k < builder.writer.n_sections; ++k) {
        const writer_section removed = builder.writer.sections[k];
        builder.writer.sections[k] = builder.writer.sections[--builder.writer.n_sections];
        const gust_status status = parse(&builder.writer, message, sizeof message);
        /* texts, empty sections and what a series drives may be left out, nothing else */
        if (removed.count > 0 && removed.dtype != 3 && strcmp(removed.name, "series.0.slots") != 0) {
            assert_true(status == GUST_BAD_TABLE || status == GUST_BAD_SERIES);
            assert_true(strstr(message, removed.name) != NULL || strstr(message, "is empty") != NULL);
        }
        builder.writer.sections[builder.writer.n_sections++] = builder.writer.sections[k];
        builder.writer.sections[k] = removed;
    }
    writer_clear(&builder.writer);
}

typedef struct wrong {
    const char *section;
    int index;
    double value;
    const char *says;
} wrong;

static void wrong_numbers(void **state)
{
    (void)state;
    static const wrong WRONG[] = {{"counts", 0, -1, "negative"},
                                  {"counts", 0, 0, "no unknowns"},
                                  {"counts", 2, 100000, "more types"},
                                  {"row_index", 0, 99, "row_index"},
                                  {"column_start", 0, 1, "column_start"},
                                  {"nominal", 0, 0.0, "nominal"},
                                  {"start", 1, HUGE_VAL, "start"},
                                  {"type.0.first_unknown", 1, 1, "belong"},
                                  {"type.0.first_unknown", 1, -1, "first_unknown"},
                                  {"type.0.external", 0, 77, "external"},
                                  {"type.0.flow_row", 0, 1, "belongs"},
                                  {"type.0.jacobian_position", 0, 3, "jacobian_position"},
                                  {"type.0.counts", 0, -5, "instances"},
                                  {"type.0.counts", 0, 3, "type.0"},
                                  {"type.1.when_root", 0, 4, "when_root"},
                                  {"type.1.when_root", 0, -1, "either"},
                                  {"type.1.when_period", 0, 0, "either"},
                                  {"type.1.first_input", 0, 3, "first_input"},
                                  {"type.2.table", 0, 1, "table"},
                                  {"type.2.first_input", 0, 1, "first_input"},
                                  {"schedule_target", 0, 5, "no such target"},
                                  {"schedule_target", 2, 2, "no such target"},
                                  {"channel", 0, 2, "channel0"},
                                  {"channel", 1, 40, "channel0"},
                                  {"channel", 5, 1, "channel1"},
                                  {"channel", 4, 9, "channel1"},
                                  {"series.0.slots", 0, 2, "slots"},
                                  {"series.0.kind", 0, 3, "kind"},
                                  {"series.0.kind", 1, 3, "kind"},
                                  {"series.0.time", 1, 3.0, "not after"},
                                  {"series.0.value", 2, HUGE_VAL, "sample 2"},
                                  {"series.0.timing", 2, -1.0, "end after"},
                                  {"table.0.grid", 1, 0.0, "steps"},
                                  {"table.0.size", 0, 1, "size"},
                                  {"table.0.size", 0, 9, "coefficient"}};
    char message[512];
    for (size_t k = 0; k < sizeof WRONG / sizeof WRONG[0]; ++k) {
        static system_builder builder;
        everything(&builder);
        bool found = false;
        for (uint32_t s = 0; s < builder.writer.n_sections; ++s) {
            writer_section *section = &builder.writer.sections[s];
            if (strcmp(section->name, WRONG[k].section) == 0) {
                found = true;
                assert_true((uint64_t)WRONG[k].index < section->count);
                if (section->dtype == 1) {
                    memcpy(section->data + 8 * (size_t)WRONG[k].index, &WRONG[k].value, 8);
                } else {
                    const int32_t value = (int32_t)WRONG[k].value;
                    memcpy(section->data + 4 * (size_t)WRONG[k].index, &value, 4);
                }
            }
        }
        assert_true(found);
        const gust_status status = parse(&builder.writer, message, sizeof message);
        if (status == GUST_OK) {
            fail_msg("%s[%d] = %g was accepted", WRONG[k].section, WRONG[k].index, WRONG[k].value);
        }
        assert_says(message, WRONG[k].says);
        writer_clear(&builder.writer);
    }
}

static void kernels(void **state)
{
    (void)state;
    static system_builder builder;
    char message[512];
    char path[512];
    everything(&builder);
    writer_text(&builder.writer, "type.0.kernel", "/nonexistent/kernel.so");
    assert_int_equal(parse(&builder.writer, message, sizeof message), GUST_BAD_KERNEL);
    assert_says(message, "/nonexistent/kernel.so");
    kernel_path("old", path, sizeof path);
    writer_text(&builder.writer, "type.0.kernel", path);
    assert_int_equal(parse(&builder.writer, message, sizeof message), GUST_BAD_KERNEL);
    assert_says(message, "interface");
    /* a library, but no kernel */
    writer_text(&builder.writer, "type.0.kernel", GUSTFORM_TEST_KERNELS "/libempty.so");
    assert_int_equal(parse(&builder.writer, message, sizeof message), GUST_BAD_KERNEL);
    assert_says(message, "gust_kernel_get");
    /* another type's kernel */
    kernel_path("pendulum", path, sizeof path);
    writer_text(&builder.writer, "type.0.kernel", path);
    assert_int_equal(parse(&builder.writer, message, sizeof message), GUST_BAD_TABLE);
    writer_text(&builder.writer, "type.0.kernel", "");
    assert_int_equal(parse(&builder.writer, message, sizeof message), GUST_BAD_TABLE);
    writer_clear(&builder.writer);
}

/* From a file; a relative kernel path starts at the file's folder. */
static void load(void **state)
{
    (void)state;
    static system_builder builder;
    everything(&builder);
    writer_text(&builder.writer, "type.0.kernel", "libbranch.so");
    size_t size = 0;
    unsigned char *bytes = writer_bytes(&builder.writer, &size);
    const char *path = GUSTFORM_TEST_KERNELS "/test_load.gust";
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    fclose(file);
    free(bytes);
    writer_clear(&builder.writer);
    gust_model *model = NULL;
    char message[512];
    if (gust_model_load(path, &model, message, sizeof message) != GUST_OK) {
        fail_msg("%s", message);
    }
    assert_int_equal(gust_model_n_unknowns(model), 6);
    assert_int_equal(gust_model_n_instances(model), 4);
    assert_int_equal(gust_model_n_channels(model), 3);
    assert_int_equal(gust_model_n_series(model), 1);
    assert_string_equal(gust_model_channel_name(model, 1), "channel1");
    assert_string_equal(gust_model_channel_unit(model, 2), "unit2");
    assert_string_equal(gust_model_channel_name(model, 3), "");
    assert_string_equal(gust_model_series_name(model, 0), "wind");
    assert_string_equal(gust_model_metadata(model), "{}");
    gust_model_destroy(&model);
    unlink(path);
    assert_int_equal(gust_model_load(path, &model, message, sizeof message), GUST_FILE_UNREADABLE);
    assert_says(message, "test_load.gust");
    assert_null(model);
    assert_int_equal(gust_model_load("/", &model, message, sizeof message), GUST_FILE_UNREADABLE);
    assert_int_equal(gust_model_load(NULL, &model, message, sizeof message), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_model_parse(NULL, 0, &model, NULL, 0), GUST_BAD_ARGUMENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(good),          cmocka_unit_test(truncated),
                                       cmocka_unit_test(flipped),       cmocka_unit_test(missing_section),
                                       cmocka_unit_test(wrong_numbers), cmocka_unit_test(kernels),
                                       cmocka_unit_test(load)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
