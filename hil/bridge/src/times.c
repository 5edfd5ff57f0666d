#include "gustform_bridge/times.h"

#define NS_PER_US UINT64_C(1000)

void gust_times_add(gust_times *times, uint64_t ns)
{
    const uint64_t us = ns / NS_PER_US;
    ++times->n;
    ++times->bucket[us < GUST_TIMES_BUCKETS ? us : GUST_TIMES_BUCKETS - 1U];
    times->longest = ns > times->longest ? ns : times->longest;
}

uint32_t gust_times_quantile(const gust_times *times, double share)
{
    uint64_t below = 0;
    for (uint32_t k = 0; k < GUST_TIMES_BUCKETS; ++k) {
        below += times->bucket[k];
        if ((double)below >= share * (double)times->n) {
            return k;
        }
    }
    return GUST_TIMES_BUCKETS - 1U;
}
