/* CLOCK_MONOTONIC in ns, and threads with a priority. */
#ifndef GUSTFORM_BRIDGE_CLOCK_H
#define GUSTFORM_BRIDGE_CLOCK_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

uint64_t gust_clock_now(void);

/* Until `time`, whatever interrupts. */
void gust_clock_sleep(uint64_t time);

/* A thread of SCHED_FIFO with `priority`, or an ordinary one if that is 0 or not allowed; `*real_time` tells
 * which. false: no thread at all. `*real_time` may be NULL. */
bool gust_clock_thread(pthread_t *thread, void *(*run)(void *), void *context, int priority, bool *real_time);

#endif
