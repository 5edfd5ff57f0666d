#include "block.h"

#include <math.h>
#include <stdbool.h>

#define PERIOD    1e-3
#define START     1.0
#define FEATHERED 90.0

typedef struct context {
    double v_dc, omega_r, omega_del;
    double omega_gsc, beta_ref;
    double k_droop, k_pitch;
    double active_droop, active_pitch;
    double integral;
    uint32_t errors;
    uint32_t faulty;
    uint32_t failing; /* steps */
    uint32_t failure;
    double broken;
    bool is_broken;
} context;

#define AT(member) (uint32_t)offsetof(context, member)

static const gust_controller_signal INPUTS[] = {
    {"v_dc", "pu", 1, AT(v_dc), 0.0, 2.0, START, 1.0},
    {"omega_r", "pu", 2, AT(omega_r), -0.1, 2.0, START, 1.0},
    {"omega_del", "pu", 3, AT(omega_del), 0.0, 2.0, START, 1.0},
};
static const gust_controller_signal OUTPUTS[] = {
    {"omega_gsc", "pu", 11, AT(omega_gsc), 0.5, 1.5, START, 1.0},
    {"beta_ref", "deg", 12, AT(beta_ref), 0.0, FEATHERED, 0.0, 10.0},
};
static const gust_controller_signal PARAMETERS[] = {
    {"k_droop", "pu", TEST_K_DROOP, AT(k_droop), 0.0, 10.0, 0.5, 1.0},
    {"k_pitch", "deg", TEST_K_PITCH, AT(k_pitch), 0.0, 1000.0, 100.0, 1.0},
};

static uint32_t recalibrate(void *c)
{
    context *at = c;
    /* More than the ranges of each: together they must not be too much. */
    const bool good = at->k_droop * at->k_pitch <= 1000.0;
    at->errors &= ~8U;
    if (good) {
        at->active_droop = at->k_droop;
        at->active_pitch = at->k_pitch;
    } else {
        at->errors |= 8U;
    }
    return at->errors;
}

static uint32_t reinitialise(void *c)
{
    context *at = c;
    at->v_dc = at->omega_r = at->omega_del = START;
    at->omega_gsc = START;
    at->beta_ref = 0.0;
    at->integral = 0.0;
    at->errors &= 8U;
    return at->errors;
}

static uint32_t startup(void *c)
{
    context *at = c;
    memset(at, 0, sizeof *at);
    at->k_droop = PARAMETERS[0].value;
    at->k_pitch = PARAMETERS[1].value;
    (void)recalibrate(at);
    return reinitialise(at);
}

static double within(double x, double low, double high)
{
    return x < low ? low : (x > high ? high : x);
}

static uint32_t step(void *c)
{
    context *at = c;
    if (at->is_broken) {
        at->omega_gsc = at->beta_ref = at->broken;
        return 0;
    }
    if (at->failing > 0) {
        --at->failing;
        return at->failure;
    }
    at->integral =
        within(at->integral + at->active_pitch * (at->omega_r - at->omega_del) * PERIOD, 0.0, FEATHERED);
    at->omega_gsc = within(START + at->active_droop * (at->v_dc - START), 0.5, 1.5);
    at->beta_ref = at->integral;
    return at->errors;
}

const gust_controller test_controller = {.version = GUST_CONTROLLER_VERSION,
                                         .real_size = sizeof(double),
                                         .name = "test",
                                         .control = "Test",
                                         .period = PERIOD,
                                         .context_size = sizeof(context),
                                         .n_inputs = 3,
                                         .n_outputs = 2,
                                         .n_parameters = 2,
                                         .faulty_inputs = AT(faulty),
                                         .inputs = INPUTS,
                                         .outputs = OUTPUTS,
                                         .parameters = PARAMETERS,
                                         .startup = startup,
                                         .step = step,
                                         .recalibrate = recalibrate,
                                         .reinitialise = reinitialise};

void test_controller_fail(void *c, uint32_t n, uint32_t errors)
{
    context *at = c;
    at->failing = n;
    at->failure = errors;
}

void test_controller_break(void *c, double value)
{
    context *at = c;
    at->broken = value;
    at->is_broken = true;
}
