/* What a node of the bus keeps of its messages: counters both ways, own frames on their way, what was wrong.
 *
 * Owned by the caller; the message set and the transport must outlive it. Nothing allocates or blocks. One
 * thread, except gust_link_protect, which any thread may call: it gives each frame of a message the next
 * counter.
 */
#ifndef GUSTFORM_BRIDGE_LINK_H
#define GUSTFORM_BRIDGE_LINK_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "messages.h"
#include "transport.h"

#define GUST_LINK_MESSAGES 64 /* of a database, at most */

typedef struct gust_counts {
    uint64_t received; /* frames of others that the database knows */
    uint64_t sent;
    uint64_t echoed;  /* own frames that have left */
    uint64_t unknown; /* frames that are not in the database */
    uint64_t wrong_length;
    uint64_t bad_crc;
    uint64_t unknown_multiplexer;
    uint64_t not_finite;
    uint64_t out_of_range;
    uint64_t repeated;
    uint64_t lost;     /* as the counters tell */
    uint64_t not_sent; /* the transport was full or down */
    uint64_t cut;      /* frames sent in which a value was cut to its range */
    uint64_t errors;   /* error frames */
} gust_counts;

typedef struct gust_link_message {
    bool heard;
    uint8_t last;             /* counter of the last good frame */
    _Atomic uint32_t counter; /* of the next own frame */
    _Atomic uint32_t
        other_thread; /* frames that another socket of this node has sent, to be taken for our own */
    uint32_t due;     /* periods until it is to be sent again */
} gust_link_message;

typedef struct gust_link {
    const gust_message_set *set;
    gust_transport *transport;
    uint64_t period;    /* ns */
    uint32_t own;       /* bit of each part that this node alone may send */
    uint32_t under_way; /* own references or measurements that have not left yet */
    gust_part watched;  /* the part that `under_way` counts */
    gust_counts counts;
    gust_link_message message[GUST_LINK_MESSAGES];
} gust_link;

typedef enum gust_heard {
    GUST_HEARD_NOTHING, /* not ours to judge, or an echo of our own */
    GUST_HEARD_GOOD,
    GUST_HEARD_REPEAT, /* good, but its counter is that of the last one */
    GUST_HEARD_BAD,    /* `result` tells why */
    GUST_HEARD_MASQUERADE,
    GUST_HEARD_BUS_OFF,
    GUST_HEARD_NOT_SENT /* the driver gave up a frame */
} gust_heard;

typedef struct gust_received {
    const gust_message *message;
    gust_decoded result;
    uint32_t lost; /* frames of this message before this one, as its counter tells */
    double values[GUST_MESSAGE_SIGNALS];
} gust_received;

/* false: the database has more messages than GUST_LINK_MESSAGES, or one with more signals than
 * GUST_MESSAGE_SIGNALS. */
bool gust_link_init(gust_link *link, const gust_message_set *set, gust_transport *transport, uint64_t period);

gust_heard gust_link_receive(gust_link *link, const gust_frame *frame, gust_received *received);

/* Encode, protect, hand over. `*cut`: bits of the values that were cut to the database's range, NaN among them.
 */
gust_transport_status gust_link_send(gust_link *link, const gust_message *message, const double *values,
                                     uint32_t *cut);

/* The frame alone, with the next counter; bits of what was cut. */
uint32_t gust_link_protect(gust_link *link, const gust_message *message, const double *values,
                           gust_frame *frame);

/* Whether a cyclic message is to be sent after `periods` more; never for one without a cycle. */
bool gust_link_due(gust_link *link, const gust_message *message, uint32_t periods);

/* Number of a message within its set. */
uint32_t gust_link_number(const gust_link *link, const gust_message *message);

/* Set all signals of a field. */
void gust_link_put(const gust_message *message, double *values, gust_field field, double value);

/* The first signal of a field; `otherwise` if there is none. */
double gust_link_get(const gust_message *message, const double *values, gust_field field, double otherwise);

/* How many numbers a signal counts before it begins anew: of sample numbers. 0: there is no such signal. */
uint64_t gust_link_modulus(const gust_message *message, gust_field field);

#endif
