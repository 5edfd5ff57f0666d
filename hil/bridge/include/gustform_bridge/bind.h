/* Which signal of the bus is which signal of a block, found by the names of quantities once, at the start. */
#ifndef GUSTFORM_BRIDGE_BIND_H
#define GUSTFORM_BRIDGE_BIND_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gust_controller.h"
#include "messages.h"
#include "sample.h"

#define GUST_SIGNALS 32 /* inputs or outputs of a block, at most */

/* Where the value of a signal of a block comes from or goes to. */
typedef struct gust_place {
    gust_part part;
    uint8_t piece;
    uint8_t signal;
} gust_place;

typedef struct gust_error {
    char text[256]; /* "GF8050: ...", a sentence and what to try */
} gust_error;

/* For each of `n` signals the one that brings it, in the first of the parts that has it. false: one of them has
 * none, and the error names it. */
bool gust_bind(const gust_message_set *set, const gust_controller_signal *signals, uint32_t n,
               const gust_part *parts, uint32_t n_parts, const char *role, gust_place *places,
               gust_error *error);

/* Values of a message of a part from the outputs of a block; quantities that it does not have keep the value of
 * least harm. */
void gust_bind_fill(const gust_message *message, const gust_place *places, uint32_t n, const double *outputs,
                    double *values);

/* The value of least harm of every signal. */
void gust_bind_safe(const gust_message *message, double *values);

/* Fails with a text. */
bool gust_fail(gust_error *error, const char *format, ...) __attribute__((format(printf, 2, 3)));

#endif
