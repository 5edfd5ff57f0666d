/* Times in buckets of 1 us, for medians and quantiles without storing any. Owned by the caller, no allocation.
 */
#ifndef GUSTFORM_BRIDGE_TIMES_H
#define GUSTFORM_BRIDGE_TIMES_H

#include <stdint.h>

#define GUST_TIMES_BUCKETS 8192 /* the last holds all that are longer */

typedef struct gust_times {
    uint64_t n;
    uint64_t longest; /* ns */
    uint32_t bucket[GUST_TIMES_BUCKETS];
} gust_times;

void gust_times_add(gust_times *times, uint64_t ns);

/* The time, in whole us, that a share of all keeps; 0 if there are none. */
uint32_t gust_times_quantile(const gust_times *times, double share);

#endif
