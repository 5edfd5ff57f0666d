/* Runs against closed forms, to 1e-5 relative at rtol 1e-8. */
#include <math.h>
#include <string.h>

#include "support.h"

static const double PRECISE = 1e-8;
static const double CLOSE = 1e-5;

static void charging(void **state)
{
    (void)state;
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    builder.n_types = 1;
    builder.types[0] = (built_type){.kernel = "rc",
                                    .n_instances = 1,
                                    .instances = {{.name = "circuit", .parameters = {2.0, 0.25}}},
                                    .differential = {1, 0}};
    builder.n_inputs = 1;
    builder.inputs[0] = 10.0;
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    double y[2];
    unknowns(sim, y);
    assert_close(y[1], 5.0, 1e-12, "current at the start");
    for (int k = 1; k <= 20; ++k) {
        const double t = 0.1 * k;
        advance(sim, t);
        unknowns(sim, y);
        assert_close(y[0], 10.0 * (1.0 - exp(-t / 0.5)), CLOSE, "voltage");
        assert_close(y[1], 5.0 * exp(-t / 0.5), CLOSE, "current");
    }
    gust_sim_destroy(&sim);
    assert_null(sim);
    gust_model_destroy(&model);
    assert_null(model);
}

/* Classical Runge-Kutta of theta'' = -g sin(theta) with steps so small that its error is 1e-12. */
static double swing(double theta, double g, double t)
{
    const int n = 20000;
    const double h = t / n;
    double w = 0.0;
    for (int k = 0; k < n; ++k) {
        const double k1 = w, l1 = -g * sin(theta);
        const double k2 = w + 0.5 * h * l1, l2 = -g * sin(theta + 0.5 * h * k1);
        const double k3 = w + 0.5 * h * l2, l3 = -g * sin(theta + 0.5 * h * k2);
        const double k4 = w + h * l3, l4 = -g * sin(theta + h * k3);
        theta += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        w += h / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4);
    }
    return theta;
}

static void pendulum(void **state)
{
    (void)state;
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    const double g = 9.81;
    const double theta = 1.0;
    builder.n_types = 1;
    /* the tension starts at a wrong value: initialise must find g cos(theta) */
    builder.types[0] = (built_type){.kernel = "pendulum",
                                    .n_instances = 1,
                                    .instances = {{.name = "pendulum",
                                                   .parameters = {9.81},
                                                   .start = {0.8414709848078965, -0.5403023058681398}}},
                                    .differential = {1, 1, 1, 1, 0}};
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    double y[5];
    unknowns(sim, y);
    assert_close(y[4], g * cos(theta), 1e-9, "tension at the start");
    for (int k = 1; k <= 10; ++k) {
        const double t = 0.5 * k;
        advance(sim, t);
        unknowns(sim, y);
        const double at = swing(theta, g, t);
        assert_close(y[0], sin(at), CLOSE, "x");
        assert_close(y[1], -cos(at), CLOSE, "y");
        assert_close(y[2] * y[2] + y[3] * y[3], 2.0 * g * (cos(at) - cos(theta)), 1e-4, "speed squared");
    }
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* Two branches at one node that belongs to neither: unknown 0 is its potential, row 0 the sum of flows. */
static void shared_node(void **state)
{
    (void)state;
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    builder.n_types = 1;
    builder.n_shared = 1;
    builder.types[0] =
        (built_type){.kernel = "branch",
                     .n_instances = 2,
                     .instances = {{.name = "left", .parameters = {1.0, 0.5}, .start = {3.0}},
                                   {.name = "right", .parameters = {2.0, 0.25}, .start = {-1.0}}},
                     .differential = {1}};
    builder.n_channels = 3;
    const int32_t channel[] = {0, 0, 0, 1, 0, 0, 1, 1, 0};
    memcpy(builder.channel, channel, sizeof channel);
    gust_model *model = builder_model(&builder);
    char name[128];
    gust_model_unknown_name(model, 0, name, sizeof name);
    assert_string_equal(name, "left.w0");
    gust_model_equation_name(model, 0, name, sizeof name);
    assert_string_equal(name, "sum of flows at left.flow0");
    gust_model_unknown_name(model, 2, name, sizeof name);
    assert_string_equal(name, "right.y0");
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    const double R1 = 1.0, R2 = 2.0, C1 = 0.5, C2 = 0.25;
    const double rate = (1.0 / C1 + 1.0 / C2) / (R1 + R2);
    const double charge = C1 * 3.0 + C2 * -1.0;
    double y[3];
    double row[3];
    for (int k = 1; k <= 10; ++k) {
        const double t = 0.1 * k;
        advance(sim, t);
        unknowns(sim, y);
        const double difference = 4.0 * exp(-rate * t);
        assert_close(y[1] - y[2], difference, CLOSE, "difference of voltages");
        assert_close(C1 * y[1] + C2 * y[2], charge, CLOSE, "charge");
        assert_close(y[0], (y[1] * R2 + y[2] * R1) / (R1 + R2), CLOSE, "potential");
        assert_int_equal(gust_sim_channels(sim, row), GUST_OK);
        assert_close(row[0], y[0], 1e-15, "channel of the potential");
        assert_close(row[1], -difference / (R1 + R2), CLOSE, "current of the left branch");
        assert_close(row[1] + row[2], 0.0, CLOSE, "sum of currents");
    }
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* The Jacobian of the system against differences of its residual. */
static void jacobian(void **state)
{
    (void)state;
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    builder.n_types = 2;
    builder.n_shared = 1;
    builder.types[0] = (built_type){.kernel = "branch",
                                    .n_instances = 3,
                                    .instances = {{.name = "a", .parameters = {1.0, 0.5}},
                                                  {.name = "b", .parameters = {2.0, 0.25}},
                                                  {.name = "c", .parameters = {3.0, 0.75}}},
                                    .differential = {1}};
    builder.types[1] =
        (built_type){.kernel = "pendulum",
                     .n_instances = 2,
                     .instances = {{.name = "p", .parameters = {9.81}}, {.name = "q", .parameters = {1.6}}},
                     .differential = {1, 1, 1, 1, 0}};
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    enum { N = 14 };
    assert_int_equal(gust_model_n_unknowns(model), N);
    double y[N], yp[N], base[N], moved[N], values[64];
    for (int i = 0; i < N; ++i) {
        y[i] = 0.3 + 0.1 * i;
        yp[i] = 0.7 - 0.05 * i;
    }
    const double cj = 13.0;
    double dense[N][N] = {{0.0}};
    assert_int_equal(gust_sim_residual(sim, 0.0, y, yp, base), GUST_OK);
    for (int k = 0; k < N; ++k) {
        const double h = 1e-7;
        y[k] += h;
        yp[k] += cj * h;
        gust_sim_residual(sim, 0.0, y, yp, moved);
        y[k] -= h;
        yp[k] -= cj * h;
        for (int i = 0; i < N; ++i) {
            dense[i][k] = (moved[i] - base[i]) / h;
        }
    }
    assert_int_equal(gust_model_n_nonzeros(model), 3 * 4 - 2 + 2 * 15);
    assert_int_equal(gust_sim_jacobian(sim, 0.0, y, yp, cj, values), GUST_OK);
    /* columns in order, rows ascending: walk through both */
    int used = 0;
    for (int k = 0; k < N; ++k) {
        for (int i = 0; i < N; ++i) {
            if (fabs(dense[i][k]) > 1e-6) {
                assert_close(values[used++], dense[i][k], 1e-5, "entry");
            }
        }
    }
    assert_int_equal(used, gust_model_n_nonzeros(model));
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

/* x' = max(sin(t), 0), over ten periods: 2 a period, whether the kinks are located or passed over. */
static void limiter(void **state)
{
    (void)state;
    for (int kinks = 0; kinks <= 1; ++kinks) {
        static system_builder builder;
        memset(&builder, 0, sizeof builder);
        builder.n_types = 1;
        builder.types[0] =
            (built_type){.kernel = "limited",
                         .n_instances = 1,
                         .instances = {{.name = "limiter", .parameters = {1.0}, .start = {0.0, 1.0, 0.0}}},
                         .differential = {1, 1, 1}};
        gust_model *model = builder_model(&builder);
        gust_sim *sim = new_sim(model, PRECISE);
        assert_int_equal(gust_sim_set_option(sim, "kinks", kinks), GUST_OK);
        initialise(sim, 0.0);
        double y[3];
        const double period = 2.0 * 3.14159265358979323846;
        for (int k = 1; k <= 10; ++k) {
            advance(sim, k * period - 1.0); /* in the flat half */
            unknowns(sim, y);
            assert_close(y[2], 2.0 * k, CLOSE, "integral");
        }
        gust_statistics statistics;
        gust_sim_statistics(sim, &statistics);
        assert_int_equal(statistics.restarts, kinks ? 19 : 0); /* at pi, 2 pi, ... 19 pi */
        assert_int_equal(statistics.events, kinks ? 19 : 0);
        assert_true(kinks || statistics.root_evaluations == 0);
        gust_sim_destroy(&sim);
        gust_model_destroy(&model);
    }
}

/* A table whose coefficients are those of x * y, which a bicubic spline holds exactly: at grid line i the
 * coefficients of a straight line are its values there. */
static void table(void **state)
{
    (void)state;
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    builder.n_types = 1;
    builder.types[0] = (built_type){
        .kernel = "surface", .n_instances = 1, .instances = {{.name = "surface"}}, .differential = {1}};
    builder.n_inputs = 2;
    builder.inputs[0] = 2.3;
    builder.inputs[1] = -0.4;
    builder.n_tables = 1;
    enum { NX = 5, NY = 4 };
    double coefficient[(NX + 2) * (NY + 2)];
    for (int i = 0; i < NX + 2; ++i) {
        for (int j = 0; j < NY + 2; ++j) {
            coefficient[i * (NY + 2) + j] = (1.0 + 0.5 * (i - 1)) * (-1.0 + 0.25 * (j - 1));
        }
    }
    writer_f64(&builder.writer, "table.0.grid", (double[]){1.0, 0.5, -1.0, 0.25}, 4);
    writer_i32(&builder.writer, "table.0.size", (int32_t[]){NX, NY}, 2);
    writer_f64(&builder.writer, "table.0.coefficient", coefficient, sizeof coefficient / sizeof coefficient[0]);
    gust_model *model = builder_model(&builder);
    gust_sim *sim = new_sim(model, PRECISE);
    initialise(sim, 0.0);
    double y[1];
    advance(sim, 1.0);
    unknowns(sim, y);
    assert_close(y[0], 2.3 * -0.4 * (1.0 - exp(-1.0)), CLOSE, "relaxation towards the table value");
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(charging),    cmocka_unit_test(pendulum),
                                       cmocka_unit_test(shared_node), cmocka_unit_test(jacobian),
                                       cmocka_unit_test(limiter),     cmocka_unit_test(table)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
