#include "gustform_bridge/messages.h"

#include <math.h>
#include <string.h>

#include "e2e.h"

static bool is_header(const gust_signal *signal)
{
    return signal->field == GUST_FIELD_E2E_CRC || signal->field == GUST_FIELD_E2E_COUNTER;
}

/* Whether a signal is there while the multiplexer is `code`. */
static bool is_there(const gust_signal *signal, int32_t code)
{
    return signal->multiplexed < 0 || signal->multiplexed == code;
}

/* Identifier and kind as one number, by which the table ascends. */
static uint64_t key(uint32_t id, uint32_t flags)
{
    return ((uint64_t)id << 1) | ((flags & GUST_FRAME_EXTENDED) != 0U ? 1U : 0U);
}

static const gust_message *by_id(const gust_message_set *set, const gust_frame *frame)
{
    const uint64_t wanted = key(frame->id, frame->flags);
    size_t low = 0;
    size_t high = set->n_messages;

    if ((frame->flags & GUST_FRAME_ERROR) != 0U) {
        return NULL; /* its identifier is a set of error bits */
    }
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        const gust_message *const message = &set->messages[middle];
        if (key(message->id, message->flags) < wanted) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    if (low == set->n_messages || key(set->messages[low].id, set->messages[low].flags) != wanted) {
        return NULL;
    }
    return &set->messages[low];
}

static bool is_kind(const gust_message *message, const gust_frame *frame)
{
    const uint32_t kind = GUST_FRAME_FD | GUST_FRAME_REMOTE;

    return frame->length == message->length && (frame->flags & kind) == (message->flags & kind);
}

/* The value of the multiplexer as a whole number; -1: it is none, or there is no multiplexer. */
static int32_t multiplexer_code(const gust_message *message, const double *values)
{
    if (message->multiplexer < 0) {
        return -1;
    }
    const double value = values[message->multiplexer];
    if (!(value >= 0.0 && value <= 65535.0) || value != floor(value)) {
        return -1;
    }
    return (int32_t)value;
}

static gust_decoded check_values(const gust_message *message, const double *values, int32_t code)
{
    gust_decoded result = GUST_DECODED;

    for (size_t k = 0; k < message->n_signals; k++) {
        const gust_signal *const signal = &message->signals[k];
        if (is_header(signal) || !is_there(signal, code)) {
            continue;
        }
        if (!isfinite(values[k])) {
            return GUST_NOT_FINITE;
        }
        if (!(values[k] >= signal->low && values[k] <= signal->high)) {
            result = GUST_OUT_OF_RANGE;
        }
    }
    return result;
}

gust_decoded gust_message_decode(const gust_message_set *set, const gust_frame *frame,
                                 const gust_message **message, double values[GUST_MESSAGE_SIGNALS],
                                 uint8_t *counter)
{
    double found[GUST_MESSAGE_SIGNALS] = {0.0};
    const gust_message *const m = by_id(set, frame);

    *message = m;
    if (m == NULL) {
        return GUST_UNKNOWN_ID;
    }
    if (!is_kind(m, frame)) {
        return GUST_WRONG_LENGTH;
    }
    if (!gust_e2e_good(&m->e2e, frame->data, m->length, counter)) {
        return GUST_BAD_CRC;
    }
    if (!m->unpack(frame->data, found)) {
        return GUST_UNKNOWN_MULTIPLEXER;
    }
    const gust_decoded result = check_values(m, found, multiplexer_code(m, found));
    if (result == GUST_DECODED) {
        memcpy(values, found, m->n_signals * sizeof found[0]);
    }
    return result;
}

/* The value as it may be sent, and whether it had to be cut. */
static bool cut(const gust_signal *signal, double *value)
{
    if (isnan(*value)) {
        *value = signal->safe;
    } else if (*value < signal->low) {
        *value = signal->low;
    } else if (*value > signal->high) {
        *value = signal->high;
    } else {
        return false;
    }
    return true;
}

uint32_t gust_message_encode(const gust_message *message, const double values[GUST_MESSAGE_SIGNALS],
                             uint8_t counter, gust_frame *frame)
{
    double sent[GUST_MESSAGE_SIGNALS] = {0.0};
    const int32_t code = multiplexer_code(message, values);
    uint32_t flagged = 0;

    memset(frame, 0, sizeof *frame);
    frame->id = message->id;
    frame->flags = message->flags;
    for (size_t k = 0; k < message->n_signals; k++) {
        const gust_signal *const signal = &message->signals[k];
        if (is_header(signal) || !is_there(signal, code)) {
            continue;
        }
        sent[k] = values[k];
        if (cut(signal, &sent[k])) {
            flagged |= UINT32_C(1) << k;
        }
    }
    if (message->multiplexer >= 0 && code < 0) {
        return UINT32_MAX;
    }
    if (message->multiplexer >= 0) {
        sent[message->multiplexer] = code; /* not cut: one that is not known is told, not turned into another */
    }
    if (!message->pack(sent, frame->data)) {
        return UINT32_MAX;
    }
    frame->length = message->length;
    gust_e2e_protect(&message->e2e, frame->data, message->length, counter);
    return flagged;
}

const gust_message *gust_message_find(const gust_message_set *set, gust_part part, uint8_t piece)
{
    for (size_t k = 0; k < set->n_messages; k++) {
        if (set->messages[k].part == part && set->messages[k].piece == piece) {
            return &set->messages[k];
        }
    }
    return NULL;
}

int gust_message_signal(const gust_message *message, gust_field field, const char *quantity)
{
    for (int k = 0; k < message->n_signals; k++) {
        const gust_signal *const signal = &message->signals[k];
        if (signal->field == field && (quantity == NULL || strcmp(signal->quantity, quantity) == 0)) {
            return k;
        }
    }
    return -1;
}

uint8_t gust_message_ahead(const gust_message *message, uint8_t last, uint8_t counter)
{
    const uint16_t modulo = gust_e2e_modulo(&message->e2e);

    if (modulo == 1) {
        return 1; /* nothing counts: each frame is the next one */
    }
    return (uint8_t)((counter % modulo + modulo - last % modulo) % modulo);
}
