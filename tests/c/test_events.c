/* When-clauses, samples, scheduled changes, and what happens if they go wrong. */
#include <math.h>
#include <string.h>

#include "support.h"

static const double PRECISE = 1e-8;
static const double CLOSE = 1e-5;

static void ball(system_builder *builder, double height, double speed)
{
    memset(builder, 0, sizeof *builder);
    builder->n_types = 1;
    builder->types[0] =
        (built_type){.kernel = "ball",
                     .n_instances = 1,
                     .instances = {{.name = "ball", .parameters = {9.81, 0.8}, .start = {height, speed}}},
                     .differential = {1, 1},
                     .root_kind = {1},
                     .when_root = {0},
                     .when_period = {-1}};
    builder->n_channels = 3;
    const int32_t channel[] = {0, 0, 0, 1, 0, 0, 1, 0, 1};
    memcpy(builder->channel, channel, sizeof channel);
}

static void bouncing(void **state)
{
    (void)state;
    static system_builder builder;
    ball(&builder, 1.0, 0.0);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    const double g = 9.81, e = 0.8;
    double begin = sqrt(2.0 / g); /* first contact */
    double speed = e * g * begin; /* after it */
    double y[2], row[3];
    for (int bounce = 1; bounce <= 8; ++bounce) {
        const double flight = 2.0 * speed / g;
        advance(sim, begin + 0.3 * flight);
        unknowns(sim, y);
        const double s = 0.3 * flight;
        assert_close(y[0], speed * s - 0.5 * g * s * s, CLOSE, "height");
        assert_close(y[1], speed - g * s, CLOSE, "speed");
        assert_int_equal(gust_sim_channels(sim, row), GUST_OK);
        assert_true(row[2] == bounce);
        begin += flight;
        speed *= e;
    }
    gust_statistics statistics;
    gust_sim_statistics(sim, &statistics);
    assert_int_equal(statistics.events, 8);
    assert_int_equal(statistics.restarts, 8);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* Bounces come ever faster: the run must end with a word about it, not hang. */
static void zeno(void **state)
{
    (void)state;
    static system_builder builder;
    ball(&builder, 1.0, 0.0);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, 1e-6);
    initialise(sim, 0.0);
    double reached = 0.0;
    const gust_status status = gust_sim_advance(sim, 10.0, &reached);
    assert_true(status == GUST_CHATTERING || status == GUST_OK); /* OK: it fell through below the tolerance */
    assert_true(reached > 3.9);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* Below the floor already, and moving down: the condition is true at the start and must not fire. */
static void true_at_start(void **state)
{
    (void)state;
    static system_builder builder;
    ball(&builder, -1.0, -1.0);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    advance(sim, 1.0);
    double row[3];
    gust_sim_channels(sim, row);
    assert_true(row[2] == 0.0);
    assert_close(row[1], -1.0 - 9.81, CLOSE, "speed");
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void relay(system_builder *builder, double upper, double lower, double jump)
{
    memset(builder, 0, sizeof *builder);
    builder->n_types = 1;
    builder->types[0] = (built_type){.kernel = "relay",
                                     .n_instances = 1,
                                     .instances = {{.name = "relay",
                                                    .parameters = {upper, -1.0, lower, 1.0, jump},
                                                    .discrete = {1.0, 0.0, 0.0},
                                                    .start = {0.5}}},
                                     .differential = {1},
                                     .root_kind = {1, 1},
                                     .when_root = {0, 1},
                                     .when_period = {-1, -1}};
    builder->n_channels = 4;
    const int32_t channel[] = {0, 0, 0, 1, 0, 0, 1, 0, 1, 1, 0, 2};
    memcpy(builder->channel, channel, sizeof channel);
}

/* Thresholds 1 and 0: x is a triangle that starts at 0.5 upwards and turns every second. */
static void triangle(void **state)
{
    (void)state;
    static system_builder builder;
    relay(&builder, 1.0, 0.0, 0.0);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    double row[4];
    for (int k = 1; k <= 20; ++k) {
        advance(sim, (double)k); /* half way between two turns */
        gust_sim_channels(sim, row);
        assert_close(row[0], 0.5, CLOSE, "x");
        assert_true(row[1] == (k % 2 == 1 ? -1.0 : 1.0));
        assert_true(row[2] + row[3] == k);
    }
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void chattering(void **state)
{
    (void)state;
    static system_builder builder;
    relay(&builder, 1.0, 1.0, 0.0);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    double reached = 0.0;
    assert_int_equal(gust_sim_advance(sim, 10.0, &reached), GUST_CHATTERING);
    assert_close(reached, 0.5, CLOSE, "time");
    assert_says(gust_sim_message(sim), "relay.root");
    /* ended for good */
    assert_int_equal(gust_sim_advance(sim, 20.0, &reached), GUST_CHATTERING);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void endless(void **state)
{
    (void)state;
    static system_builder builder;
    relay(&builder, 1.0, 0.0, 1.0);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    assert_int_equal(gust_sim_advance(sim, 10.0, NULL), GUST_EVENT_ITERATION);
    assert_says(gust_sim_message(sim), "relay.when");
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void sampled(system_builder *builder, double period)
{
    memset(builder, 0, sizeof *builder);
    builder->n_types = 1;
    builder->types[0] =
        (built_type){.kernel = "sampled",
                     .n_instances = 1,
                     .instances = {{.name = "loop", .parameters = {1.0, 2.0, period}, .start = {1.0}}},
                     .differential = {1},
                     .when_root = {-1},
                     .when_period = {2}};
    builder->n_channels = 3;
    const int32_t channel[] = {0, 0, 0, 1, 0, 0, 1, 0, 1};
    memcpy(builder->channel, channel, sizeof channel);
}

/* x(k + 1) = x(k) (exp(-a T) - k (1 - exp(-a T)) / a), a = 1, k = 2, T = 0.1; the first sample is at the start.
 */
static void sampling(void **state)
{
    (void)state;
    static system_builder builder;
    sampled(&builder, 0.1);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    double x = 1.0, row[3];
    const double decay = exp(-0.1);
    for (int k = 0; k < 30; ++k) {
        advance(sim, 0.1 * k + 0.05);
        gust_sim_channels(sim, row);
        assert_true(row[2] == k + 1);
        assert_close(row[1], -2.0 * x, CLOSE, "controller");
        assert_close(row[0], x * exp(-0.05) - 2.0 * x * (1.0 - exp(-0.05)), CLOSE, "plant");
        x *= decay - 2.0 * (1.0 - decay);
    }
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* A million samples: none may be lost or doubled by rounding. */
static void many_samples(void **state)
{
    (void)state;
    static system_builder builder;
    sampled(&builder, 1e-3);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, 1e-4);
    initialise(sim, 0.0);
    advance(sim, 50.0005);
    double row[3];
    gust_sim_channels(sim, row);
    assert_true(row[2] == 50001.0);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void period_changes(void **state)
{
    (void)state;
    static system_builder builder;
    sampled(&builder, 1.0);
    builder.n_schedule = 1;
    builder.schedule_time[0] = 2.5;
    builder.schedule_target[2] = 2;
    builder.schedule_value[0] = 0.25;
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    double row[3];
    advance(sim, 2.4);
    gust_sim_channels(sim, row);
    assert_true(row[2] == 3.0); /* 0, 1, 2 */
    advance(sim, 3.1);
    gust_sim_channels(sim, row);
    assert_true(row[2] == 6.0); /* 2.5, 2.75, 3.0 */
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);

    sampled(&builder, 0.0);
    model = builder_model(&builder);
    sim = new_sim(model, PRECISE);
    assert_int_equal(gust_sim_initialise(sim, 0.0), GUST_BAD_PERIOD);
    assert_says(gust_sim_message(sim), "loop.p2");
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* RC circuit whose resistance changes at 1 s and back at 2 s; one change at the start time counts at once. */
static void schedule(void **state)
{
    (void)state;
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    builder.n_types = 1;
    builder.types[0] = (built_type){.kernel = "rc",
                                    .n_instances = 1,
                                    .instances = {{.name = "circuit", .parameters = {99.0, 0.25}}},
                                    .differential = {1, 0}};
    builder.n_inputs = 1;
    builder.inputs[0] = 10.0;
    builder.n_schedule = 3;
    const double value[] = {2.0, 8.0, 2.0};
    for (int k = 0; k < 3; ++k) {
        builder.schedule_time[k] = (double)k;
        builder.schedule_value[k] = value[k];
    }
    builder.n_channels = 1;
    builder.channel[0] = 0;
    builder.channel[1] = 1;
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    static record rows;
    memset(&rows, 0, sizeof rows);
    rows.n_channels = 1;
    assert_int_equal(gust_sim_set_sink(sim, 0.5, 3, collect, &rows), GUST_OK);
    initialise(sim, 0.0);
    advance(sim, 3.0);
    const double v1 = 10.0 * (1.0 - exp(-2.0));
    const double v2 = 10.0 - (10.0 - v1) * exp(-0.5);
    double y[2];
    unknowns(sim, y);
    assert_close(y[0], 10.0 - (10.0 - v2) * exp(-2.0), CLOSE, "voltage");
    assert_int_equal(rows.rows, 7);
    assert_int_equal(rows.blocks, 3);
    assert_int_equal(rows.largest_block, 3);
    /* a row at the time of an event holds the values before it */
    assert_close(rows.time[2], 1.0, 1e-15, "time of row 2");
    assert_close((double)rows.value[2][0], (10.0 - v1) / 2.0, CLOSE, "current before the change");
    assert_close((double)rows.value[3][0], (10.0 - v1) * exp(-0.25) / 8.0, CLOSE, "current after the change");
    gust_statistics statistics;
    gust_sim_statistics(sim, &statistics);
    assert_int_equal(statistics.events, 2);
    assert_int_equal(statistics.rows, 7);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(bouncing),       cmocka_unit_test(zeno),
                                       cmocka_unit_test(true_at_start),  cmocka_unit_test(triangle),
                                       cmocka_unit_test(chattering),     cmocka_unit_test(endless),
                                       cmocka_unit_test(sampling),       cmocka_unit_test(many_samples),
                                       cmocka_unit_test(period_changes), cmocka_unit_test(schedule)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
