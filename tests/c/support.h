/* What the tests of whole simulations share. */
#ifndef GUSTFORM_TEST_SUPPORT_H
#define GUSTFORM_TEST_SUPPORT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "gustform/gust_sim.h"
#include "system_builder.h"

/* A simulation with this tolerance, not yet initialised. */
gust_sim *new_sim(const gust_model *model, double rtol);

/* Initialises, or advances to `until` and no less; a test failure with the message if not. */
void initialise(gust_sim *sim, double t0);
void advance(gust_sim *sim, double until);

/* The unknowns at the time reached. */
void unknowns(gust_sim *sim, double *y);

/* |value - expected| <= relative * max(|expected|, 1e-3): small numbers are not asked for more digits. */
void assert_close(double value, double expected, double relative, const char *what);

/* message must contain part. */
void assert_says(const char *message, const char *part);

/* Rows received by collect(). */
enum { RECORD_ROWS = 4096, RECORD_CHANNELS = 8 };

typedef struct record {
    int32_t n_channels;
    int64_t rows;
    int64_t blocks;
    int64_t largest_block;
    double time[RECORD_ROWS];
    float value[RECORD_ROWS][RECORD_CHANNELS];
    int answer;         /* what collect() returns ... */
    int64_t answer_row; /* ... once it has this many rows */
} record;

int collect(void *context, int64_t rows, const double *time, const float *values);

#endif
