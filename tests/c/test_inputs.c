#define _POSIX_C_SOURCE 200809L

/* Time series: every kind, source and end, against what they must give. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "support.h"

static const double PRECISE = 1e-8;
static const double CLOSE = 1e-5;

enum { LINEAR = 0, HOLD = 1, PCHIP = 2 };
enum { INLINE = 0, READER = 1, FROM_FILE = 2 };
enum { END_ERROR = 0, END_HOLD = 1, END_REPEAT = 2 };

/* RC circuit, time constant 0.5 s, with its source voltage as channel-less input 0. */
static void rc(system_builder *builder)
{
    memset(builder, 0, sizeof *builder);
    builder->n_types = 1;
    builder->types[0] = (built_type){.kernel = "rc",
                                     .n_instances = 1,
                                     .instances = {{.name = "circuit", .parameters = {2.0, 0.25}}},
                                     .differential = {1, 0}};
    builder->n_inputs = 1;
}

/* The voltage now, from the algebraic equation: u = v + R i. */
static double source(gust_sim *sim)
{
    double y[2];
    unknowns(sim, y);
    return y[0] + 2.0 * y[1];
}

static double capacitor(gust_sim *sim)
{
    double y[2];
    unknowns(sim, y);
    return y[0];
}

/* v' = (t - v) / 0.5 from v = 0. */
static double ramp_response(double t)
{
    return t - 0.5 * (1.0 - exp(-t / 0.5));
}

static void linear_uniform(void **state)
{
    (void)state;
    static system_builder builder;
    rc(&builder);
    double value[101];
    for (int k = 0; k < 101; ++k) {
        value[k] = 0.1 * k;
    }
    builder_inline_series(&builder, LINEAR, END_ERROR, 0, 0.0, 0.1, 10.0, NULL, value, 101);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    for (int k = 1; k <= 40; ++k) {
        const double t = 0.25 * k;
        advance(sim, t);
        assert_close(source(sim), t, CLOSE, "source");
        assert_close(capacitor(sim), ramp_response(t), CLOSE, "voltage");
    }
    gust_statistics statistics;
    gust_sim_statistics(sim, &statistics);
    assert_int_equal(statistics.restarts, 0); /* samples are no events */
    /* no more data: stopped for a stated reason, again and again */
    double reached = 0.0;
    assert_int_equal(gust_sim_advance(sim, 11.0, &reached), GUST_END_OF_DATA);
    assert_close(reached, 10.0, 1e-12, "time reached");
    assert_says(gust_sim_message(sim), "\"wind\" ends at 10 s");
    assert_int_equal(gust_sim_advance(sim, 12.0, &reached), GUST_END_OF_DATA);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void linear_stamped(void **state)
{
    (void)state;
    static system_builder builder;
    rc(&builder);
    const double time[] = {0.0, 0.3, 0.35, 2.0, 2.5, 6.0};
    builder_inline_series(&builder, LINEAR, END_HOLD, 0, 0.0, 0.0, 6.0, time, time, 6);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    for (int k = 1; k <= 24; ++k) {
        const double t = 0.25 * k;
        advance(sim, t);
        assert_close(source(sim), t, CLOSE, "source");
        assert_close(capacitor(sim), ramp_response(t), CLOSE, "voltage");
    }
    advance(sim, 16.0);
    assert_close(source(sim), 6.0, CLOSE, "source held at the end");
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* A staircase of 1 V every second. v(t) after step n: superposition of exponentials. */
static double staircase_response(double t)
{
    double v = 0.0;
    for (int k = 1; k <= (int)t; ++k) {
        v += 1.0 - exp(-(t - k) / 0.5);
    }
    return v;
}

static void hold(void **state)
{
    (void)state;
    static system_builder builder;
    rc(&builder);
    /* two samples for each stair: equal neighbours are no events */
    const double value[] = {0, 0, 1, 1, 2, 2, 3, 3, 4, 4};
    builder_inline_series(&builder, HOLD, END_ERROR, 0, 0.0, 0.5, 5.0, NULL, value, 10);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    static record rows;
    initialise(sim, 0.0);
    for (int k = 1; k <= 9; ++k) {
        const double t = 0.5 * k + 0.1;
        advance(sim, t);
        assert_close(source(sim), floor(t), 1e-12, "source");
        assert_close(capacitor(sim), staircase_response(t), CLOSE, "voltage");
    }
    gust_statistics statistics;
    gust_sim_statistics(sim, &statistics);
    assert_int_equal(statistics.restarts, 4);
    advance(sim, 5.0);
    assert_int_equal(gust_sim_advance(sim, 5.5, NULL), GUST_END_OF_DATA);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
    (void)rows;
}

/* A sawtooth: 0 ... 1 V in a second, then back at once. */
static void repeat(void **state)
{
    (void)state;
    static system_builder builder;
    rc(&builder);
    const double value[] = {0.0, 0.5, 1.0};
    builder_inline_series(&builder, LINEAR, END_REPEAT, 0, 0.0, 0.5, 1.0, NULL, value, 3);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    double v = 0.0;
    for (int k = 0; k < 50; ++k) {
        advance(sim, k + 0.25);
        assert_close(source(sim), 0.25, CLOSE, "source");
        /* from v at the start of the tooth: v' = (s - v) / 0.5 */
        assert_close(capacitor(sim), ramp_response(0.25) + v * exp(-0.25 / 0.5), CLOSE, "voltage");
        v = ramp_response(1.0) + v * exp(-1.0 / 0.5);
    }
    gust_statistics statistics;
    gust_sim_statistics(sim, &statistics);
    assert_int_equal(statistics.restarts, 49);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);

    /* a start far into the repetitions */
    rc(&builder);
    builder_inline_series(&builder, LINEAR, END_REPEAT, 0, 0.0, 0.5, 1.0, NULL, value, 3);
    model = builder_model(&builder);
    sim = new_sim(model, PRECISE);
    initialise(sim, 1000.25);
    assert_close(source(sim), 0.25, 1e-9, "source");
    advance(sim, 1000.75);
    assert_close(source(sim), 0.75, CLOSE, "source");
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

typedef struct ramp_reader {
    int64_t samples; /* how many there are */
    int64_t calls;
    int64_t largest; /* number of the largest sample delivered */
    bool fails;
    bool spoilt; /* delivers a NaN at sample 50 */
} ramp_reader;

/* Value = time, a sample every 0.1 s. */
static int read_ramp(void *context, int64_t first, int64_t count, double *time, double *value)
{
    ramp_reader *reader = context;
    ++reader->calls;
    if (reader->fails) {
        return -1;
    }
    int delivered = 0;
    for (; delivered < count && first + delivered < reader->samples; ++delivered) {
        const int64_t k = first + delivered;
        value[delivered] = reader->spoilt && k == 50 ? NAN : 0.1 * (double)k;
        if (time != NULL) {
            time[delivered] = 0.1 * (double)k;
        }
        reader->largest = k > reader->largest ? k : reader->largest;
    }
    return delivered;
}

static void sourced_series(system_builder *builder, int32_t source_kind, int32_t on_end, bool uniform,
                           double t_end, const char *path)
{
    builder_inline_series(builder, LINEAR, on_end, 0, 0.0, 0.1, t_end, NULL, (double[]){0.0}, 1);
    const int32_t kind[] = {LINEAR, source_kind, on_end, uniform ? 1 : 0};
    writer_i32(&builder->writer, "series.0.kind", kind, 4);
    writer_remove(&builder->writer, "series.0.value");
    if (path != NULL) {
        writer_text(&builder->writer, "series.0.path", path);
    }
}

static void reader(void **state)
{
    (void)state;
    for (int uniform = 0; uniform <= 1; ++uniform) {
        static system_builder builder;
        rc(&builder);
        sourced_series(&builder, READER, END_ERROR, uniform == 1, INFINITY, NULL);
        gust_model *model = builder_model(&builder);
        gust_sim *sim = new_sim(model, 1e-6);
        ramp_reader from = {.samples = 2001};
        assert_int_equal(gust_sim_set_option(sim, "series_block", 32), GUST_OK);
        assert_int_equal(gust_sim_set_series_reader(sim, 0, read_ramp, &from), GUST_OK);
        initialise(sim, 0.0);
        for (int k = 1; k <= 19; ++k) {
            const double t = 10.0 * k + 0.37;
            advance(sim, t);
            assert_close(source(sim), t, 1e-4, "source");
            assert_close(capacitor(sim), t - 0.5, 1e-4, "voltage");
        }
        /* its end is only found on the way */
        double reached = 0.0;
        assert_int_equal(gust_sim_advance(sim, 300.0, &reached), GUST_END_OF_DATA);
        assert_close(reached, 200.0, 1e-12, "time reached");
        assert_close(source(sim), 200.0, 1e-4, "source at the end");
        assert_true(from.calls < 300); /* windows are kept, not read for each look-up */
        gust_sim_destroy(&sim);
        gust_model_destroy(&model);
    }
}

static void reader_fails(void **state)
{
    (void)state;
    static system_builder builder;
    rc(&builder);
    sourced_series(&builder, READER, END_ERROR, true, INFINITY, NULL);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, 1e-6);
    assert_int_equal(gust_sim_initialise(sim, 0.0), GUST_SERIES_UNREADABLE);
    assert_says(gust_sim_message(sim), "has no reader");
    gust_sim_destroy(&sim);

    sim = new_sim(model, 1e-6);
    ramp_reader from = {.samples = 0};
    gust_sim_set_series_reader(sim, 0, read_ramp, &from);
    assert_int_equal(gust_sim_initialise(sim, 0.0), GUST_BAD_SERIES);
    assert_says(gust_sim_message(sim), "empty");
    gust_sim_destroy(&sim);

    sim = new_sim(model, 1e-6);
    from = (ramp_reader){.samples = 1000, .spoilt = true};
    gust_sim_set_option(sim, "series_block", 16);
    gust_sim_set_series_reader(sim, 0, read_ramp, &from);
    initialise(sim, 0.0);
    double reached = 0.0;
    assert_int_equal(gust_sim_advance(sim, 90.0, &reached), GUST_BAD_SERIES);
    assert_says(gust_sim_message(sim), "sample 50");
    assert_true(reached > 1.0 && reached < 5.0);
    gust_sim_destroy(&sim);

    sim = new_sim(model, 1e-6);
    from = (ramp_reader){.samples = 1000};
    gust_sim_set_option(sim, "series_block", 16);
    gust_sim_set_series_reader(sim, 0, read_ramp, &from);
    initialise(sim, 0.0);
    from.fails = true;
    assert_int_equal(gust_sim_advance(sim, 90.0, &reached), GUST_SERIES_UNREADABLE);
    assert_says(gust_sim_message(sim), "reader failed");
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void write_file(char *path, bool uniform, int samples, size_t extra)
{
    strcpy(path, "/tmp/gust_series_XXXXXX");
    const int handle = mkstemp(path);
    assert_true(handle >= 0);
    for (int k = 0; k < samples; ++k) {
        const double pair[] = {0.1 * k, 0.1 * k};
        const size_t size = uniform ? sizeof pair[0] : sizeof pair;
        assert_int_equal(write(handle, pair, size), size);
    }
    assert_int_equal(write(handle, "xxxxxxx", extra), extra);
    close(handle);
}

static void file(void **state)
{
    (void)state;
    for (int uniform = 0; uniform <= 1; ++uniform) {
        static system_builder builder;
        char path[64];
        write_file(path, uniform == 1, 1001, 0);
        rc(&builder);
        sourced_series(&builder, FROM_FILE, END_ERROR, uniform == 1, INFINITY, path);
        gust_model *model = builder_model(&builder);
        gust_sim *sim = new_sim(model, 1e-6);
        gust_sim_set_option(sim, "series_block", 16);
        initialise(sim, 0.0);
        for (int k = 1; k <= 9; ++k) {
            advance(sim, 10.0 * k + 0.37);
            assert_close(source(sim), 10.0 * k + 0.37, 1e-4, "source");
        }
        assert_int_equal(gust_sim_advance(sim, 300.0, NULL), GUST_END_OF_DATA);
        assert_close(gust_sim_time(sim), 100.0, 1e-12, "time reached");
        /* back to the beginning, as a look from outside may ask */
        double y[2] = {0.0, 0.0}, yp[2] = {0.0, 0.0}, residual[2];
        assert_int_equal(gust_sim_residual(sim, 1.23, y, yp, residual), GUST_OK);
        assert_close(residual[1], -1.23 / 2.0, 1e-9, "residual at an earlier time");
        gust_sim_destroy(&sim);

        /* the file goes away while nobody looks */
        sim = new_sim(model, 1e-6);
        gust_sim_set_option(sim, "series_block", 16);
        initialise(sim, 0.0);
        unlink(path);
        assert_int_equal(gust_sim_advance(sim, 90.0, NULL), GUST_SERIES_UNREADABLE);
        assert_says(gust_sim_message(sim), path);
        gust_sim_destroy(&sim);
        gust_model_destroy(&model);
    }
}

static void file_fails(void **state)
{
    (void)state;
    static system_builder builder;
    char path[64];
    for (int which = 0; which < 3; ++which) {
        if (which == 0) {
            strcpy(path, "/nonexistent/series.bin");
        } else {
            write_file(path, true, which == 1 ? 0 : 10, which == 1 ? 0 : 3);
        }
        rc(&builder);
        sourced_series(&builder, FROM_FILE, END_ERROR, true, INFINITY, path);
        gust_model *model = builder_model(&builder);
        gust_sim *sim = new_sim(model, 1e-6);
        assert_int_equal(gust_sim_initialise(sim, 0.0), which == 0 ? GUST_SERIES_UNREADABLE : GUST_BAD_SERIES);
        assert_says(gust_sim_message(sim), path);
        gust_sim_destroy(&sim);
        gust_model_destroy(&model);
        unlink(path);
    }
}

static void begins_too_late(void **state)
{
    (void)state;
    static system_builder builder;
    rc(&builder);
    const double value[] = {0.0, 1.0};
    builder_inline_series(&builder, LINEAR, END_HOLD, 0, 5.0, 1.0, 6.0, NULL, value, 2);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, 1e-6);
    assert_int_equal(gust_sim_initialise(sim, 4.0), GUST_SERIES_NOT_COVERING);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* The same run in one piece and in many pieces gives the same steps and the same values. */
static void pieces(void **state)
{
    (void)state;
    static system_builder builder;
    double value[201];
    for (int k = 0; k < 201; ++k) {
        value[k] = sin(0.37 * k) + 0.3 * sin(1.9 * k);
    }
    double y[2][2];
    gust_statistics statistics[2];
    for (int run = 0; run < 2; ++run) {
        rc(&builder);
        builder_inline_series(&builder, LINEAR, END_ERROR, 0, 0.0, 0.1, 20.0, NULL, value, 201);
        gust_model *model = builder_model(&builder);
        gust_sim *sim = new_sim(model, 1e-6);
        initialise(sim, 0.0);
        for (int k = 1; run == 1 && k < 1000; ++k) {
            advance(sim, 20.0 / 1000.0 * k);
        }
        advance(sim, 20.0);
        unknowns(sim, y[run]);
        gust_sim_statistics(sim, &statistics[run]);
        gust_sim_destroy(&sim);
        gust_model_destroy(&model);
    }
    assert_true(y[0][0] == y[1][0] && y[0][1] == y[1][1]);
    assert_int_equal(statistics[0].steps, statistics[1].steps);
}

/* -- PCHIP ---------------------------------------------------------------------------------------------- */

/* Samples that turn, run level and rise in every combination; uneven stamps. */
static double bumpy_value(int64_t k)
{
    static const double CYCLE[] = {0.0, 1.0, 1.0, 4.0, 5.0, 2.0, 2.0, 2.0, -3.0, -1.0, -6.0, -6.5, 7.0};
    return CYCLE[k % 13] + 0.01 * (double)(k % 7);
}

static double bumpy_time(int64_t k)
{
    return 0.1 * (double)k + 0.03 * (double)(k % 3);
}

static int read_bumpy(void *context, int64_t first, int64_t count, double *time, double *value)
{
    const int64_t samples = *(const int64_t *)context;
    int delivered = 0;
    for (; delivered < count && first + delivered < samples; ++delivered) {
        value[delivered] = bumpy_value(first + delivered);
        if (time != NULL) {
            time[delivered] = bumpy_time(first + delivered);
        }
    }
    return delivered;
}

/* The source voltage at any time, from the residual of a circuit at rest: -u / R. */
static double source_at(gust_sim *sim, double t)
{
    const double y[2] = {0.0, 0.0}, yp[2] = {0.0, 0.0};
    double residual[2];
    assert_int_equal(gust_sim_residual(sim, t, y, yp, residual), GUST_OK);
    return -2.0 * residual[1];
}

/* In blocks the same numbers come out as from all samples at once, bit for bit, forwards, backwards and at
 * the borders of blocks; n is such that the last block is cut anywhere. */
static void pchip_blocks(void **state)
{
    (void)state;
    static double time[200];
    static double value[200];
    for (int64_t k = 0; k < 200; ++k) {
        time[k] = bumpy_time(k);
        value[k] = bumpy_value(k);
    }
    for (int uniform = 0; uniform <= 1; ++uniform) {
        for (int64_t n = 1; n < 200; n += n < 40 ? 1 : 17) {
            static system_builder builder;
            gust_model *model[2];
            gust_sim *sim[2];
            for (int blocks = 0; blocks <= 1; ++blocks) {
                rc(&builder);
                if (blocks == 0) {
                    builder_inline_series(&builder, PCHIP, END_HOLD, 0, 0.0, 0.1, 1e9,
                                          uniform == 1 ? NULL : time, value, (size_t)n);
                } else {
                    sourced_series(&builder, READER, END_HOLD, uniform == 1, INFINITY, NULL);
                    writer_i32(&builder.writer, "series.0.kind",
                               (int32_t[]){PCHIP, READER, END_HOLD, uniform == 1 ? 1 : 0}, 4);
                }
                model[blocks] = builder_model(&builder);
                sim[blocks] = new_sim(model[blocks], 1e-6);
            }
            gust_sim_set_option(sim[1], "series_block", 16);
            gust_sim_set_series_reader(sim[1], 0, read_bumpy, &n);
            initialise(sim[0], 0.0);
            initialise(sim[1], 0.0);
            for (int turn = 0; turn < 2; ++turn) {
                for (int k = 0; k < 700; ++k) {
                    const double t = (turn == 0 ? k : 700 - k) * 0.1 * ((double)n + 3.0) / 700.0;
                    assert_true(source_at(sim[0], t) == source_at(sim[1], t));
                }
                for (int64_t k = 0; k < n; ++k) {
                    const double t = uniform == 1 ? 0.1 * (double)k : time[k];
                    assert_close(source_at(sim[1], t), value[k], 1e-12, "sample");
                }
            }
            for (int blocks = 0; blocks <= 1; ++blocks) {
                gust_sim_destroy(&sim[blocks]);
                gust_model_destroy(&model[blocks]);
            }
        }
    }
}

/* Between two samples the curve stays between them; where they are level it is level. */
static void pchip_shape(void **state)
{
    (void)state;
    static system_builder builder;
    double value[40];
    for (int k = 0; k < 40; ++k) {
        value[k] = bumpy_value(k);
    }
    rc(&builder);
    builder_inline_series(&builder, PCHIP, END_ERROR, 0, 0.0, 1.0, 39.0, NULL, value, 40);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, 1e-6);
    initialise(sim, 0.0);
    for (int k = 0; k < 39; ++k) {
        double before = value[k];
        for (int i = 1; i < 20; ++i) {
            const double now = source_at(sim, k + 0.05 * i);
            const double rise = value[k + 1] - value[k];
            assert_true((now - before) * rise >= -1e-12);
            assert_true(rise != 0.0 || fabs(now - before) < 1e-12);
            before = now;
        }
    }
    /* and it is run through without an event */
    advance(sim, 39.0);
    gust_statistics statistics;
    gust_sim_statistics(sim, &statistics);
    assert_int_equal(statistics.events, 0);
    assert_int_equal(gust_sim_advance(sim, 40.0, NULL), GUST_END_OF_DATA);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* -- gusts after a calm --------------------------------------------------------------------------------- */

enum { CALM_SAMPLES = 72001 };

/* An hour of constant 10 V at 20 Hz with one gust of 5 V that lasts 2 s, 1 - cos. */
static double calm_value(int64_t k)
{
    const double t = 0.05 * (double)k - 2000.3;
    return t > 0.0 && t < 2.0 ? 10.0 + 2.5 * (1.0 - cos(3.14159265358979 * t)) : 10.0;
}

static int read_calm(void *context, int64_t first, int64_t count, double *time, double *value)
{
    (void)context;
    int delivered = 0;
    for (; delivered < count && first + delivered < CALM_SAMPLES; ++delivered) {
        value[delivered] = calm_value(first + delivered);
        if (time != NULL) {
            time[delivered] = 0.05 * (double)(first + delivered);
        }
    }
    return delivered;
}

static int highest(void *context, int64_t rows, const double *time, const float *values)
{
    double *most = context;
    for (int64_t r = 0; r < rows; ++r) {
        *most = time[r] > 100.0 ? fmax(*most, (double)values[r]) : *most;
    }
    return 0;
}

/* Highest voltage of the capacitor in the hour. */
static double highest_voltage(int32_t interpolation, bool uniform, double tolerance,
                              gust_statistics *statistics)
{
    static system_builder builder;
    rc(&builder);
    builder.n_channels = 1;
    const int32_t kind[] = {interpolation, READER, END_ERROR, uniform ? 1 : 0};
    sourced_series(&builder, READER, END_ERROR, uniform, INFINITY, NULL);
    writer_i32(&builder.writer, "series.0.kind", kind, 4);
    writer_f64(&builder.writer, "series.0.timing", (double[]){0.0, 0.05, 3600.0}, 3);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, 1e-6);
    double most = 0.0;
    gust_sim_set_series_reader(sim, 0, read_calm, NULL);
    gust_sim_set_sink(sim, 0.05, 1024, highest, &most);
    gust_sim_set_option(sim, "series_tolerance", tolerance);
    initialise(sim, 0.0);
    advance(sim, 3600.0);
    gust_sim_statistics(sim, statistics);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
    return most;
}

static void gust_after_calm(void **state)
{
    (void)state;
    /* v' = (u - v) / T with u straight between samples, sample by sample */
    double expected = 10.0;
    double v = 10.0;
    for (int64_t k = 40000; k < 40060; ++k) {
        const double slope = (calm_value(k + 1) - calm_value(k)) / 0.05;
        const double base = calm_value(k) - 0.5 * slope;
        v = base + 0.05 * slope + (v - base) * exp(-0.05 / 0.5);
        expected = fmax(expected, v);
    }
    assert_true(expected > 13.7);
    gust_statistics statistics;
    /* without looking ahead nothing happens in this hour: the reason for looking */
    assert_true(highest_voltage(LINEAR, true, 0.0, &statistics) < 10.01);
    for (int uniform = 0; uniform <= 1; ++uniform) {
        for (int32_t interpolation = LINEAR; interpolation <= PCHIP; interpolation += PCHIP) {
            /* rows are read from within steps, where the error is some 100 rtol at the kinks of the samples */
            assert_close(highest_voltage(interpolation, uniform == 1, 1e-3, &statistics), expected, 5e-4,
                         "voltage in the gust");
            assert_true(statistics.steps < CALM_SAMPLES / 50);
            assert_true(statistics.cut_steps > 0 && statistics.restarts <= 3 && statistics.events == 0);
        }
    }
}

/* The smallest gust: one sample. Many tolerances; nothing is missed that is larger. */
static void gust_of_one_sample(void **state)
{
    (void)state;
    static double value[4001];
    for (int which = 0; which < 20; ++which) {
        static system_builder builder;
        const int at = 3000 + 7 * which;
        for (int k = 0; k < 4001; ++k) {
            value[k] = k == at ? 12.0 : 10.0;
        }
        rc(&builder);
        builder_inline_series(&builder, LINEAR, END_ERROR, 0, 0.0, 1.0, 4000.0, NULL, value, 4001);
        gust_model *model = builder_model(&builder);
        gust_sim *sim = new_sim(model, 1e-6);
        initialise(sim, 0.0);
        advance(sim, at);
        /* v' = (u - v) / T on a ramp of 2 V/s from rest: 2 (t - T (1 - exp(-t / T))) */
        assert_close(capacitor(sim), 10.0 + 2.0 * (1.0 - 0.5 * (1.0 - exp(-2.0))), 1e-5, "voltage");
        gust_sim_destroy(&sim);
        gust_model_destroy(&model);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(linear_uniform),
                                       cmocka_unit_test(linear_stamped),
                                       cmocka_unit_test(hold),
                                       cmocka_unit_test(repeat),
                                       cmocka_unit_test(reader),
                                       cmocka_unit_test(reader_fails),
                                       cmocka_unit_test(file),
                                       cmocka_unit_test(file_fails),
                                       cmocka_unit_test(begins_too_late),
                                       cmocka_unit_test(pieces),
                                       cmocka_unit_test(pchip_blocks),
                                       cmocka_unit_test(pchip_shape),
                                       cmocka_unit_test(gust_after_calm),
                                       cmocka_unit_test(gust_of_one_sample)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
