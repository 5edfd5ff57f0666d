/* Checkpoints: a run that goes on from one gives what the uninterrupted run gives, bit for bit; files are
 * replaced in one go; what is damaged or belongs to something else is refused. */
#define _POSIX_C_SOURCE 200809L

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "archive.h"
#include "support.h"

enum { LINEAR = 0, HOLD = 1, PCHIP = 2, READER = 1, END_ERROR = 0, END_REPEAT = 2 };
enum { MOST_CHECKPOINTS = 64, MOST_ROWS = 2000, N_CHANNELS = 4 };

static double wind(int64_t k)
{
    return 8.0 + 2.0 * sin(0.13 * (double)k) + 0.7 * sin(1.9 * (double)k) + (k % 97 == 0 ? 0.5 : 0.0);
}

static int read_wind(void *context, int64_t first, int64_t count, double *time, double *value)
{
    const int64_t samples = *(const int64_t *)context;
    int delivered = 0;
    for (; delivered < count && first + delivered < samples; ++delivered) {
        value[delivered] = wind(first + delivered);
        if (time != NULL) {
            time[delivered] = 0.1 * (double)(first + delivered) + ((first + delivered) % 2 == 0 ? 0.0 : 0.02);
        }
    }
    return delivered;
}

/* A circuit on a series that is read in blocks of 16, a second one on held or repeated samples, a bouncing
 * ball, a sampled loop, and changes of parameters at 5.5 s. */
static gust_model *everything(int32_t interpolation, bool uniform)
{
    static system_builder builder;
    static double level[41];
    memset(&builder, 0, sizeof builder);
    builder.n_types = 3;
    builder.types[0] = (built_type){.kernel = "rc",
                                    .n_instances = 2,
                                    .instances = {{.name = "a", .parameters = {2.0, 0.25}},
                                                  {.name = "b", .parameters = {1.0, 0.5}, .first_input = 1}},
                                    .differential = {1, 0}};
    builder.types[1] =
        (built_type){.kernel = "ball",
                     .n_instances = 1,
                     .instances = {{.name = "ball", .parameters = {9.81, 1.0}, .start = {1.0, 0.0}}},
                     .differential = {1, 1},
                     .root_kind = {1},
                     .when_root = {0},
                     .when_period = {-1}};
    builder.types[2] =
        (built_type){.kernel = "sampled",
                     .n_instances = 1,
                     .instances = {{.name = "loop", .parameters = {1.0, 2.0, 0.1}, .start = {1.0}}},
                     .differential = {1},
                     .when_root = {-1},
                     .when_period = {2}};
    builder.n_inputs = 2;
    builder.n_schedule = 2;
    builder.schedule_time[0] = builder.schedule_time[1] = 5.5;
    builder.schedule_value[0] = 3.0; /* a resistance, and the sample period from 0.1 to 0.13 s */
    builder.schedule_value[1] = 0.13;
    const int32_t target[] = {0, 0, 0, 2, 0, 2};
    memcpy(builder.schedule_target, target, sizeof target);
    builder.n_channels = N_CHANNELS;
    const int32_t channel[] = {0, 0, 0, 1, 0, 1, 0, 4, 0, 0, 6, 0};
    memcpy(builder.channel, channel, sizeof channel);
    builder_inline_series(&builder, LINEAR, END_ERROR, 0, 0.0, 0.1, 12.0, NULL, (double[]){0.0}, 1);
    writer_i32(&builder.writer, "series.0.kind", (int32_t[]){interpolation, READER, END_ERROR, uniform ? 1 : 0},
               4);
    for (int k = 0; k < 41; ++k) {
        level[k] = wind(3 * k);
    }
    builder_inline_series(&builder, interpolation == PCHIP ? HOLD : LINEAR, END_REPEAT, 1, 0.0, 0.07, 2.8, NULL,
                          level, 41);
    return builder_model(&builder);
}

typedef struct run {
    gust_sim *sim;
    gust_stats *stats;
    int64_t samples;
    int64_t rows;
    double time[MOST_ROWS];
    float values[MOST_ROWS][N_CHANNELS];
} run;

static int keep(void *context, int64_t rows, const double *time, const float *values)
{
    run *to = context;
    for (int64_t r = 0; r < rows; ++r, ++to->rows) {
        assert_true(to->rows < MOST_ROWS);
        to->time[to->rows] = time[r];
        memcpy(to->values[to->rows], values + r * N_CHANNELS, sizeof to->values[0]);
    }
    return 0;
}

static void begin(run *made, const gust_model *model, double interval)
{
    const gust_stats_channel kept[] = {{.column = 0,
                                        .n_edges = 3,
                                        .edges = (double[]){0.0, 8.0, 10.0},
                                        .segment = 64,
                                        .n_exponents = 1,
                                        .exponents = (double[]){4.0}},
                                       {.column = 3}};
    memset(made, 0, sizeof *made);
    made->samples = 121;
    made->sim = new_sim(model, 1e-6);
    assert_int_equal(gust_stats_create(kept, 2, N_CHANNELS, 0.03, &made->stats, NULL, 0), GUST_OK);
    assert_int_equal(gust_sim_set_option(made->sim, "series_block", 16), GUST_OK);
    assert_int_equal(gust_sim_set_series_reader(made->sim, 0, read_wind, &made->samples), GUST_OK);
    assert_int_equal(gust_sim_set_sink(made->sim, interval, 16, keep, made), GUST_OK);
    assert_int_equal(gust_sim_set_statistics(made->sim, made->stats, 1.0), GUST_OK);
    initialise(made->sim, 0.0);
}

static void end(run *made)
{
    gust_sim_destroy(&made->sim);
    gust_stats_destroy(&made->stats);
}

static void take(run *made, unsigned char **bytes, size_t *size)
{
    const void *own = NULL;
    const gust_status status = gust_sim_checkpoint(made->sim, NULL);
    if (status != GUST_OK) {
        fail_msg("%s: %s", gust_status_name(status), gust_sim_message(made->sim));
    }
    assert_int_equal(gust_sim_checkpoint_bytes(made->sim, &own, size), GUST_OK);
    *bytes = malloc(*size);
    memcpy(*bytes, own, *size);
}

static void put(run *made, const unsigned char *bytes, size_t size)
{
    const gust_status status = gust_sim_restore_bytes(made->sim, bytes, size);
    if (status != GUST_OK) {
        fail_msg("%s: %s", gust_status_name(status), gust_sim_message(made->sim));
    }
}

/* Runs with checkpoints at these times, ascending; then again from each of them. Everything that the last
 * checkpoint holds (state, series, statistics, counters) and every row must be the same. */
static void same_bits(const gust_model *model, const double *at, int count)
{
    static run whole;
    static run part;
    unsigned char *bytes[MOST_CHECKPOINTS];
    size_t size[MOST_CHECKPOINTS];
    int64_t rows[MOST_CHECKPOINTS];
    begin(&whole, model, 0.05);
    for (int k = 0; k < count; ++k) {
        advance(whole.sim, at[k]);
        take(&whole, &bytes[k], &size[k]);
        rows[k] = whole.rows;
    }
    for (int from = 0; from < count - 1; ++from) {
        begin(&part, model, 0.05);
        if (from % 3 == 1) {
            advance(part.sim, 0.5 * at[from]); /* a simulation that has been somewhere else already */
            part.rows = 0;
        }
        put(&part, bytes[from], size[from]);
        assert_true(gust_sim_time(part.sim) == at[from]);
        gust_statistics statistics;
        gust_sim_statistics(part.sim, &statistics);
        assert_int_equal(statistics.rows, rows[from]);
        for (int k = from + 1; k < count; ++k) {
            unsigned char *again = NULL;
            size_t length = 0;
            advance(part.sim, at[k]);
            take(&part, &again, &length);
            assert_int_equal(length, size[k]);
            assert_memory_equal(again, bytes[k], length);
            free(again);
        }
        assert_int_equal(part.rows, whole.rows - rows[from]);
        assert_memory_equal(part.time, whole.time + rows[from], (size_t)part.rows * sizeof part.time[0]);
        assert_memory_equal(part.values, whole.values + rows[from], (size_t)part.rows * sizeof part.values[0]);
        end(&part);
    }
    for (int k = 0; k < count; ++k) {
        free(bytes[k]);
    }
    end(&whole);
}

static void any_time(void **state)
{
    (void)state;
    for (int which = 0; which < 4; ++which) {
        gust_model *model = everything(which % 2 == 0 ? LINEAR : PCHIP, which < 2);
        double at[MOST_CHECKPOINTS];
        int count = 0;
        for (double t = 0.0; t < 11.9; t += 0.4371 + 0.01 * which) {
            at[count++] = t;
        }
        same_bits(model, at, count);
        gust_model_destroy(&model);
    }
}

/* At the very times at which something happens: samples of the loop, changes, steps of the held series, the
 * jump back of the repeated one, and right beside them. */
static void at_events(void **state)
{
    (void)state;
    gust_model *model[2] = {everything(LINEAR, true), everything(PCHIP, false)};
    static const double MOMENTS[] = {0.1, 0.2, 0.30000000000000004, 1.0,  1.6,  1.5999999999, 2.8,  2.80000001,
                                     5.4, 5.5, 5.50000001,          5.63, 5.76, 8.4,          11.2, 11.9};
    for (int which = 0; which < 2; ++which) {
        double at[16];
        int count = 0;
        for (size_t k = 0; k < sizeof MOMENTS / sizeof MOMENTS[0]; ++k) {
            if (count == 0 || MOMENTS[k] > at[count - 1]) {
                at[count++] = MOMENTS[k];
            }
        }
        same_bits(model[which], at, count);
        gust_model_destroy(&model[which]);
    }
}

/* Where the integrator stopped at a bounce: the crossing has been found and not been handled yet. */
static void at_a_crossing(void **state)
{
    (void)state;
    gust_model *model = everything(LINEAR, true);
    static run first;
    double at[8] = {0.0};
    int count = 0;
    /* Bounces from 1 m: at sqrt(2 / g), and every 2 sqrt(2 / g) from then on. Ask for the time of the step that
     * ends there, to the last bit. */
    begin(&first, model, 0.05);
    gust_statistics before, after;
    const double half = sqrt(2.0 / 9.81);
    for (int bounce = 0; bounce < 3; ++bounce) {
        double low = half * (2 * bounce + 1) - 1e-4;
        double high = low + 2e-4;
        for (int k = 0; k < 60; ++k) {
            static run probe;
            const double middle = 0.5 * (low + high);
            begin(&probe, model, 0.05);
            advance(probe.sim, low);
            gust_sim_statistics(probe.sim, &before);
            advance(probe.sim, middle);
            /* an event is handled with the first step after it */
            gust_sim_statistics(probe.sim, &after);
            if (after.events > before.events) {
                high = middle;
            } else {
                low = middle;
            }
            end(&probe);
            if (k > 52 || low >= nextafter(high, 0.0)) {
                break;
            }
        }
        at[count++] = low;
    }
    end(&first);
    at[count++] = 4.0;
    same_bits(model, at, count);
    gust_model_destroy(&model);
}

/* -- files ---------------------------------------------------------------------------------------------- */

static const char *const FILE_NAME = GUSTFORM_TEST_KERNELS "/test.gustck";

static void file(void **state)
{
    (void)state;
    gust_model *model = everything(LINEAR, true);
    static run first;
    static run second;
    begin(&first, model, 0.05);
    advance(first.sim, 3.21);
    assert_int_equal(gust_sim_checkpoint(first.sim, FILE_NAME), GUST_OK);
    begin(&second, model, 0.05);
    assert_int_equal(gust_sim_restore(second.sim, FILE_NAME), GUST_OK);
    advance(first.sim, 9.0);
    advance(second.sim, 9.0);
    double y[2][7];
    unknowns(first.sim, y[0]);
    unknowns(second.sim, y[1]);
    assert_memory_equal(y[0], y[1], sizeof y[0]);
    /* a folder that is not there; a full disk: the old file stays, no other is left, the run goes on */
    assert_int_equal(gust_sim_checkpoint(first.sim, "/nonexistent/test.gustck"), GUST_CHECKPOINT_FAILED);
    assert_says(gust_sim_message(first.sim), "No such file");
    assert_int_equal(gust_sim_checkpoint(first.sim, "/dev/full/x"), GUST_CHECKPOINT_FAILED);
    struct stat facts;
    assert_int_equal(stat(GUSTFORM_TEST_KERNELS "/test.gustck.part", &facts), -1);
    advance(first.sim, 10.0);
    assert_int_equal(gust_sim_restore(second.sim, "/nonexistent/test.gustck"), GUST_CHECKPOINT_UNREADABLE);
    assert_int_equal(gust_sim_restore(second.sim, "/tmp"), GUST_CHECKPOINT_UNREADABLE);
    advance(second.sim, 10.0);
    end(&first);
    end(&second);
    gust_model_destroy(&model);
    unlink(FILE_NAME);
}

static void order(void **state)
{
    (void)state;
    gust_model *model = everything(LINEAR, true);
    gust_sim *sim = new_sim(model, 1e-6);
    const void *bytes = NULL;
    size_t size = 0;
    assert_int_equal(gust_sim_checkpoint(sim, NULL), GUST_BAD_ORDER);
    assert_int_equal(gust_sim_restore(sim, FILE_NAME), GUST_BAD_ORDER);
    assert_int_equal(gust_sim_checkpoint_bytes(sim, &bytes, &size), GUST_BAD_ORDER);
    assert_int_equal(gust_sim_checkpoint(NULL, NULL), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_sim_restore_bytes(sim, NULL, 0), GUST_BAD_ARGUMENT);
    gust_sim_destroy(&sim);
    static run done;
    begin(&done, model, 0.05);
    assert_int_equal(gust_sim_advance(done.sim, 50.0, NULL), GUST_END_OF_DATA);
    assert_int_equal(gust_sim_checkpoint(done.sim, NULL), GUST_BAD_ORDER);
    end(&done);
    gust_model_destroy(&model);
}

/* What belongs to something else is refused, and says what is different; the simulation stays as it was. */
static void foreign(void **state)
{
    (void)state;
    gust_model *model = everything(LINEAR, true);
    gust_model *other = everything(PCHIP, true);
    static run first;
    static run second;
    unsigned char *bytes = NULL;
    size_t size = 0;
    begin(&first, model, 0.05);
    advance(first.sim, 2.0);
    take(&first, &bytes, &size);
    begin(&second, other, 0.05);
    assert_int_equal(gust_sim_restore_bytes(second.sim, bytes, size), GUST_FOREIGN_CHECKPOINT);
    assert_says(gust_sim_message(second.sim), "another model");
    end(&second);
    begin(&second, model, 0.1);
    assert_int_equal(gust_sim_restore_bytes(second.sim, bytes, size), GUST_FOREIGN_CHECKPOINT);
    assert_says(gust_sim_message(second.sim), "rows.interval");
    advance(second.sim, 1.0);
    end(&second);
    gust_sim *sim = new_sim(model, 1e-7);
    gust_sim_set_series_reader(sim, 0, read_wind, &first.samples);
    initialise(sim, 0.0);
    assert_int_equal(gust_sim_restore_bytes(sim, bytes, size), GUST_FOREIGN_CHECKPOINT);
    assert_says(gust_sim_message(sim), "\"rtol\"");
    advance(sim, 1.0);
    gust_sim_destroy(&sim);
    end(&first);
    free(bytes);
    gust_model_destroy(&model);
    gust_model_destroy(&other);
}

static void damaged(void **state)
{
    (void)state;
    gust_model *model = everything(LINEAR, false);
    static run first;
    unsigned char *sound = NULL;
    size_t size = 0;
    begin(&first, model, 0.05);
    advance(first.sim, 6.0);
    take(&first, &sound, &size);
    unsigned char *bytes = malloc(size + 1);
    /* cut off anywhere, or added to */
    for (size_t length = 0; length <= size + 1; length += length < 200 || length > size - 2 ? 1 : 37) {
        memcpy(bytes, sound, size);
        bytes[size] = 0;
        const gust_status status = gust_sim_restore_bytes(first.sim, bytes, length);
        assert_int_equal(status, length == size ? GUST_OK : GUST_BAD_CHECKPOINT);
    }
    /* any single byte spoilt */
    for (size_t k = 0; k < size; k += k < 300 ? 1 : 11) {
        memcpy(bytes, sound, size);
        bytes[k] ^= (unsigned char)(1 + k % 255);
        assert_int_equal(gust_sim_restore_bytes(first.sim, bytes, size), GUST_BAD_CHECKPOINT);
    }
    advance(first.sim, 7.0); /* none of them did any harm */
    end(&first);
    /* forged, checksum and all: nonsense may come out of it, nothing is written outside */
    uint64_t identity = 0;
    memcpy(&identity, sound + 24, sizeof identity);
    srand(7);
    for (int k = 0; k < 1500; ++k) {
        static run victim;
        memcpy(bytes, sound, size);
        for (int i = 0; i <= k % 3; ++i) {
            bytes[GUST_ARCHIVE_HEADER + (size_t)rand() % (size - GUST_ARCHIVE_HEADER)] = (unsigned char)rand();
        }
        gust_archive archive = {.bytes = bytes, .at = size};
        gust_archive_seal(&archive, "GUSTCKP1", identity);
        begin(&victim, model, 0.05);
        if (gust_sim_restore_bytes(victim.sim, bytes, size) == GUST_OK) {
            victim.rows = 0;
            const double now = gust_sim_time(victim.sim);
            gust_sim_advance(victim.sim, fmin(now + 0.2, 1e9), NULL);
        }
        end(&victim);
    }
    free(sound);
    free(bytes);
    gust_model_destroy(&model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(any_time),      cmocka_unit_test(at_events),
                                       cmocka_unit_test(at_a_crossing), cmocka_unit_test(file),
                                       cmocka_unit_test(order),         cmocka_unit_test(foreign),
                                       cmocka_unit_test(damaged)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
