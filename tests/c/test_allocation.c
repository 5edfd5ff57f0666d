/* After initialise nothing allocates: the linker sends every allocation of this program through here, those of
 * SUNDIALS and KLU included. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "allocations.h"
#include "support.h"

/* Value = time, a sample every 0.1 s, for ever. */
static int read_ramp(void *context, int64_t first, int64_t count, double *time, double *value)
{
    (void)context;
    (void)time;
    for (int64_t k = 0; k < count; ++k) {
        value[k] = 0.1 * (double)(first + k);
    }
    return (int)count;
}

/* A circuit on a series that is read in blocks, a bouncing ball, a sampled loop, a controller beside its plant,
 * a change of a parameter. */
static void run(void **state)
{
    (void)state;
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    builder.n_types = 4;
    builder.types[0] = (built_type){.kernel = "rc",
                                    .n_instances = 1,
                                    .instances = {{.name = "circuit", .parameters = {2.0, 0.25}}},
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
    builder.types[3] = (built_type){.kernel = "held",
                                    .n_instances = 1,
                                    .instances = {{.name = "plant", .parameters = {1.0}, .start = {1.0}}},
                                    .differential = {1}};
    builder_sampled(&builder, 1, 1, 0);
    builder_law(&builder, 0, (const int32_t[]){3, 0, LIBRARY, 1, 4, 28}, 5, 0.1,
                (const double[]){2.0, 0.25, 0.0});
    builder.n_inputs = 1;
    builder.n_schedule = 1;
    builder.schedule_time[0] = 5.5;
    builder.schedule_value[0] = 3.0; /* resistance */
    builder.n_channels = 2;
    const int32_t channel[] = {0, 0, 0, 1, 0, 1};
    memcpy(builder.channel, channel, sizeof channel);
    builder_inline_series(&builder, 0, 0, 0, 0.0, 0.1, INFINITY, NULL, (double[]){0.0}, 1);
    writer_i32(&builder.writer, "series.0.kind", (int32_t[]){0, 1, 0, 1}, 4);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, 1e-6);
    static record rows;
    memset(&rows, 0, sizeof rows);
    rows.n_channels = 2;
    assert_int_equal(gust_sim_set_sink(sim, 0.05, 16, collect, &rows), GUST_OK);
    assert_int_equal(gust_sim_set_option(sim, "series_block", 16), GUST_OK);
    assert_int_equal(gust_sim_set_series_reader(sim, 0, read_ramp, NULL), GUST_OK);
    const gust_stats_channel kept[] = {{.column = 0,
                                        .n_edges = 2,
                                        .edges = (double[]){0.0, 10.0},
                                        .segment = 64,
                                        .n_exponents = 1,
                                        .exponents = (double[]){4.0}},
                                       {.column = 1}};
    gust_stats *stats = NULL;
    assert_int_equal(gust_stats_create(kept, 2, 2, 0.01, &stats, NULL, 0), GUST_OK);
    assert_int_equal(gust_sim_set_statistics(sim, stats, 0.0), GUST_OK);
    initialise(sim, 0.0);
    const long before = allocations;
    assert_true(before > 0); /* the wrapping works */
    double y[6], row[2];
    for (int k = 1; k <= 20; ++k) {
        advance(sim, (double)k);
        unknowns(sim, y);
        gust_sim_channels(sim, row);
        assert_int_equal(gust_sim_checkpoint(sim, GUSTFORM_TEST_KERNELS "/allocation.gustck"), GUST_OK);
    }
    gust_statistics statistics;
    gust_sim_statistics(sim, &statistics);
    assert_int_equal(allocations, before);
    assert_int_equal(rows.rows, 401);
    gust_stats_moments_result moments;
    gust_stats_moments(stats, 0, &moments);
    gust_stats_spectrum(stats, 0, NULL, NULL);
    gust_stats_cycles(stats, 0, NULL, NULL, NULL);
    assert_int_equal(allocations, before);
    assert_int_equal(moments.count, 2001);
    gust_sampled_statistics sampled;
    gust_sim_sampled_statistics(sim, 0, &sampled);
    assert_int_equal(sampled.samples, 200); /* 0 ... 19.9 s */
    assert_true(statistics.restarts > 220);
    remove(GUSTFORM_TEST_KERNELS "/allocation.gustck");
    gust_sim_destroy(&sim);
    gust_stats_destroy(&stats);
    gust_model_destroy(&model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(run)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
