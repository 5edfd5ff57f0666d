/* One sample of a part, collected from its messages: where frames are short, a sample comes in several pieces.
 *
 * A sample is complete when all its pieces have come with the same number. Then its values stay as they are
 * until the next one is complete, so that nothing is ever made of two samples. Owned by the caller, no
 * allocation.
 */
#ifndef GUSTFORM_BRIDGE_SAMPLE_H
#define GUSTFORM_BRIDGE_SAMPLE_H

#include <stdbool.h>
#include <stdint.h>

#include "messages.h"

#define GUST_PIECES 8 /* of a part, at most */

typedef struct gust_piece {
    const gust_message *message;
    bool here; /* has come, and no newer number has */
    uint32_t number;
    uint32_t lost; /* frames since the last complete sample was taken */
    double values[GUST_MESSAGE_SIGNALS];
} gust_piece;

typedef struct gust_sample {
    uint32_t n; /* pieces; 0: the database does not have this part */
    gust_piece piece[GUST_PIECES];
    uint64_t modulus; /* of the numbers; 0: they are not sent, and counted here */
    bool complete;    /* since gust_sample_take */
    uint32_t number;  /* of the last complete one */
    uint32_t lost;
    double values[GUST_PIECES][GUST_MESSAGE_SIGNALS];
} gust_sample;

/* false: the database has more messages for this part than GUST_PIECES. */
bool gust_sample_init(gust_sample *sample, const gust_message_set *set, gust_part part);

/* A good frame of one of the messages. */
void gust_sample_add(gust_sample *sample, const gust_message *message, const double *values, uint32_t lost);

/* Whether a sample was completed since the last call, and how many were lost before it. */
bool gust_sample_take(gust_sample *sample, uint32_t *lost);

#endif
