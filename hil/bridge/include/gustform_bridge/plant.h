/* The converter's node: the other side of the bus, with a simulated plant in place of the bench.
 *
 * Pure core, as bridge.h: whoever has a clock calls it once a period, in this order: gust_plant_send with the
 * sample, gust_plant_receive for each frame, gust_plant_finish. A command is taken when it answers to this
 * sample or the one before and is enabled; then the converter is running. When more than `missing` periods in a
 * row bring none, or somebody presses the emergency stop, it trips. While it is not running the plant keeps the
 * commands of its start, for a simulation has no blocked valves. It is ready again after REST periods of
 * references that are not enabled.
 *
 * Ownership: the caller's; everything pointed to must outlive it. Nothing is allocated. One thread.
 */
#ifndef GUSTFORM_BRIDGE_PLANT_H
#define GUSTFORM_BRIDGE_PLANT_H

#include <stdbool.h>
#include <stdint.h>

#include "bind.h"
#include "link.h"
#include "sample.h"
#include "supervision.h"
#include "transport.h"

typedef struct gust_plant_config {
    const gust_message_set *messages;
    gust_transport *transport;
    uint64_t period;                 /* ns */
    const char *const *measurements; /* names of what is measured, set-points included */
    uint32_t n_measurements;
    const char *const *commands;
    uint32_t n_commands;
    const double *start; /* [n_commands] */
    uint32_t missing;    /* periods in a row without a command that are tolerated while running */
} gust_plant_config;

typedef struct gust_plant {
    gust_plant_config config;
    gust_link link;
    gust_sample references;
    gust_place measured[GUST_SIGNALS];
    gust_place commanded[GUST_SIGNALS];
    double command[GUST_SIGNALS]; /* what the plant is to act on */
    uint32_t state;               /* enum gust_converter_state */
    uint32_t controller;          /* enum gust_state, as last heard */
    uint32_t faults;              /* the same */
    uint32_t number;              /* of the sample that was sent last */
    bool answered;                /* it has been */
    bool enabled;                 /* and enabled */
    bool stranger;                /* the controller's database is another one */
    uint32_t silent;              /* periods without an answer */
    uint32_t resting;             /* periods of references that are not enabled */
    uint64_t ticks, answers, trips;
    uint64_t heard; /* complete samples of references, taken or not */
    bool blocked;   /* the last of them was not enabled */
    bool mute;      /* for tests: measurements are not sent */
    uint32_t told;
} gust_plant;

/* false and a text where a name has no signal. State READY. */
bool gust_plant_init(gust_plant *plant, const gust_plant_config *config, gust_error *error);

/* State, heartbeat and fingerprint when they are due, set-points, measurements, Sync. */
void gust_plant_send(gust_plant *plant, const double *measurements);

/* true: the answer to this period's sample is complete. */
bool gust_plant_receive(gust_plant *plant, const gust_frame *frame);

/* The end of the period: `command` is what holds from now on. */
void gust_plant_finish(gust_plant *plant);

#endif
