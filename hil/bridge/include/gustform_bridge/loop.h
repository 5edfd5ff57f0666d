/* Periods: who ticks the bridge, and when.
 *
 * monotonic: deadlines are absolute, one period apart; what comes too late is counted as missed and never
 * caught up. synchronous: each Sync is the end of a period; when none comes for `patience`, the bridge is
 * ticked without one, so that it sees the loss.
 */
#ifndef GUSTFORM_BRIDGE_LOOP_H
#define GUSTFORM_BRIDGE_LOOP_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "bridge.h"
#include "times.h"
#include "transport.h"
#include "watchdog.h"

#define GUST_LOOP_EVENTS 256

typedef struct gust_event {
    uint64_t time; /* ns of CLOCK_MONOTONIC */
    gust_state state;
    uint32_t faults;
    uint32_t sample;
} gust_event;

typedef struct gust_loop {
    gust_bridge *bridge;
    gust_transport *transport;
    gust_watchdog *watchdog; /* NULL: none */
    uint64_t patience;       /* ns */
    int wake;                /* descriptor of an eventfd that tells of new events; -1: none */
    atomic_bool stop;
    /* Written by the loop, read by whoever prints: events[n % GUST_LOOP_EVENTS] up to `n_events`. */
    gust_event events[GUST_LOOP_EVENTS];
    _Atomic uint64_t n_events;
    /* Read after the loop has ended, or as a rough picture before. */
    _Atomic uint64_t periods;
    uint64_t missed;
    uint64_t latest;     /* longest lateness of a tick after its deadline, ns */
    gust_times lateness; /* all of them; monotonic */
    uint64_t drained;    /* largest number of frames in one period */
    gust_times response; /* from the frame that began a tick to its references; monotonic: from the deadline */
} gust_loop;

/* Until `stop`; then SAFE references are sent. */
void gust_loop_run(gust_loop *loop);

#endif
