/* What the targets that hear sequences have in common: bytes of the fuzzer's input become frames. */
#ifndef GUST_FUZZ_RECORDS_H
#define GUST_FUZZ_RECORDS_H

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "e2e.h"
#include "gustform_bridge/messages.h"

enum { RECORDS_MESSAGES = 64 };

typedef struct reader {
    const uint8_t *next;
    size_t left;
    uint8_t counter[RECORDS_MESSAGES]; /* of each message */
} reader;

static inline void check(bool good)
{
    if (!good)
        abort();
}

static inline uint8_t take(reader *r)
{
    if (r->left == 0)
        return 0;
    r->left--;
    return *r->next++;
}

static inline void take_bytes(reader *r, uint8_t *bytes, size_t n)
{
    for (size_t k = 0; k < n; k++)
        bytes[k] = take(r);
}

/* A frame of the message set under a good CRC and the next counter; with the high bit of `op`, of another one.
 */
static inline gust_frame good_frame(reader *r, uint8_t op)
{
    const size_t number = take(r) % gust_messages.n_messages;
    const gust_message *const message = &gust_messages.messages[number];
    gust_frame frame = {.id = message->id, .flags = message->flags, .length = message->length};

    take_bytes(r, frame.data, message->length);
    r->counter[number] = (uint8_t)(r->counter[number] + ((op & 0x80U) != 0 ? op >> 4 & 7U : 1U));
    gust_e2e_protect(&message->e2e, frame.data, frame.length, r->counter[number]);
    return frame;
}

static inline gust_frame any_frame(reader *r)
{
    gust_frame frame = {.flags = take(r) & 0x1FU};

    take_bytes(r, (uint8_t *)&frame.id, sizeof frame.id);
    frame.length = take(r) % (GUST_FRAME_DATA + 1);
    take_bytes(r, frame.data, frame.length);
    return frame;
}

#endif
