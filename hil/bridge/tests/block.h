/* A controller of the tests' own behind gust_controller.h: droop of the frequency on the DC voltage, and a
 * pitch that integrates the overspeed. In double, so that what it does can be followed to the last bit. */
#ifndef GUST_TEST_BLOCK_H
#define GUST_TEST_BLOCK_H

#include "gust_controller.h"

enum { TEST_K_DROOP = 101, TEST_K_PITCH = 102 }; /* ids of the parameters */

extern const gust_controller test_controller;

/* The next `n` steps of a context answer with these error bits; the outputs stay. */
void test_controller_fail(void *context, uint32_t n, uint32_t errors);

/* From now on the outputs are this value, whatever the inputs: what a broken controller may do. NaN allowed. */
void test_controller_break(void *context, double value);

#endif
