/* Runs whose result has a closed form: an RC circuit, driven in all the ways an input can be. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "gustform/gust_sim.h"
#include "system_builder.h"

static const double R = 2.0;
static const double C = 0.25; /* time constant 0.5 s */

static void rc(system_builder *builder, double voltage)
{
    memset(builder, 0, sizeof *builder);
    builder->n_types = 1;
    builder->types[0] = (built_type){.kernel = "rc",
                                     .n_instances = 1,
                                     .instances = {{.name = "circuit", .parameters = {2.0, 0.25}}},
                                     .differential = {1, 0}};
    builder->n_inputs = 1;
    builder->inputs[0] = voltage;
    builder->n_channels = 3;
    const int32_t channel[] = {0, 0, 0, 1, 0, 1, 1, 0, 2};
    memcpy(builder->channel, channel, sizeof channel);
}

static gust_sim *start(const gust_model *model, double rtol)
{
    gust_sim *sim = NULL;
    assert_int_equal(gust_sim_create(model, &sim), GUST_OK);
    assert_int_equal(gust_sim_set_option(sim, "rtol", rtol), GUST_OK);
    return sim;
}

static void advance(gust_sim *sim, double until)
{
    double reached = 0.0;
    const gust_status status = gust_sim_advance(sim, until, &reached);
    if (status != GUST_OK) {
        fail_msg("%s: %s", gust_status_name(status), gust_sim_message(sim));
    }
    assert_true(reached == until);
}

static void close_to(double value, double expected, double relative, const char *what)
{
    if (!(fabs(value - expected) <= relative * fmax(fabs(expected), 1e-3))) {
        fail_msg("%s: %.12g instead of %.12g", what, value, expected);
    }
}

static void charging(void **state)
{
    (void)state;
    static system_builder builder;
    rc(&builder, 10.0);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = start(model, 1e-8);
    assert_int_equal(gust_sim_initialise(sim, 0.0), GUST_OK);
    double y[2];
    for (int k = 1; k <= 20; ++k) {
        const double t = 0.1 * k;
        advance(sim, t);
        assert_int_equal(gust_sim_state(sim, NULL, y, NULL), GUST_OK);
        close_to(y[0], 10.0 * (1.0 - exp(-t / (R * C))), 1e-5, "voltage");
        close_to(y[1], 10.0 / R * exp(-t / (R * C)), 1e-5, "current");
    }
    gust_statistics statistics;
    gust_sim_statistics(sim, &statistics);
    printf("steps %lld residuals %lld jacobians %lld factor %lld refactor %lld etf %lld nni %lld\n",
           (long long)statistics.steps, (long long)statistics.residual_evaluations,
           (long long)statistics.jacobian_evaluations, (long long)statistics.factorisations,
           (long long)statistics.refactorisations, (long long)statistics.error_test_failures,
           (long long)statistics.nonlinear_iterations);
    gust_sim_destroy(&sim);
    assert_null(sim);
    gust_model_destroy(&model);
    assert_null(model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(charging)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
