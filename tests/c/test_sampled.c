/* Controllers beside the equations: the plant x' = -a x + d under u = -k x - s, s += i x, each 0.1 s, by the
 * library kernels/law.c and by a function of the host, against its closed form between the samples. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support.h"

static const double PRECISE = 1e-9;
static const double CLOSE = 1e-6;
static const double T = 0.1;

typedef struct loop {
    double a, k, i, x, s, u, waiting;
    int32_t delay;
} loop;

static const loop START = {.a = 1.0, .k = 2.0, .i = 0.25, .x = 1.0, .s = 0.125, .u = 0.5, .waiting = 0.5};

/* One sample of the closed form, with numbers rounded as the float controller does; then T seconds of the
 * plant. */
static void sample(loop *at)
{
    const float x = (float)at->x;
    const float u = -(float)at->k * x - (float)at->s;
    at->s = (double)((float)at->s + (float)at->i * 0.5F * (float)(2.0 * at->x));
    const double acting = at->delay > 0 ? at->waiting : (double)u;
    at->waiting = (double)u;
    at->u = acting;
}

static double after(const loop *at, double t)
{
    const double decay = exp(-at->a * t);
    return at->x * decay + at->u * (1.0 - decay) / at->a;
}

/* Block `number` at an instance of type 0. */
static void add_block(system_builder *builder, int32_t number, int32_t instance, int32_t library, int32_t delay,
                      double period)
{
    builder_law(builder, number, (const int32_t[]){0, instance, library, delay, 4, 28}, instance, period,
                (const double[]){START.k, START.i, START.s});
}

/* Two plants; channels x, u, x', of the second x. Blocks are the test's to add. */
static void plants(system_builder *builder)
{
    memset(builder, 0, sizeof *builder);
    builder->n_types = 1;
    builder->types[0] = (built_type){
        .kernel = "held",
        .n_instances = 2,
        .instances =
            {{.name = "first", .parameters = {START.a}, .start = {START.x}, .discrete = {7.0, START.u}},
             {.name = "second", .parameters = {START.a}, .start = {START.x}, .discrete = {7.0, START.u}}},
        .differential = {1}};
    builder->n_channels = 4;
    const int32_t channel[] = {0, 0, 0, 1, 0, 1, 1, 0, 2, 0, 1, 0};
    memcpy(builder->channel, channel, sizeof channel);
}

static gust_model *one_block(int32_t library, int32_t delay)
{
    static system_builder builder;
    plants(&builder);
    builder_sampled(&builder, library == LIBRARY ? 1 : 0, 1, 0);
    add_block(&builder, 0, 0, library, delay, T);
    return builder_model(&builder);
}

static void follow(gust_sim *sim, loop *at, int samples)
{
    double row[4];
    for (int k = 0; k < samples; ++k) {
        sample(at);
        advance(sim, T * k + 0.5 * T);
        gust_sim_channels(sim, row);
        assert_close(row[1], at->u, 1e-6, "command");
        assert_close(row[0], after(at, 0.5 * T), CLOSE, "plant");
        at->x = after(at, T);
    }
}

static void closed_form(void **state)
{
    (void)state;
    for (int32_t delay = 0; delay <= 1; ++delay) {
        gust_model *model = one_block(LIBRARY, delay);
        gust_sim *sim = new_sim(model, PRECISE);
        initialise(sim, 0.0);
        loop at = START;
        at.delay = delay;
        follow(sim, &at, 40);
        gust_sampled_statistics statistics;
        assert_int_equal(gust_sim_sampled_statistics(sim, 0, &statistics), GUST_OK);
        assert_int_equal(statistics.samples, 40);
        assert_int_equal(statistics.bad_samples, 0);
        assert_true(isnan(statistics.first_error));
        gust_sim_destroy(&sim);
        gust_model_destroy(&model);
    }
}

static void description(void **state)
{
    (void)state;
    gust_model *model = one_block(LIBRARY, 1);
    assert_int_equal(gust_model_n_sampled(model), 1);
    assert_null(gust_model_sampled_block(model, 1));
    assert_null(gust_model_sampled_block(model, -1));
    const gust_sampled_info *info = gust_model_sampled_block(model, 0);
    assert_string_equal(info->name, "first");
    assert_true(info->period == T && info->delay == 1 && info->real_size == 4);
    assert_int_equal(info->n_measurements, 2);
    assert_string_equal(info->measurement_name[1], "double_x");
    assert_string_equal(info->measurement_unit[0], "V");
    assert_string_equal(info->command_name[0], "u");
    assert_string_equal(info->command_unit[0], "V/s");
    assert_true(info->command_start[0] == START.u);
    gust_model_destroy(&model);
}

/* -- the host's controller ------------------------------------------------------------------------------ */

typedef struct host {
    float k, i, s;
    int samples;
    int answer;
    double command;
    double last_time;
    double last_measurement[2];
} host;

static int step(void *context, double time, const double *measurements, double *commands)
{
    host *own = context;
    own->last_time = time;
    memcpy(own->last_measurement, measurements, sizeof own->last_measurement);
    ++own->samples;
    if (own->answer != 0) {
        commands[0] = own->command;
        return own->answer > 90 ? 0 : own->answer;
    }
    const float u = -own->k * (float)measurements[0] - own->s;
    own->s += own->i * 0.5F * (float)measurements[1];
    commands[0] = (double)u;
    return 0;
}

static host new_host(void)
{
    return (host){.k = (float)START.k, .i = (float)START.i, .s = (float)START.s};
}

/* What the controller tells of itself: of the sample just now, whatever the delay; a host tells nothing. */
static void monitor(void **state)
{
    (void)state;
    for (int32_t delay = 0; delay <= 1; ++delay) {
        for (int by_host = 0; by_host <= 1; ++by_host) {
            static system_builder builder;
            plants(&builder);
            memcpy(builder.channel + 3, (const int32_t[]){1, 0, 3}, 3 * sizeof(int32_t));
            builder_sampled(&builder, 1, 1, 0);
            add_block(&builder, 0, 0, LIBRARY, delay, T);
            gust_model *model = builder_model(&builder);
            gust_sim *sim = new_sim(model, PRECISE);
            host own = new_host();
            if (by_host) {
                assert_int_equal(gust_sim_set_sampled(sim, 0, step, &own), GUST_OK);
            }
            initialise(sim, 0.0);
            loop at = START;
            at.delay = delay;
            for (int k = 0; k < 10; ++k) {
                double row[4];
                const double x = at.x;
                sample(&at);
                advance(sim, T * k + 0.5 * T);
                gust_sim_channels(sim, row);
                assert_true(by_host ? isnan(row[1])
                                    : fabs(row[1] - x) < CLOSE && row[1] == (double)(float)row[1]);
                at.x = after(&at, T);
            }
            gust_sim_destroy(&sim);
            gust_model_destroy(&model);
        }
    }
}

/* The same law by the library and by the host: the same bits, also of rows and steps. */
static void host_in_place(void **state)
{
    (void)state;
    for (int32_t delay = 0; delay <= 1; ++delay) {
        double row[2][4];
        gust_statistics effort[2];
        host own = new_host();
        for (int by_host = 0; by_host <= 1; ++by_host) {
            gust_model *model = one_block(LIBRARY, delay);
            gust_sim *sim = new_sim(model, PRECISE);
            if (by_host) {
                assert_int_equal(gust_sim_set_sampled(sim, 0, step, &own), GUST_OK);
            }
            initialise(sim, 0.0);
            advance(sim, 3.27);
            gust_sim_channels(sim, row[by_host]);
            gust_sim_statistics(sim, &effort[by_host]);
            gust_sim_destroy(&sim);
            gust_model_destroy(&model);
        }
        assert_memory_equal(row[0], row[1], sizeof row[0]);
        assert_memory_equal(&effort[0], &effort[1], sizeof effort[0]);
        assert_int_equal(own.samples, 33);
        assert_true(fabs(own.last_time - 3.2) < 1e-12);
        assert_true(own.last_measurement[0] == (double)(float)own.last_measurement[0]);
    }
}

static void without_library(void **state)
{
    (void)state;
    gust_model *model = one_block(NONE, 0);
    gust_sim *sim = new_sim(model, PRECISE);
    assert_int_equal(gust_sim_initialise(sim, 0.0), GUST_BAD_ORDER);
    assert_says(gust_sim_message(sim), "\"first\" has no controller");
    gust_sim_destroy(&sim);
    sim = new_sim(model, PRECISE);
    host own = new_host();
    assert_int_equal(gust_sim_set_sampled(sim, 1, step, &own), GUST_BAD_ARGUMENT);
    assert_says(gust_sim_message(sim), "there is no sampled block 1");
    assert_int_equal(gust_sim_set_sampled(NULL, 0, step, &own), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_sim_set_sampled(sim, 0, step, &own), GUST_OK);
    initialise(sim, 0.0);
    assert_int_equal(gust_sim_set_sampled(sim, 0, step, &own), GUST_BAD_ORDER);
    loop at = START;
    follow(sim, &at, 10);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void host_fails(void **state)
{
    (void)state;
    const struct {
        int answer;
        double command;
        gust_status status;
        const char *says;
    } CASES[] = {{-3, 0.0, GUST_CONTROLLER_FAILED, "answered -3"},
                 {5, 0.0, GUST_CONTROLLER_STOPPED, "answered 5"},
                 {99, NAN, GUST_CONTROLLER_FAILED, "u = "},
                 {99, 1e39, GUST_CONTROLLER_FAILED, "u = inf"}}; /* beyond a float */
    for (size_t k = 0; k < sizeof CASES / sizeof CASES[0]; ++k) {
        gust_model *model = one_block(NONE, 0);
        gust_sim *sim = new_sim(model, PRECISE);
        host own = new_host();
        gust_sim_set_sampled(sim, 0, step, &own);
        initialise(sim, 0.0);
        advance(sim, 0.45);
        own.answer = CASES[k].answer;
        own.command = CASES[k].command;
        double reached = 0.0;
        assert_int_equal(gust_sim_advance(sim, 1.0, &reached), CASES[k].status);
        assert_says(gust_sim_message(sim), CASES[k].says);
        assert_says(gust_sim_message(sim), "0.5 s");
        assert_true(fabs(reached - 0.5) < 1e-12);
        gust_sim_destroy(&sim);
        gust_model_destroy(&model);
    }
}

/* -- several blocks ------------------------------------------------------------------------------------- */

/* Two instances on one library, and a third block of another period by the host on the second plant's other
 * value. */
static void periods(void **state)
{
    (void)state;
    static system_builder builder;
    plants(&builder);
    builder_sampled(&builder, 1, 2, 0);
    add_block(&builder, 0, 0, LIBRARY, 0, T);
    add_block(&builder, 1, 1, NONE, 0, 0.25);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    host own = new_host();
    gust_sim_set_sampled(sim, 1, step, &own);
    initialise(sim, 0.0);
    loop first = START;
    follow(sim, &first, 40);
    assert_int_equal(own.samples, 16); /* 0 ... 3.75 s */
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void shared_library(void **state)
{
    (void)state;
    static system_builder builder;
    plants(&builder);
    builder.types[0].instances[1].start[0] = 0.5;
    builder_sampled(&builder, 1, 2, 0);
    add_block(&builder, 0, 0, LIBRARY, 0, T);
    add_block(&builder, 1, 1, LIBRARY, 1, T);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    loop first = START;
    loop second = START;
    second.x = 0.5;
    second.delay = 1;
    double y[2];
    for (int k = 0; k < 30; ++k) {
        sample(&first);
        sample(&second);
        advance(sim, T * k + 0.5 * T);
        unknowns(sim, y);
        assert_close(y[0], after(&first, 0.5 * T), CLOSE, "first");
        assert_close(y[1], after(&second, 0.5 * T), CLOSE, "second");
        first.x = after(&first, T);
        second.x = after(&second, T);
    }
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* -- what changes and what goes wrong ------------------------------------------------------------------- */

static gust_model *with_changes(double k_at_1)
{
    static system_builder builder;
    plants(&builder);
    builder_sampled(&builder, 1, 1, 2);
    add_block(&builder, 0, 0, LIBRARY, 0, T);
    const double time[] = {1.0, 2.05};
    const int32_t target[] = {0, 0, 0, 1};
    const double value[] = {k_at_1, 0.0};
    writer_f64(&builder.writer, "sampled_change_time", time, 2);
    writer_i32(&builder.writer, "sampled_change_target", target, 4);
    writer_f64(&builder.writer, "sampled_change_value", value, 2);
    return builder_model(&builder);
}

static void parameters_change(void **state)
{
    (void)state;
    gust_model *model = with_changes(0.5);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    loop at = START;
    double y[2];
    for (int k = 0; k < 30; ++k) {
        at.k = k >= 10 ? 0.5 : at.k; /* in the very sample */
        at.i = k >= 21 ? 0.0 : at.i;
        sample(&at);
        advance(sim, T * k + 0.5 * T);
        unknowns(sim, y);
        assert_close(y[0], after(&at, 0.5 * T), CLOSE, "plant");
        at.x = after(&at, T);
    }
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* A bad calibration: the controller keeps the last good one and says so from then on. */
static void errors_are_counted(void **state)
{
    (void)state;
    gust_model *model = with_changes(-1.0);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    loop at = START;
    follow(sim, &at, 20);
    gust_sampled_statistics statistics;
    gust_sim_sampled_statistics(sim, 0, &statistics);
    assert_int_equal(statistics.samples, 20);
    assert_int_equal(statistics.bad_samples, 10);
    assert_int_equal(statistics.errors[3], 10);
    assert_int_equal(statistics.errors[2], 0);
    assert_true(fabs(statistics.first_error - 1.0) < 1e-12);
    assert_int_equal(gust_sim_sampled_statistics(sim, 4, &statistics), GUST_BAD_ARGUMENT);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void parameters_refused(void **state)
{
    (void)state;
    static system_builder builder;
    plants(&builder);
    builder_sampled(&builder, 1, 1, 0);
    add_block(&builder, 0, 0, LIBRARY, 0, T);
    const double bad[] = {-2.0, 0.0};
    writer_f64(&builder.writer, "sampled.0.parameters", bad, 2);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    assert_int_equal(gust_sim_initialise(sim, 0.0), GUST_CONTROLLER_FAILED);
    assert_says(gust_sim_message(sim), "refuses its parameters");
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* Where no command becomes another the integrator runs on. */
static void at_rest(void **state)
{
    (void)state;
    static system_builder builder;
    plants(&builder);
    builder.types[0].instances[0].start[0] = 0.0;
    builder.types[0].instances[0].discrete[1] = 0.0;
    builder_sampled(&builder, 1, 1, 0);
    add_block(&builder, 0, 0, LIBRARY, 0, T);
    const double rest = 0.0;
    writer_f64(&builder.writer, "sampled.0.states", &rest, 1);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    advance(sim, 10.0);
    gust_statistics statistics;
    gust_sim_statistics(sim, &statistics);
    assert_int_equal(statistics.restarts, 0);
    assert_int_equal(statistics.events, 100); /* 0 ... 9.9 s */
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* -- checkpoints ---------------------------------------------------------------------------------------- */

/* Context, held and waiting commands go with a checkpoint: the run that goes on has the same bits, whenever it
 * is. */
static void checkpoints(void **state)
{
    (void)state;
    const double WHEN[] = {0.0, 0.3, 0.35, 1.0, 1.2345, 2.05, 2.9};
    for (size_t k = 0; k < sizeof WHEN / sizeof WHEN[0]; ++k) {
        gust_model *model = with_changes(0.5);
        gust_sim *one = new_sim(model, PRECISE);
        initialise(one, 0.0);
        advance(one, WHEN[k]);
        assert_int_equal(gust_sim_checkpoint(one, NULL), GUST_OK);
        const void *bytes = NULL;
        size_t size = 0;
        gust_sim_checkpoint_bytes(one, &bytes, &size);
        gust_sim *other = new_sim(model, PRECISE);
        initialise(other, 0.0);
        advance(other, 0.17);
        assert_int_equal(gust_sim_restore_bytes(other, bytes, size), GUST_OK);
        double row[2][4];
        gust_statistics effort[2];
        gust_sampled_statistics fared[2];
        for (int which = 0; which < 2; ++which) {
            gust_sim *sim = which == 0 ? one : other;
            advance(sim, 4.01);
            gust_sim_channels(sim, row[which]);
            gust_sim_statistics(sim, &effort[which]);
            gust_sim_sampled_statistics(sim, 0, &fared[which]);
        }
        assert_memory_equal(row[0], row[1], sizeof row[0]);
        assert_memory_equal(&effort[0], &effort[1], sizeof effort[0]);
        assert_memory_equal(&fared[0], &fared[1], sizeof fared[0]);
        assert_int_equal(fared[0].samples, 41);
        gust_sim_destroy(&one);
        gust_sim_destroy(&other);
        gust_model_destroy(&model);
    }
}

/* The state of a library's controller is no good to a run whose host steps it, nor the other way round. */
static void foreign_checkpoint(void **state)
{
    (void)state;
    gust_model *model = one_block(LIBRARY, 0);
    gust_sim *one = new_sim(model, PRECISE);
    initialise(one, 0.0);
    assert_int_equal(gust_sim_checkpoint(one, NULL), GUST_OK);
    const void *bytes = NULL;
    size_t size = 0;
    gust_sim_checkpoint_bytes(one, &bytes, &size);
    gust_sim *other = new_sim(model, PRECISE);
    host own = new_host();
    gust_sim_set_sampled(other, 0, step, &own);
    initialise(other, 0.0);
    assert_int_equal(gust_sim_restore_bytes(other, bytes, size), GUST_FOREIGN_CHECKPOINT);
    assert_says(gust_sim_message(other), "sampled.host");
    gust_sim_destroy(&one);
    gust_sim_destroy(&other);
    gust_model_destroy(&model);
}

/* -- files that are not what they should be ------------------------------------------------------------- */

static void refused(system_builder *builder, gust_status status, const char *says)
{
    size_t size = 0;
    unsigned char *bytes = writer_bytes(&builder->writer, &size);
    gust_model *model = NULL;
    char message[1024];
    assert_int_equal(gust_model_parse(bytes, size, &model, message, sizeof message), status);
    assert_null(model);
    assert_says(message, says);
    free(bytes);
    writer_clear(&builder->writer);
}

static void good(system_builder *builder)
{
    plants(builder);
    builder_link(builder);
    builder_sampled(builder, 1, 1, 0);
    add_block(builder, 0, 0, LIBRARY, 0, T);
}

static void damaged(void **state)
{
    (void)state;
    static system_builder builder;
    model_writer *writer = &builder.writer;
    const struct {
        const char *section;
        int32_t count;
        int32_t numbers[6];
        const char *says;
    } INTEGERS[] = {
        {"sampled", 2, {1, 1}, "three counts"},
        {"sampled", 3, {1, -1, 0}, "three counts"},
        {"sampled", 3, {1, 1000000, 0}, "three counts"},
        {"sampled", 3, {1, 1, 1}, "sampled_change_time"},
        {"sampled", 3, {1, 2, 0}, "sampled.1."},
        {"sampled", 3, {2, 1, 0}, "library 1 has no path"},
        {"sampled.0.kind", 6, {1, 0, 0, 0, 4, 28}, "unknown kind"},
        {"sampled.0.kind", 6, {0, 2, 0, 0, 4, 28}, "unknown kind"},
        {"sampled.0.kind", 6, {0, -1, 0, 0, 4, 28}, "unknown kind"},
        {"sampled.0.kind", 6, {0, 0, 1, 0, 4, 28}, "unknown kind"},
        {"sampled.0.kind", 6, {0, 0, 0, 2, 4, 28}, "unknown kind"},
        {"sampled.0.kind", 6, {0, 0, 0, 0, 5, 28}, "unknown kind"},
        {"sampled.0.kind", 6, {0, 0, 0, 0, 4, -4}, "unknown kind"},
        {"sampled.0.kind", 5, {0, 0, 0, 0, 4}, "has 5 elements"},
        {"sampled.0.measurement", 6, {0, 2, 1, 1, 0, 1}, "\"x\" of the sampled block \"first\" does not exist"},
        {"sampled.0.measurement", 6, {0, 0, 1, 1, 4, 1}, "\"double_x\" of the sampled block \"first\""},
        {"sampled.0.measurement", 6, {0, 0, 1, 2, 0, 1}, "does not exist"},
        {"sampled.0.measurement", 6, {0, 0, 0, 1, 0, 1}, "does not exist"},
        {"sampled.0.measurement", 5, {0, 0, 1, 1, 0}, "too many values"},
        {"sampled.0.command", 1, {2}, "outside 0 ... 1"},
        {"sampled.0.command", 2, {0, 1}, "holds 1 texts, not 2"},
        {"sampled.0.monitor", 1, {2}, "outside 0 ... 1"},
        {"sampled.0.monitor", 2, {0, 1}, "holds 1 texts, not 2"},
    };
    for (size_t k = 0; k < sizeof INTEGERS / sizeof INTEGERS[0]; ++k) {
        good(&builder);
        writer_i32(writer, INTEGERS[k].section, INTEGERS[k].numbers, (size_t)INTEGERS[k].count);
        refused(&builder, GUST_BAD_TABLE, INTEGERS[k].says);
    }
    const struct {
        const char *section;
        int32_t count;
        double numbers[3];
        gust_status status;
        const char *says;
    } NUMBERS[] = {{"sampled.0.period", 1, {0.0}, GUST_BAD_TABLE, "must be greater than 0"},
                   {"sampled.0.period", 1, {NAN}, GUST_BAD_TABLE, "must be a number"},
                   {"sampled.0.period", 1, {0.2}, GUST_BAD_CONTROLLER, "not the one"},
                   {"sampled.0.parameters", 3, {1.0, 0.0, 0.0}, GUST_BAD_CONTROLLER, "not the one"},
                   {"sampled.0.parameters", 2, {1.0, INFINITY}, GUST_BAD_TABLE, "must be a number"},
                   {"sampled.0.states", 1, {NAN}, GUST_BAD_TABLE, "must be a number"},
                   {"sampled.0.states", 3, {0.0, 0.0, 0.0}, GUST_BAD_CONTROLLER, "not the one"}};
    for (size_t k = 0; k < sizeof NUMBERS / sizeof NUMBERS[0]; ++k) {
        good(&builder);
        writer_f64(writer, NUMBERS[k].section, NUMBERS[k].numbers, (size_t)NUMBERS[k].count);
        if (NUMBERS[k].count == 3 && NUMBERS[k].section[10] == 's') { /* three states do not fit behind 36 */
            const int32_t kind[] = {0, 0, 0, 0, 4, 36};
            writer_i32(writer, "sampled.0.kind", kind, 6);
        }
        refused(&builder, NUMBERS[k].status, NUMBERS[k].says);
    }
    good(&builder);
    const char *const swapped[] = {"double_x", "x"};
    writer_texts(writer, "sampled.0.measurement_names", swapped, 2);
    refused(&builder, GUST_BAD_CONTROLLER, "not the one");
    good(&builder);
    const int32_t size_8[] = {0, 0, 0, 0, 8, 28};
    writer_i32(writer, "sampled.0.kind", size_8, 6);
    refused(&builder, GUST_BAD_CONTROLLER, "not the one");
}

static void bad_changes(void **state)
{
    (void)state;
    static system_builder builder;
    const struct {
        double time[2];
        int32_t target[4];
    } CASES[] = {{{1.0, 0.5}, {0, 0, 0, 0}},
                 {{1.0, 2.0}, {0, 0, 1, 0}},
                 {{1.0, 2.0}, {0, 2, 0, 0}},
                 {{1.0, 2.0}, {-1, 0, 0, 0}},
                 {{1.0, 2.0}, {0, -1, 0, 0}}};
    for (size_t k = 0; k < sizeof CASES / sizeof CASES[0]; ++k) {
        good(&builder);
        builder_sampled(&builder, 1, 1, 2);
        const double value[] = {0.5, 0.5};
        writer_f64(&builder.writer, "sampled_change_time", CASES[k].time, 2);
        writer_i32(&builder.writer, "sampled_change_target", CASES[k].target, 4);
        writer_f64(&builder.writer, "sampled_change_value", value, 2);
        refused(&builder, GUST_BAD_TABLE, "no such target");
    }
}

static void bad_libraries(void **state)
{
    (void)state;
    static system_builder builder;
    char path[512];
    kernel_path("held", path, sizeof path);
    const struct {
        const char *path;
        const char *says;
    } CASES[] = {{path, "no gust_controller_interface"},
                 {"/nowhere/controller.so", "cannot be loaded"},
                 {"libc.so.6", "cannot be loaded"}, /* never the system's folders */
                 {"", "has no path"}};
    for (size_t k = 0; k < sizeof CASES / sizeof CASES[0]; ++k) {
        good(&builder);
        writer_text(&builder.writer, "library.0.path", CASES[k].path);
        refused(&builder, CASES[k].path[0] == '\0' ? GUST_BAD_TABLE : GUST_BAD_CONTROLLER, CASES[k].says);
    }
}

/* A file with some bytes changed anywhere is refused or can be run; nothing else happens (the sanitizers see to
 * that).
 */
static void changed_bytes(void **state)
{
    (void)state;
    static system_builder builder;
    good(&builder);
    size_t size = 0;
    unsigned char *sound = writer_bytes(&builder.writer, &size);
    unsigned char *bytes = malloc(size);
    assert_non_null(bytes);
    uint32_t random = 12345;
    int loaded = 0;
    for (int trial = 0; trial < 3000; ++trial) {
        memcpy(bytes, sound, size);
        for (int k = 0; k <= trial % 3; ++k) {
            random = random * 1664525U + 1013904223U;
            const size_t where = (size_t)(random >> 4) % size;
            random = random * 1664525U + 1013904223U;
            bytes[where] = (unsigned char)(random >> 24);
        }
        gust_model *model = NULL;
        char message[1024];
        if (gust_model_parse(bytes, size, &model, message, sizeof message) == GUST_OK) {
            gust_sim *sim = new_sim(model, 1e-4);
            (void)gust_sim_initialise(sim, 0.0);
            gust_sim_destroy(&sim);
            ++loaded;
        } else {
            assert_true(message[0] != '\0');
        }
        gust_model_destroy(&model);
    }
    assert_in_range(loaded, 100, 2900);
    free(bytes);
    free(sound);
    writer_clear(&builder.writer);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closed_form),
        cmocka_unit_test(description),
        cmocka_unit_test(monitor),
        cmocka_unit_test(host_in_place),
        cmocka_unit_test(without_library),
        cmocka_unit_test(host_fails),
        cmocka_unit_test(periods),
        cmocka_unit_test(shared_library),
        cmocka_unit_test(parameters_change),
        cmocka_unit_test(errors_are_counted),
        cmocka_unit_test(at_rest),
        cmocka_unit_test(parameters_refused),
        cmocka_unit_test(checkpoints),
        cmocka_unit_test(damaged),
        cmocka_unit_test(foreign_checkpoint),
        cmocka_unit_test(bad_changes),
        cmocka_unit_test(bad_libraries),
        cmocka_unit_test(changed_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
