/* The message set: what generated code tells about a CAN database, and the layer over cantools' pack and
 * unpack.
 *
 * The tables are generated from a DBC and its mapping.yaml (gustform_hil.c_messages); they are const and
 * nobody's to free. Physical values are double, in the units of the database. Decoding checks, in this order:
 * identifier, kind and length of the frame, CRC, multiplexer, finite, range. A value of a message that failed
 * any check is never written. Encoding cuts every value to the range of the database, NaN to the value of least
 * harm (`safe`), and says which. No function allocates, blocks or keeps a state.
 */
#ifndef GUSTFORM_BRIDGE_MESSAGES_H
#define GUSTFORM_BRIDGE_MESSAGES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "frame.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GUST_MESSAGE_SIGNALS 32 /* of one message, at most */

/* What a message is for. A part may have several messages (`piece` 0, 1, ...) where one frame is too short. */
typedef enum gust_part {
    GUST_PART_SYNC = 0,     /* one per period: the clock of the bus, with the sample number */
    GUST_PART_MEASUREMENTS, /* converter -> controller, each period */
    GUST_PART_REFERENCES,   /* controller -> converter, each period: commands and whether they are enabled */
    GUST_PART_SET_POINTS,   /* operator or plant -> controller */
    GUST_PART_CONTROLLER_STATE,     /* controller -> all, cyclic and at once on a change */
    GUST_PART_CONVERTER_STATE,      /* converter -> all */
    GUST_PART_OPERATOR_COMMAND,     /* operator -> controller: start, stop, reset */
    GUST_PART_EMERGENCY_STOP,       /* anyone -> all */
    GUST_PART_PARAMETER_REQUEST,    /* operator -> controller; multiplexed: read, write, activate */
    GUST_PART_PARAMETER_RESPONSE,   /* controller -> operator */
    GUST_PART_CONTROLLER_HEARTBEAT, /* controller -> all */
    GUST_PART_CONVERTER_HEARTBEAT,  /* converter -> all */
    GUST_PART_CONTROLLER_FINGERPRINT,
    GUST_PART_CONVERTER_FINGERPRINT, /* which database the sender was built with */
    GUST_N_PARTS
} gust_part;

/* What a signal means within its part. */
typedef enum gust_field {
    GUST_FIELD_QUANTITY = 0, /* a signal of the controller or the plant, named by `quantity` */
    GUST_FIELD_E2E_CRC,      /* written and checked by the layer */
    GUST_FIELD_E2E_COUNTER,  /* the same */
    GUST_FIELD_SAMPLE,      /* number of the sample, modulo the range of the signal; of references: of what they
                               answer */
    GUST_FIELD_ENABLE,      /* references: 1, act on it; 0, block the converter */
    GUST_FIELD_STATE,       /* enum gust_state, or the converter's: 0 off, 1 ready, 2 running, 3 tripped */
    GUST_FIELD_FAULTS,      /* bits of enum gust_fault that led to SAFE */
    GUST_FIELD_ERRORS,      /* error signal of the controller's last step */
    GUST_FIELD_COMMAND,     /* operator: 0 none, 1 start, 2 stop, 3 reset; emergency stop: 1 */
    GUST_FIELD_NONCE,       /* operator: changes with each command, so that a repeat is not a second one */
    GUST_FIELD_OPERATION,   /* parameters, the multiplexer: 0 read, 1 write, 2 activate */
    GUST_FIELD_PARAMETER,   /* stable id of a parameter */
    GUST_FIELD_VALUE,       /* of the parameter */
    GUST_FIELD_RESULT,      /* response: 0 done, 1 unknown id, 2 out of range, 3 not in this state */
    GUST_FIELD_UPTIME,      /* heartbeat, s */
    GUST_FIELD_FINGERPRINT, /* of the database */
    GUST_N_FIELDS
} gust_field;

typedef struct gust_signal {
    const char *name;
    const char *unit;
    const char *quantity; /* "v_dc", "omega_gsc" ...; "" for other fields */
    gust_field field;
    double low, high;    /* range of the database */
    double safe;         /* what is sent for NaN and in SAFE */
    int32_t multiplexed; /* value of the multiplexer it is there for; -1: always */
} gust_signal;

typedef struct gust_e2e {
    uint8_t profile;     /* 0: none; 1, 2, 5 of AUTOSAR E2E */
    uint16_t data_id;    /* profiles 1 and 5 */
    const uint8_t *list; /* 16 data ids of profile 2; NULL otherwise */
} gust_e2e;

typedef struct gust_message {
    const char *name;
    uint32_t id;
    uint8_t flags; /* GUST_FRAME_FD, GUST_FRAME_EXTENDED */
    uint8_t length;
    uint8_t n_signals;
    gust_part part;
    uint8_t piece;
    int8_t multiplexer; /* number of the signal that is the multiplexer; -1: none */
    uint32_t cycle;     /* us; 0: on events */
    gust_e2e e2e;
    const gust_signal *signals;
    /* cantools' pack and unpack between physical values, in the order of `signals`, and bytes. Signals of other
     * multiplexer values are left alone. false: unknown multiplexer. */
    bool (*pack)(const double *values, uint8_t *data);
    bool (*unpack)(const uint8_t *data, double *values);
} gust_message;

typedef struct gust_message_set {
    const char *name;
    uint32_t fingerprint; /* CRC-32 of what the database says of ids, layouts, ranges and E2E */
    uint16_t n_messages;
    const gust_message *messages; /* by ascending identifier */
} gust_message_set;

/* The generated one. */
extern const gust_message_set gust_messages;

typedef enum gust_decoded {
    GUST_DECODED = 0,
    GUST_UNKNOWN_ID,   /* not in the database: none of our business */
    GUST_WRONG_LENGTH, /* length, classic instead of FD or the reverse, remote frame */
    GUST_BAD_CRC,
    GUST_UNKNOWN_MULTIPLEXER,
    GUST_NOT_FINITE,  /* a value is NaN or infinite, and the CRC is good */
    GUST_OUT_OF_RANGE /* a value is outside of the database's range, and the CRC is good */
} gust_decoded;

/* `*message`: what the identifier stands for, also when another check failed; NULL for an unknown one.
 * `values`: one for each of its signals, written only for GUST_DECODED; those of other multiplexer values
 * become 0. `counter`: of the E2E header, written from GUST_BAD_CRC on excluded; 0 without E2E. */
gust_decoded gust_message_decode(const gust_message_set *set, const gust_frame *frame,
                                 const gust_message **message, double values[GUST_MESSAGE_SIGNALS],
                                 uint8_t *counter);

/* The frame of a message, protected with `counter`, which is taken modulo what the profile counts. Bit k of the
 * result: value k was not finite or out of its range and was cut. An unknown multiplexer value gives a frame of
 * length 0 and all bits, which is not to be sent. */
uint32_t gust_message_encode(const gust_message *message, const double values[GUST_MESSAGE_SIGNALS],
                             uint8_t counter, gust_frame *frame);

/* The message of a part, NULL if the database has none; piece 0 if it has one message. */
const gust_message *gust_message_find(const gust_message_set *set, gust_part part, uint8_t piece);

/* Number of the signal with this field (and quantity, unless that is NULL); -1: none. */
int gust_message_signal(const gust_message *message, gust_field field, const char *quantity);

/* How far `counter` is ahead of `last` in the profile of the message: 0 a repeat, 1 the next one. */
uint8_t gust_message_ahead(const gust_message *message, uint8_t last, uint8_t counter);

#ifdef __cplusplus
}
#endif

#endif
