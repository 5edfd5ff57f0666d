/* Models that cannot be started or run: each must end with a status and a message that names what is wrong. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "support.h"

/* x' = -x + p2 x^2, 0 = p0 z + p1 z^2 - u - p3 / (x - p4); see kernels/awkward.c. */
static gust_model *awkward(const double parameters[5], double x, double z, double u)
{
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    builder.n_types = 1;
    builder.types[0] = (built_type){
        .kernel = "awkward", .n_instances = 1, .instances = {{.name = "unit"}}, .differential = {1, 0}};
    memcpy(builder.types[0].instances[0].parameters, parameters, 5 * sizeof parameters[0]);
    builder.types[0].instances[0].start[0] = x;
    builder.types[0].instances[0].start[1] = z;
    builder.n_inputs = 1;
    builder.inputs[0] = u;
    return builder_model(&builder);
}

static void start_fails(const double parameters[5], double x, double z, double u, gust_status expected,
                        const char *says)
{
    gust_model *model = awkward(parameters, x, z, u);
    gust_sim *sim = new_sim(model, 1e-6);
    const gust_status status = gust_sim_initialise(sim, 0.0);
    if (status != expected) {
        fail_msg("%s: %s", gust_status_name(status), gust_sim_message(sim));
    }
    assert_says(gust_sim_message(sim), says);
    assert_int_equal(gust_sim_advance(sim, 1.0, NULL), expected); /* ended for good */
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void singular(void **state)
{
    (void)state;
    start_fails((double[]){0.0, 0.0, 0.0, 0.0, 0.0}, 1.0, 1.0, 0.0, GUST_SINGULAR, "unit.y1");
    start_fails((double[]){0.0, 0.0, 0.0, 0.0, 0.0}, 1.0, 1.0, 0.0, GUST_SINGULAR, "unit: equation 1");
}

static void no_solution(void **state)
{
    (void)state;
    gust_model *model = awkward((double[]){0.0, 1.0, 0.0, 0.0, 0.0}, 1.0, 3.0, -1.0); /* z^2 = -1 */
    gust_sim *sim = new_sim(model, 1e-6);
    const gust_status status = gust_sim_initialise(sim, 0.0);
    assert_true(status == GUST_NOT_CONSISTENT || status == GUST_SINGULAR);
    assert_says(gust_sim_message(sim), "equation 1");
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

static void not_a_number(void **state)
{
    (void)state;
    start_fails((double[]){1.0, 0.0, 0.0, 1.0, 1.0}, 1.0, 1.0, 0.0, GUST_NOT_FINITE, "unit: equation 1");
}

/* A start far from the solution is what damping is for: z + z^2 / 10 = 1000 from z = 1e6. */
static void far_start(void **state)
{
    (void)state;
    gust_model *model = awkward((double[]){1.0, 0.1, 0.0, 0.0, 0.0}, 1.0, 1e6, 1000.0);
    gust_sim *sim = new_sim(model, 1e-8);
    initialise(sim, 0.0);
    double y[2];
    unknowns(sim, y);
    assert_close(y[1], (-1.0 + sqrt(401.0)) / 0.2, 1e-9, "z");
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* x' = -x + x^2 from 2 has its pole at t = ln 2: results up to there must be delivered. */
static void escape(void **state)
{
    (void)state;
    static system_builder unused;
    (void)unused;
    gust_model *model = awkward((double[]){1.0, 0.0, 1.0, 0.0, 0.0}, 2.0, 0.0, 0.0);
    gust_sim *sim = new_sim(model, 1e-6);
    static record rows;
    memset(&rows, 0, sizeof rows);
    assert_int_equal(gust_sim_set_sink(sim, 0.01, 1000, collect, &rows), GUST_OK);
    initialise(sim, 0.0);
    double reached = 0.0;
    const gust_status status = gust_sim_advance(sim, 10.0, &reached);
    assert_true(status <= GUST_STEP_TOO_SMALL && status >= GUST_SOLVER_FAILED);
    assert_close(reached, 0.69314718, 1e-2, "time of the pole");
    assert_true(rows.rows == 70); /* 0, 0.01, ... 0.69 */
    printf("%s: %s\n", gust_status_name(status), gust_sim_message(sim));
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* An algebraic equation that loses its solution on the way: z^2 = u, u falling through 0 at t = 1. */
static void lost_solution(void **state)
{
    (void)state;
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    builder.n_types = 1;
    builder.types[0] = (built_type){
        .kernel = "awkward",
        .n_instances = 1,
        .instances = {{.name = "unit", .parameters = {0.0, 1.0, 0.0, 0.0, 0.0}, .start = {1.0, 1.0}}},
        .differential = {1, 0}};
    builder.n_inputs = 1;
    const double value[] = {1.0, -1.0};
    builder_inline_series(&builder, 0, 1, 0, 0.0, 2.0, 2.0, NULL, value, 2);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, 1e-6);
    initialise(sim, 0.0);
    double reached = 0.0;
    const gust_status status = gust_sim_advance(sim, 2.0, &reached);
    assert_true(status == GUST_NO_CONVERGENCE || status == GUST_SINGULAR_STEP);
    assert_close(reached, 1.0, 1e-3, "time");
    assert_says(gust_sim_message(sim), "unit");
    printf("%s: %s\n", gust_status_name(status), gust_sim_message(sim));
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* Two shared unknowns at one branch: one of them appears in no equation. */
static void structurally_singular(void **state)
{
    (void)state;
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    builder.n_types = 1;
    builder.n_shared = 2;
    builder.types[0] = (built_type){.kernel = "branch",
                                    .n_instances = 1,
                                    .instances = {{.name = "branch", .parameters = {1.0, 1.0}}},
                                    .differential = {1}};
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, 1e-6);
    assert_int_equal(gust_sim_initialise(sim, 0.0), GUST_SINGULAR);
    assert_says(gust_sim_message(sim), "2 of 3");
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(singular),
                                       cmocka_unit_test(no_solution),
                                       cmocka_unit_test(not_a_number),
                                       cmocka_unit_test(far_start),
                                       cmocka_unit_test(escape),
                                       cmocka_unit_test(lost_solution),
                                       cmocka_unit_test(structurally_singular)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
