/* The controller's node: a controller on one side, a bus on the other, supervision between them.
 *
 * Pure core: no operating system and no clock of its own; it is ticked once a period by whoever has one. In
 * READY and before, and in SAFE, the references carry enable = 0 and of each signal the value of least harm; in
 * RUN the last good command. A controller input that is bound to the set-points keeps its last value for as
 * long as no new one comes (its start value before the first), unless limits.set_points says otherwise; no
 * set-point is needed to become READY.
 *
 * At most one sample of references is under way: if it has not left within one period, none is queued after it,
 * and that is a fault. (A tick that comes soon after a late one queues none and waits for the next.) Nothing is
 * ever sent twice. So no command older than one period is handed to the bus.
 *
 * The queue of an interface keeps its order, so references wait for what was handed over before them. Therefore
 * all else, state, answers, heartbeat, fingerprint, takes turns: one frame in a period, behind the references,
 * and none as long as the one before has not left (for limits.missing periods at most: an echo can get lost). A
 * change of the state goes first.
 *
 * Ownership: the caller's, everything pointed to must outlive it. Nothing is allocated. One thread, except
 * the last three functions.
 */
#ifndef GUSTFORM_BRIDGE_BRIDGE_H
#define GUSTFORM_BRIDGE_BRIDGE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "bind.h"
#include "gust_controller.h"
#include "link.h"
#include "messages.h"
#include "parameters.h"
#include "sample.h"
#include "supervision.h"
#include "transport.h"

#define GUST_CONTEXT 4096 /* bytes of a controller's context, at most */
#define GUST_TURNS   4    /* parts that take turns */

/* The largest change of a measured quantity that is taken for true, per second. */
typedef struct gust_rate {
    const char *quantity;
    double rate;
} gust_rate;

/* v_dc 500 pu/s: twice what full power does to the smallest link, 2 ms; omega_r 5 pu/s: a rotor with H = 0.1 s.
 */
extern const gust_rate gust_default_rates[];
extern const uint32_t gust_n_default_rates;

typedef struct gust_bridge_config {
    const gust_controller *controller;
    const gust_message_set *messages;
    gust_transport *transport;
    gust_limits limits; /* `rate` is filled from `rates`; `heartbeat` 0 becomes three cycles of the database;
                           what the database does not have is not asked for */
    const gust_rate *rates;
    uint32_t n_rates;
    bool synchronous; /* the caller ticks at each Sync */
    bool tune;        /* parameters may be written in RUN */
    uint64_t age;     /* ns that a command may be old when it is handed over; 0: not looked at */
} gust_bridge_config;

typedef struct gust_bridge {
    gust_bridge_config config;
    gust_link link;
    gust_supervision supervision;
    gust_sample measurements;
    gust_sample references; /* the messages alone */
    gust_place inputs[GUST_SIGNALS];
    gust_place outputs[GUST_SIGNALS];
    gust_parameters parameters;
    double input[GUST_SIGNALS];
    bool known[GUST_SIGNALS]; /* an input has come at all */
    double command[GUST_SIGNALS];
    bool commanding; /* a step has been made since the start */
    bool cut;        /* a command was out of the database's range */
    uint32_t errors; /* error signal of the last step */
    uint32_t stuck;  /* periods in which references did not leave */
    bool sync_heard, sync_here;
    uint32_t sync_number;
    uint32_t sync_periods; /* since the Sync before */
    uint64_t sync_modulus; /* 0: the database has no Sync */
    uint64_t ticks;
    uint64_t steps, held;                         /* periods in RUN with a step, and without */
    uint64_t begun;                               /* the tick, ns of the transport's clock */
    uint64_t handed;                              /* the tick whose references were handed over last */
    const gust_message *taking_turns[GUST_TURNS]; /* NULL: the database has none */
    bool wanted[GUST_TURNS];                      /* what waits for its turn */
    uint32_t turn;                                /* who is first in the next period */
    uint32_t unquiet;                             /* periods in which something handed over had not left */
    gust_state told_state;
    uint32_t told_faults;
    _Atomic uint32_t sample; /* number of the last fresh sample */
    _Atomic uint32_t latched;
    _Alignas(16) unsigned char context[GUST_CONTEXT];
} gust_bridge;

/* Finds all signals; false and a text if one is missing or something does not fit. State INIT. */
bool gust_bridge_init(gust_bridge *bridge, const gust_bridge_config *config, gust_error *error);

/* One frame, echoes and error frames included. true: a new Sync, at which a synchronous bridge is to be ticked.
 */
bool gust_bridge_receive(gust_bridge *bridge, const gust_frame *frame);

/* The end of a period, after all frames were received: supervise, step, send. `periods` since the last tick, 1
 * if none was missed; a synchronous bridge passes `sync_periods`. */
void gust_bridge_tick(gust_bridge *bridge, uint32_t periods);

/* The bus, as a send or receive has told. */
void gust_bridge_transport(gust_bridge *bridge, gust_transport_status status);

/* SAFE references, at once: at the end of the program. */
void gust_bridge_stop(gust_bridge *bridge);

/* From any thread: faults that the next tick raises; until then no command is sent. */
void gust_bridge_latch(gust_bridge *bridge, uint32_t faults);

/* From any thread: the frames of SAFE references, for another socket; how many. The bridge takes them for its
 * own when it hears them. */
uint32_t gust_bridge_safe_frames(gust_bridge *bridge, gust_frame frames[GUST_PIECES]);

/* From any thread: frame k of those was not sent. */
void gust_bridge_not_sent(gust_bridge *bridge, uint32_t k);

#endif
