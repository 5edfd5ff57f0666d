#include "gustform_bridge/link.h"

#include <math.h>
#include <string.h>

/* Classes of error frames, those of linux/can/error.h. */
#define ERROR_TX_TIMEOUT UINT32_C(0x1)
#define ERROR_BUS_OFF    UINT32_C(0x40)

/* Profile 5 counts 256, profile 2 counts 16, profile 1 counts 15; the last holds whole cycles of all of them.
 */
#define COUNTER_CYCLE_5   256U
#define COUNTER_CYCLE_1_2 240U
#define COUNTER_CYCLE     3840U

#define NS_PER_US UINT64_C(1000)

bool gust_link_init(gust_link *link, const gust_message_set *set, gust_transport *transport, uint64_t period)
{
    memset(link, 0, sizeof *link);
    link->set = set;
    link->transport = transport;
    link->period = period;
    bool fits = set->n_messages <= GUST_LINK_MESSAGES;
    for (uint32_t k = 0; k < set->n_messages; ++k) {
        fits = fits && set->messages[k].n_signals <= GUST_MESSAGE_SIGNALS;
    }
    return fits;
}

uint32_t gust_link_number(const gust_link *link, const gust_message *message)
{
    return (uint32_t)(message - link->set->messages);
}

static bool own(const gust_link *link, const gust_message *message)
{
    return (link->own >> (uint32_t)message->part & 1U) != 0;
}

static gust_heard hear_error(gust_link *link, const gust_frame *frame)
{
    ++link->counts.errors;
    if ((frame->id & ERROR_BUS_OFF) != 0) {
        return GUST_HEARD_BUS_OFF;
    }
    return (frame->id & ERROR_TX_TIMEOUT) != 0 ? GUST_HEARD_NOT_SENT : GUST_HEARD_NOTHING;
}

static void hear_echo(gust_link *link, const gust_message *message)
{
    ++link->counts.echoed;
    if (message != NULL && message->part == link->watched && link->under_way > 0) {
        --link->under_way;
    }
}

/* A frame that only this node may send came from elsewhere: from another socket of ours, or from a stranger. */
static gust_heard hear_own_identifier(gust_link_message *state)
{
    uint32_t ours = atomic_load(&state->other_thread);
    while (ours > 0) {
        if (atomic_compare_exchange_weak(&state->other_thread, &ours, ours - 1U)) {
            return GUST_HEARD_NOTHING;
        }
    }
    return GUST_HEARD_MASQUERADE;
}

static void count_bad(gust_counts *counts, gust_decoded result)
{
    uint64_t *const counter[] = {[GUST_WRONG_LENGTH] = &counts->wrong_length,
                                 [GUST_BAD_CRC] = &counts->bad_crc,
                                 [GUST_UNKNOWN_MULTIPLEXER] = &counts->unknown_multiplexer,
                                 [GUST_NOT_FINITE] = &counts->not_finite,
                                 [GUST_OUT_OF_RANGE] = &counts->out_of_range};
    ++*counter[result];
}

static gust_heard hear_good(gust_link *link, gust_received *received, uint8_t counter)
{
    gust_link_message *state = &link->message[gust_link_number(link, received->message)];
    const bool counted = received->message->e2e.profile != 0;
    const uint8_t ahead =
        counted && state->heard ? gust_message_ahead(received->message, state->last, counter) : 1U;
    state->heard = true;
    state->last = counter;
    if (ahead == 0) {
        ++link->counts.repeated;
        return GUST_HEARD_REPEAT;
    }
    received->lost = (uint32_t)ahead - 1U;
    link->counts.lost += received->lost;
    return GUST_HEARD_GOOD;
}

gust_heard gust_link_receive(gust_link *link, const gust_frame *frame, gust_received *received)
{
    if ((frame->flags & GUST_FRAME_ERROR) != 0) {
        return hear_error(link, frame);
    }
    uint8_t counter = 0;
    received->message = NULL;
    received->lost = 0;
    received->result = gust_message_decode(link->set, frame, &received->message, received->values, &counter);
    if ((frame->flags & GUST_FRAME_OWN) != 0) {
        hear_echo(link, received->message);
        return GUST_HEARD_NOTHING;
    }
    if (received->message == NULL) {
        ++link->counts.unknown;
        return GUST_HEARD_NOTHING;
    }
    ++link->counts.received;
    if (own(link, received->message)) {
        return hear_own_identifier(&link->message[gust_link_number(link, received->message)]);
    }
    if (received->result != GUST_DECODED) {
        count_bad(&link->counts, received->result);
        return GUST_HEARD_BAD;
    }
    return hear_good(link, received, counter);
}

uint32_t gust_link_protect(gust_link *link, const gust_message *message, const double *values,
                           gust_frame *frame)
{
    _Atomic uint32_t *counter = &link->message[gust_link_number(link, message)].counter;
    uint32_t now = atomic_load(counter);
    while (!atomic_compare_exchange_weak(counter, &now, (now + 1U) % COUNTER_CYCLE)) {
    }
    /* Whole cycles of what the profile counts must fit into what is handed over, too. */
    const uint32_t cycle = message->e2e.profile == 5 ? COUNTER_CYCLE_5 : COUNTER_CYCLE_1_2;
    return gust_message_encode(message, values, (uint8_t)(now % cycle), frame);
}

gust_transport_status gust_link_send(gust_link *link, const gust_message *message, const double *values,
                                     uint32_t *cut)
{
    gust_frame frame;
    *cut = gust_link_protect(link, message, values, &frame);
    if (*cut != 0) {
        ++link->counts.cut;
    }
    if (frame.length == 0) {
        ++link->counts.not_sent; /* an unknown multiplexer: nothing that could be sent */
        return GUST_TRANSPORT_OK;
    }
    const gust_transport_status status = link->transport->send(link->transport, &frame);
    if (status != GUST_TRANSPORT_OK) {
        ++link->counts.not_sent;
        return status;
    }
    ++link->counts.sent;
    if (message->part == link->watched) {
        ++link->under_way;
    }
    return status;
}

bool gust_link_due(gust_link *link, const gust_message *message, uint32_t periods)
{
    gust_link_message *state = &link->message[gust_link_number(link, message)];
    if (message->cycle == 0) {
        return false;
    }
    if (state->due > periods) {
        state->due -= periods;
        return false;
    }
    const uint64_t cycle = message->cycle * NS_PER_US / link->period;
    state->due = cycle > 0 ? (uint32_t)cycle : 1U;
    return true;
}

void gust_link_put(const gust_message *message, double *values, gust_field field, double value)
{
    for (uint32_t k = 0; k < message->n_signals; ++k) {
        if (message->signals[k].field == field) {
            values[k] = value;
        }
    }
}

double gust_link_get(const gust_message *message, const double *values, gust_field field, double otherwise)
{
    const int k = gust_message_signal(message, field, NULL);
    return k < 0 ? otherwise : values[k];
}

uint64_t gust_link_modulus(const gust_message *message, gust_field field)
{
    const int k = gust_message_signal(message, field, NULL);
    return k < 0 ? 0 : (uint64_t)message->signals[k].high + 1U;
}
