/* A test stand: the bridge on one node of an in-process bus, a converter and an operator on another. */
#ifndef GUST_TEST_STAND_H
#define GUST_TEST_STAND_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "block.h"
#include "database.h"
#include "gustform_bridge/bridge.h"
#include "gustform_bridge/loop_transport.h"

#define PERIOD_NS UINT64_C(1000000)
#define FRAME_NS  UINT64_C(20000)

/* What the converter heard in a period. */
typedef struct heard {
    uint32_t references; /* whole samples of them */
    bool enabled;
    uint32_t sample;
    double omega_gsc, i_d_gsc, beta_ref;
    uint32_t states; /* messages of the controller's state */
    uint32_t responses;
    double operation, parameter, result, value;
    uint32_t heartbeats, fingerprints;
} heard;

typedef struct stand {
    gust_bus bus;
    gust_bridge bridge;
    gust_link converter; /* of node 1 */
    gust_sample references;
    uint32_t number; /* of the next sample */
    uint32_t period; /* since the beginning */
    uint32_t nonce;
    double v_dc, omega_r;
    uint32_t converter_state;
    heard heard;
    uint32_t told_state, told_faults; /* by the last message of the controller's state */
    uint64_t worst_age;               /* longest time that an enabled command was under way, ns */
    bool (*tap)(struct stand *s, gust_bus_node *sender, gust_frame *frame); /* as that of the bus */
    uint32_t out_of_range; /* commands that the converter should never have heard */
} stand;

/* Synchronous unless `drift`. */
void stand_begin(stand *s, const gust_message_set *set, bool synchronous);

/* What the converter sends in a period, for tests that send something else. */
void stand_status(stand *s);
void stand_measure(stand *s);
void stand_sync(stand *s);

/* Let the bus carry what was sent, give it to the bridge, tick it, carry its answer, hear it. */
void stand_finish(stand *s);

/* The bridge takes what has come in. */
void stand_drain(stand *s);

/* A whole period. */
void stand_period(stand *s);
void stand_periods(stand *s, uint32_t n);

/* READY and RUN from the beginning; SAFE to READY. */
void stand_ready(stand *s);
void stand_run(stand *s);

/* One message from the converter's node, values by field. */
void stand_send(stand *s, gust_part part, uint8_t piece, const double *values);
void stand_command(stand *s, gust_command command, uint32_t nonce);
void stand_press(stand *s, gust_command command);
void stand_request(stand *s, double operation, double parameter, double value);
void stand_fingerprint(stand *s, uint32_t fingerprint);
void stand_emergency(stand *s);

/* A frame of the converter's message, to be spoiled. */
gust_frame stand_frame(stand *s, gust_part part, uint8_t piece, const double *values);

/* As it is, onto the bus. */
void stand_put(stand *s, const gust_frame *frame);

gust_state stand_state(const stand *s);

#endif
