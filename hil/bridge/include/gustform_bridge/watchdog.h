/* The watchdog: a thread with a deadline of its own and a transport of its own.
 *
 * The loop serves it once a period. When it is not served in time it latches the fault WATCHDOG, so that the
 * loop finds itself in SAFE whenever it comes back, and sends SAFE references in each period until it is served
 * again. It does not wait for the loop and takes no lock: a frame that the loop is handing over in that very
 * moment may still leave.
 *
 * Owned by the caller; bridge and transport must outlive it. Only the start allocates (the thread's stack).
 */
#ifndef GUSTFORM_BRIDGE_WATCHDOG_H
#define GUSTFORM_BRIDGE_WATCHDOG_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "bind.h"
#include "bridge.h"
#include "transport.h"

typedef struct gust_watchdog {
    gust_bridge *bridge;
    gust_transport *transport;
    uint64_t timeout; /* ns */
    uint64_t period;  /* ns between SAFE references */
    _Atomic uint64_t deadline;
    _Atomic uint64_t fired; /* times */
    _Atomic uint64_t sent;  /* frames */
    atomic_bool stop;
    pthread_t thread;
} gust_watchdog;

/* `priority`: of SCHED_FIFO, 0 for none. */
bool gust_watchdog_start(gust_watchdog *watchdog, gust_bridge *bridge, gust_transport *transport,
                         uint64_t timeout, int priority, gust_error *error);

void gust_watchdog_serve(gust_watchdog *watchdog);

/* Ends the thread. */
void gust_watchdog_stop(gust_watchdog *watchdog);

/* One look at the clock, as the thread does it: when to look again, ns of CLOCK_MONOTONIC. */
uint64_t gust_watchdog_look(gust_watchdog *watchdog, uint64_t now);

#endif
