/* A controller as a library, float, period 0.1 s: u = -k x - s, s += i (2 x)/2, both inputs measured; bit 2
 * where u is beyond +-3 and cut to it, bit 3 after a calibration with a negative k. It tells x as it has seen
 * it. */
#include <stddef.h>

#include "gustform/gust_controller.h"

typedef struct law {
    float in[2];
    float out[1];
    float p[2];
    float gain[2];
    float memory[1];
    float seen[1];
    uint32_t errors;
    uint32_t faulty;
} law;

static uint32_t recalibrate(void *context)
{
    law *c = context;
    c->errors &= ~8U;
    if (c->p[0] >= 0.0F) {
        c->gain[0] = c->p[0];
        c->gain[1] = c->p[1];
    } else {
        c->errors |= 8U;
    }
    return c->errors;
}

static uint32_t reinitialise(void *context)
{
    law *c = context;
    c->memory[0] = 0.0F;
    c->out[0] = 0.0F;
    c->seen[0] = 0.0F;
    return c->errors;
}

static uint32_t startup(void *context)
{
    law *c = context;
    c->p[0] = 1.0F;
    c->p[1] = 0.0F;
    c->errors = 0;
    (void)recalibrate(context);
    return reinitialise(context);
}

static uint32_t step(void *context)
{
    law *c = context;
    const float u = -c->gain[0] * c->in[0] - c->memory[0];
    c->memory[0] += c->gain[1] * 0.5F * c->in[1];
    c->errors &= 8U;
    c->seen[0] = c->in[0];
    c->out[0] = u;
    if (u > 3.0F || u < -3.0F) {
        c->out[0] = u > 0.0F ? 3.0F : -3.0F;
        c->errors |= 4U;
    }
    return c->errors;
}

static const gust_controller_signal INPUTS[] = {
    {"x", "V", 1, offsetof(law, in), -100.0, 100.0, 0.0, 1.0},
    {"double_x", "V", 2, offsetof(law, in) + 4, -100.0, 100.0, 0.0, 1.0}};
static const gust_controller_signal OUTPUTS[] = {{"u", "V/s", 3, offsetof(law, out), -3.0, 3.0, 0.0, 1.0}};
static const gust_controller_signal PARAMETERS[] = {
    {"k", "1/s", 4, offsetof(law, p), 0.0, 100.0, 1.0, 1.0},
    {"i", "1/s", 5, offsetof(law, p) + 4, 0.0, 100.0, 0.0, 1.0}};
static const gust_controller_signal MONITORS[] = {
    {"seen", "V", 6, offsetof(law, seen), -100.0, 100.0, 0.0, 1.0}};
static const gust_controller CONTROLLER = {GUST_CONTROLLER_VERSION,
                                           4,
                                           "law",
                                           "Law",
                                           0.1,
                                           sizeof(law),
                                           2,
                                           1,
                                           2,
                                           1,
                                           offsetof(law, faulty),
                                           INPUTS,
                                           OUTPUTS,
                                           PARAMETERS,
                                           MONITORS,
                                           startup,
                                           step,
                                           recalibrate,
                                           reinitialise};

const gust_controller *gust_controller_interface(void)
{
    return &CONTROLLER;
}
