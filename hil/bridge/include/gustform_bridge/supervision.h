/* Supervision: judges what a controller's node hears of its converter, period by period, and decides whether
 * commands may be enabled. Pure: no operating system, no allocation, no clock but the periods that the caller
 * counts.
 *
 * One rule leads to SAFE: a fault is raised. What must hold still for that is in gust_limits. In INIT nothing
 * is enabled yet, so faults of a bus that is only coming up (GUST_FAULTS_WAITING) keep INIT from ending and no
 * more; all others lead to SAFE from every state. One rule leads out of SAFE: an operator's reset with a nonce
 * not seen before, when no fault has been raised for `quiet` periods. Whatever persists is raised again in each
 * period, and so holds the door shut.
 */
#ifndef GUSTFORM_BRIDGE_SUPERVISION_H
#define GUSTFORM_BRIDGE_SUPERVISION_H

#include <stdbool.h>
#include <stdint.h>

#include "faults.h"
#include "messages.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GUST_SUPERVISED_VALUES 32 /* measurements, at most */

/* Do not lead from INIT to SAFE: the converter, the bus or this program is only coming up. */
#define GUST_FAULTS_WAITING                                                                                    \
    ((uint32_t)GUST_FAULT_TIMEOUT | (uint32_t)GUST_FAULT_COUNTER | (uint32_t)GUST_FAULT_CRC |                  \
     (uint32_t)GUST_FAULT_LENGTH | (uint32_t)GUST_FAULT_STALE | (uint32_t)GUST_FAULT_BUS_OFF |                 \
     (uint32_t)GUST_FAULT_SEND | (uint32_t)GUST_FAULT_CONVERTER | (uint32_t)GUST_FAULT_DEADLINE |              \
     (uint32_t)GUST_FAULT_WATCHDOG | (uint32_t)GUST_FAULT_HEARTBEAT)

/* Periods are counted, not timed. gust_limits_default gives the values in brackets. */
typedef struct gust_limits {
    uint32_t missing; /* periods in a row without a fresh sample that are tolerated [2] */
    uint32_t drift;   /* samples that may come or be lost in a period beyond its own: two clocks that drift past
                         each other [1]; 0 where the converter's Sync is the clock */
    uint32_t deadlines;  /* periods that the loop may miss at a time [2] */
    uint32_t quiet;      /* periods without any fault before INIT or SAFE may be left [20] */
    uint32_t heartbeat;  /* periods without a heartbeat that are tolerated; 0: the database has none [300] */
    uint32_t set_points; /* the same of set-points; 0: the last ones stay for ever [0] */
    uint32_t errors;     /* steps in a row with an error signal that are tolerated [2] */
    uint32_t error_mask; /* bits that count: not 2, an output at its limit, nor 5, a table [0xffffffdb] */
    bool fingerprint;    /* the converter tells which database it has [true] */
    double rate[GUST_SUPERVISED_VALUES]; /* largest change of a measurement in a period; infinite: any
                                            [infinite] */
} gust_limits;

void gust_limits_default(gust_limits *limits);

/* What a period has brought. */
typedef struct gust_period {
    uint32_t periods; /* since the last call: 1, more if some were missed */
    bool sync;        /* a Sync came; true where the database has none */
    bool sample;      /* a complete good sample came */
    uint32_t lost;    /* samples that went missing before it, as the counters tell */
    int32_t lag;      /* Sync's number minus the sample's */
} gust_period;

typedef enum gust_command {
    GUST_COMMAND_NONE,
    GUST_COMMAND_START,
    GUST_COMMAND_STOP,
    GUST_COMMAND_RESET
} gust_command;

typedef enum gust_answer {
    GUST_ANSWER_DONE,
    GUST_ANSWER_REPEATED, /* the nonce is that of the last command */
    GUST_ANSWER_REFUSED   /* not in this state, or the cause of SAFE persists */
} gust_answer;

enum gust_converter_state {
    GUST_CONVERTER_OFF,
    GUST_CONVERTER_READY,
    GUST_CONVERTER_RUNNING,
    GUST_CONVERTER_TRIPPED
};

/* Owned by the caller; to be read by all, written by the functions below only. */
typedef struct gust_supervision {
    gust_limits limits;
    gust_state state;
    uint32_t faults;  /* that led to SAFE, or came after; 0 in the other states */
    bool fresh;       /* this period's sample is to be acted on */
    uint32_t elapsed; /* periods from the fresh sample before it */
    uint32_t silent;  /* periods since a fault was raised, or since the start */
    uint32_t missing; /* periods without a fresh sample */
    uint32_t unsynced;
    uint32_t causes;  /* why those samples were not fresh */
    uint32_t reasons; /* the same of this period's */
    uint32_t since_heartbeat;
    uint32_t since_set_points;
    uint32_t wrong_steps;
    bool sampled, heartbeat, known; /* heard at all; `known`: the fingerprint, and it is ours */
    bool stranger;                  /* the fingerprint is another one */
    bool ran;                       /* the converter has been running since the start */
    bool commanded;
    uint32_t nonce;
    uint32_t converter;
    bool measured;
    double last[GUST_SUPERVISED_VALUES];
} gust_supervision;

/* Begin in INIT. */
void gust_supervision_start(gust_supervision *s, const gust_limits *limits);

/* Faults that need no counting. */
void gust_supervision_raise(gust_supervision *s, uint32_t faults);

/* A frame failed a check. `cyclic`: it belongs to the samples, where CRC and length are counted with the
 * losses. Of other frames, those two are discarded and no more; what is wrong under a good CRC always is a
 * fault. */
void gust_supervision_reject(gust_supervision *s, gust_decoded why, bool cyclic);

/* A frame of the samples came for the second time. */
void gust_supervision_repeat(gust_supervision *s);

void gust_supervision_heartbeat(gust_supervision *s);
void gust_supervision_set_points(gust_supervision *s);
void gust_supervision_fingerprint(gust_supervision *s, bool ours);
void gust_supervision_converter(gust_supervision *s, uint32_t state);
gust_answer gust_supervision_command(gust_supervision *s, gust_command command, uint32_t nonce);

/* The end of a period: counts, judges, moves from INIT to READY. Then `state` and `fresh` are good. */
void gust_supervision_tick(gust_supervision *s, const gust_period *period);

/* Values of a fresh sample, before they are acted on: how fast they changed. */
void gust_supervision_measured(gust_supervision *s, const double *values, uint32_t n);

/* The error signal of a step. */
void gust_supervision_stepped(gust_supervision *s, uint32_t errors);

/* a - b of numbers that are counted modulo `modulus`, at most 2^32; from -modulus/2 to below modulus/2. */
int32_t gust_sample_difference(uint32_t a, uint32_t b, uint64_t modulus);

#ifdef __cplusplus
}
#endif

#endif
