/* libFuzzer on gust_message_decode: whatever comes from the bus, nothing is read or written out of bounds, what
 * is taken is finite and within its range, and it survives being encoded again.
 *
 * Input: flags of the frame with, above them, "make the CRC right" and "take the message's own kind and
 * length"; two bytes that choose the identifier; the data. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "e2e.h"
#include "gustform_bridge/messages.h"

enum { HEAD = 3, OWN_KIND = 0x40, GOOD_CRC = 0x80, ANY_ID = 0x20 };

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size);

static void check(bool good)
{
    if (!good)
        abort();
}

static void check_values(const gust_message *message, const double *values)
{
    for (size_t k = 0; k < message->n_signals; k++) {
        const gust_signal *const signal = &message->signals[k];
        check(isfinite(values[k]));
        if (message->multiplexer >= 0 && signal->multiplexed >= 0 &&
            signal->multiplexed != (int32_t)values[message->multiplexer]) {
            check(values[k] == 0.0);
            continue;
        }
        if (signal->field != GUST_FIELD_E2E_CRC && signal->field != GUST_FIELD_E2E_COUNTER)
            check(values[k] >= signal->low && values[k] <= signal->high);
    }
}

static void check_round_trip(const gust_message *message, const double *values, uint8_t counter)
{
    gust_frame again;
    const gust_message *other = NULL;
    double same[GUST_MESSAGE_SIGNALS];
    uint8_t count = 0;

    check(gust_message_encode(message, values, counter, &again) == 0);
    check(gust_message_decode(&gust_messages, &again, &other, same, &count) == GUST_DECODED);
    check(other == message && count == counter);
    for (size_t k = 0; k < message->n_signals; k++) {
        /* Bits of no signal are sent as 0, so the CRC may be another one. */
        if (message->signals[k].field != GUST_FIELD_E2E_CRC)
            check(memcmp(&same[k], &values[k], sizeof same[k]) == 0);
    }
}

static void prepare(gust_frame *frame, const uint8_t *input, size_t size)
{
    const uint32_t choice = (uint32_t)input[1] | (uint32_t)input[2] << 8;
    const gust_message *const message = &gust_messages.messages[choice % gust_messages.n_messages];
    const size_t length = size - HEAD < GUST_FRAME_DATA ? size - HEAD : GUST_FRAME_DATA;

    memset(frame, 0, sizeof *frame);
    memcpy(frame->data, input + HEAD, length);
    frame->id = (input[0] & ANY_ID) != 0 ? choice : message->id;
    frame->flags = input[0] & 0x1FU;
    frame->length = (uint8_t)length;
    if ((input[0] & OWN_KIND) != 0) {
        frame->flags = message->flags;
        frame->length = message->length;
    }
    if ((input[0] & GOOD_CRC) != 0)
        gust_e2e_protect(&message->e2e, frame->data, frame->length, frame->data[2]);
}

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size)
{
    gust_frame frame;
    const gust_message *message = NULL;
    double values[GUST_MESSAGE_SIGNALS];
    uint8_t counter = 0;

    if (size < HEAD)
        return 0;
    prepare(&frame, input, size);
    const gust_decoded result = gust_message_decode(&gust_messages, &frame, &message, values, &counter);
    check((result == GUST_UNKNOWN_ID) == (message == NULL));
    if (result == GUST_DECODED) {
        check(frame.length == message->length && frame.id == message->id);
        check((frame.flags & ~(uint32_t)GUST_FRAME_OWN) == message->flags);
        check_values(message, values);
        check_round_trip(message, values, counter);
    }
    return 0;
}
