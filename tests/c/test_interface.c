/* The interface used wrongly, and its promises on stopping, sinks and statuses. */
#include <math.h>
#include <pthread.h>
#include <string.h>

#include "support.h"

static gust_model *rc_model(void)
{
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    builder.n_types = 1;
    builder.types[0] = (built_type){.kernel = "rc",
                                    .n_instances = 1,
                                    .instances = {{.name = "circuit", .parameters = {2.0, 0.25}}},
                                    .differential = {1, 0}};
    builder.n_inputs = 1;
    builder.inputs[0] = 10.0;
    builder.n_channels = 2;
    const int32_t channel[] = {0, 0, 0, 1, 0, 2};
    memcpy(builder.channel, channel, sizeof channel);
    return builder_model(&builder);
}

static void statuses(void **state)
{
    (void)state;
    assert_string_equal(gust_status_name(GUST_OK), "OK");
    assert_string_equal(gust_status_name(GUST_END_OF_DATA), "END_OF_DATA");
    assert_string_equal(gust_status_name((gust_status)12345), "UNKNOWN");
    int count = 0;
    for (int k = 1; gust_status_list(k) != GUST_OK; ++k) {
        ++count;
        assert_true(strlen(gust_status_text(gust_status_list(k))) > 10);
        for (int j = 0; j < k; ++j) {
            assert_true(gust_status_list(j) != gust_status_list(k));
        }
    }
    assert_true(count > 20);
}

static void options(void **state)
{
    (void)state;
    gust_model *model = rc_model();
    gust_sim *sim = new_sim(model, 1e-6);
    double value = 0.0;
    assert_int_equal(gust_sim_option(sim, "rtol", &value), GUST_OK);
    assert_true(value == 1e-6);
    assert_int_equal(gust_sim_set_option(sim, "rtoll", 1.0), GUST_UNKNOWN_OPTION);
    assert_says(gust_sim_message(sim), "rtol");
    assert_int_equal(gust_sim_set_option(sim, "rtol", -1.0), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_sim_set_option(sim, "rtol", NAN), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_sim_option(sim, "nothing", &value), GUST_UNKNOWN_OPTION);
    for (int k = 0; gust_option_list(k) != NULL; ++k) {
        const gust_option_info *info = gust_option_list(k);
        assert_true(info->minimum <= info->initial && info->initial <= info->maximum);
        assert_int_equal(gust_sim_set_option(sim, info->name, info->maximum), GUST_OK);
        assert_int_equal(gust_sim_option(sim, info->name, &value), GUST_OK);
        assert_true(value == info->maximum);
        assert_int_equal(gust_sim_set_option(sim, info->name, info->initial), GUST_OK);
    }
    initialise(sim, 0.0);
    assert_int_equal(gust_sim_set_option(sim, "rtol", 1e-3), GUST_BAD_ORDER);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void order(void **state)
{
    (void)state;
    gust_model *model = rc_model();
    gust_sim *sim = new_sim(model, 1e-6);
    double t = 0.0, y[2], row[2];
    static record rows;
    assert_int_equal(gust_sim_advance(sim, 1.0, NULL), GUST_BAD_ORDER);
    assert_int_equal(gust_sim_state(sim, &t, y, NULL), GUST_BAD_ORDER);
    assert_int_equal(gust_sim_channels(sim, row), GUST_BAD_ORDER);
    assert_int_equal(gust_sim_initialise(sim, INFINITY), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_sim_set_sink(sim, 0.0, 10, collect, &rows), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_sim_set_sink(sim, 1.0, 0, collect, &rows), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_sim_set_series_reader(sim, 0, NULL, NULL), GUST_BAD_ARGUMENT);
    initialise(sim, 5.0);
    assert_int_equal(gust_sim_initialise(sim, 5.0), GUST_BAD_ORDER);
    assert_int_equal(gust_sim_set_sink(sim, 1.0, 10, collect, &rows), GUST_BAD_ORDER);
    assert_int_equal(gust_sim_advance(sim, 4.0, NULL), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_sim_advance(sim, NAN, NULL), GUST_BAD_ARGUMENT);
    advance(sim, 5.0);
    advance(sim, 6.0);
    assert_int_equal(gust_sim_state(sim, &t, NULL, NULL), GUST_OK);
    assert_true(t == 6.0);
    gust_sim_destroy(&sim);
    gust_sim_destroy(&sim);
    gust_sim_destroy(NULL);
    gust_model_destroy(&model);
    gust_model_destroy(&model);
    gust_model_destroy(NULL);
    assert_int_equal(gust_sim_create(NULL, &sim), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_sim_create(model, NULL), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_sim_advance(NULL, 1.0, NULL), GUST_BAD_ARGUMENT);
    gust_sim_request_stop(NULL);
}

static void sink_answers(void **state)
{
    (void)state;
    for (int answer = -1; answer <= 1; answer += 2) {
        gust_model *model = rc_model();
        gust_sim *sim = new_sim(model, 1e-6);
        static record rows;
        memset(&rows, 0, sizeof rows);
        rows.n_channels = 2;
        rows.answer = answer;
        rows.answer_row = 25;
        assert_int_equal(gust_sim_set_sink(sim, 0.1, 10, collect, &rows), GUST_OK);
        initialise(sim, 0.0);
        double reached = 0.0;
        assert_int_equal(gust_sim_advance(sim, 100.0, &reached),
                         answer < 0 ? GUST_SINK_FAILED : GUST_SINK_STOPPED);
        assert_int_equal(rows.rows, 30);
        assert_true(reached < 100.0);
        gust_sim_destroy(&sim);
        gust_model_destroy(&model);
    }
}

typedef struct runner {
    gust_sim *sim;
    gust_status status;
    double reached;
} runner;

static void *run(void *context)
{
    runner *own = context;
    own->status = gust_sim_advance(own->sim, 1e9, &own->reached);
    return NULL;
}

/* Stopped from another thread; what was computed has been delivered, and the run can go on. */
static void stop(void **state)
{
    (void)state;
    gust_model *model = rc_model();
    gust_sim *sim = new_sim(model, 1e-6);
    gust_sim_set_option(sim, "max_step", 0.001);
    static record rows;
    memset(&rows, 0, sizeof rows);
    rows.n_channels = 2;
    assert_int_equal(gust_sim_set_sink(sim, 0.5, 1000000, collect, &rows), GUST_OK);
    initialise(sim, 0.0);
    runner own = {.sim = sim};
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, run, &own), 0);
    while (gust_sim_time(sim) < 2.0) {
    }
    gust_sim_request_stop(sim);
    assert_int_equal(pthread_join(thread, NULL), 0);
    assert_int_equal(own.status, GUST_STOP_REQUESTED);
    assert_true(own.reached >= 2.0);
    assert_int_equal(rows.rows, 1 + (int)floor(own.reached / 0.5));
    advance(sim, own.reached + 1.0);
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* Rows between steps lie on the solution: outputs too, which need y and y' there. */
static void rows_between_steps(void **state)
{
    (void)state;
    gust_model *model = rc_model();
    gust_sim *sim = new_sim(model, 1e-8);
    static record rows;
    memset(&rows, 0, sizeof rows);
    rows.n_channels = 2;
    gust_sim_set_sink(sim, 1.0 / 512.0, 100, collect, &rows);
    initialise(sim, 0.0);
    advance(sim, 3.0);
    assert_int_equal(rows.rows, 3 * 512 + 1);
    for (int64_t k = 0; k < rows.rows; ++k) {
        const double t = (double)k / 512.0;
        const double v = 10.0 * (1.0 - exp(-t / 0.5));
        assert_true(rows.time[k] == t);
        assert_close((double)rows.value[k][0], v, 1e-5, "voltage");
        assert_close((double)rows.value[k][1], 0.5 * 0.25 * v * v, 2e-5, "energy");
    }
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* Two simulations of one model in two threads do not know of each other. */
static void two_threads(void **state)
{
    (void)state;
    gust_model *model = rc_model();
    gust_sim *sims[2];
    runner runners[2];
    pthread_t threads[2];
    double y[2][2];
    for (int k = 0; k < 2; ++k) {
        sims[k] = new_sim(model, 1e-10);
        initialise(sims[k], 0.0);
        runners[k] = (runner){.sim = sims[k]};
        pthread_create(&threads[k], NULL, run, &runners[k]);
    }
    for (int k = 0; k < 2; ++k) {
        pthread_join(threads[k], NULL);
        assert_int_equal(runners[k].status, GUST_OK);
        unknowns(sims[k], y[k]);
    }
    assert_memory_equal(y[0], y[1], sizeof y[0]);
    for (int k = 0; k < 2; ++k) {
        gust_sim_destroy(&sims[k]);
    }
    gust_model_destroy(&model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(statuses),   cmocka_unit_test(options),
                                       cmocka_unit_test(order),      cmocka_unit_test(sink_answers),
                                       cmocka_unit_test(stop),       cmocka_unit_test(rows_between_steps),
                                       cmocka_unit_test(two_threads)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
