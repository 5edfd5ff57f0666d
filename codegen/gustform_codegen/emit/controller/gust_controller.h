/* A controller behind one interface, for whatever runs it: a simulation, a bridge, a bench.
 *
 * The same text in every exported folder. <prefix>_interface.c fills in the table; a microcontroller that calls
 * <prefix>_step itself needs neither. A shared library built with -DGUST_CONTROLLER_LIBRARY exports
 * gust_controller_interface. All texts and tables are const and nobody's to free; contexts are the caller's.
 * Signals stand in the order of their members in the context.
 */
#ifndef GUST_CONTROLLER_H
#define GUST_CONTROLLER_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GUST_CONTROLLER_VERSION 2

typedef struct gust_controller_signal {
    const char *name;
    const char *unit;
    uint32_t id;     /* stable */
    uint32_t offset; /* of its value in the context, bytes */
    double low;      /* range; infinite where there is no bound */
    double high;
    double value; /* start of a signal, default of a parameter */
    double nominal;
} gust_controller_signal;

typedef struct gust_controller {
    uint32_t version;      /* GUST_CONTROLLER_VERSION */
    uint32_t real_size;    /* 4: float, 8: double */
    const char *name;      /* prefix */
    const char *control;   /* "DualPort" */
    double period;         /* s */
    uint32_t context_size; /* bytes; alignment of a double does */
    uint32_t n_inputs;
    uint32_t n_outputs;
    uint32_t n_parameters;
    uint32_t n_monitors;
    uint32_t faulty_inputs; /* offset of the word that tells which inputs were rejected */
    const gust_controller_signal *inputs;
    const gust_controller_signal *outputs;
    const gust_controller_signal *parameters;
    const gust_controller_signal *monitors; /* to be looked at; nothing is commanded by them */
    uint32_t (*startup)(void *context);
    uint32_t (*step)(void *context);
    uint32_t (*recalibrate)(void *context);
    uint32_t (*reinitialise)(void *context);
} gust_controller;

/* Of a shared library. */
const gust_controller *gust_controller_interface(void);

/* The value of a signal in a context. */
static inline double gust_controller_get(const gust_controller *controller, const void *context,
                                         const gust_controller_signal *signal)
{
    const char *at = (const char *)context + signal->offset;
    double value = 0.0;
    if (controller->real_size == (uint32_t)sizeof(float)) {
        float single = 0.0F;
        (void)memcpy((char *)&single, at, sizeof single);
        value = (double)single;
    } else {
        (void)memcpy((char *)&value, at, sizeof value);
    }
    return value;
}

/* Writes a signal into a context, rounded to the controller's type. */
static inline void gust_controller_set(const gust_controller *controller, void *context,
                                       const gust_controller_signal *signal, double value)
{
    char *at = (char *)context + signal->offset;
    if (controller->real_size == (uint32_t)sizeof(float)) {
        const float single = (float)value;
        (void)memcpy(at, (const char *)&single, sizeof single);
    } else {
        (void)memcpy(at, (const char *)&value, sizeof value);
    }
}

/* Which inputs the last step rejected: bit k for inputs[k]. */
static inline uint32_t gust_controller_faulty(const gust_controller *controller, const void *context)
{
    uint32_t bits = 0U;
    (void)memcpy((char *)&bits, (const char *)context + controller->faulty_inputs, sizeof bits);
    return bits;
}

#ifdef __cplusplus
}
#endif

#endif
