#include "gustform_bridge/loop.h"

#include <unistd.h>

#include "gustform_bridge/clock.h"

#define NS_PER_US UINT64_C(1000)

/* Frames taken in one period at most: a babbling node shall not keep the loop from its deadline. */
#define FRAMES_PER_PERIOD 1024U

/* How long a synchronous loop sleeps at most before it serves the watchdog. */
#define SLICE (UINT64_C(20000) * NS_PER_US)

static void tell_changes(gust_loop *loop, gust_state *state, uint32_t *faults)
{
    const gust_supervision *s = &loop->bridge->supervision;
    if (s->state == *state && s->faults == *faults) {
        return;
    }
    *state = s->state;
    *faults = s->faults;
    const uint64_t n = atomic_load(&loop->n_events);
    loop->events[n % GUST_LOOP_EVENTS] = (gust_event){.time = gust_clock_now(),
                                                      .state = s->state,
                                                      .faults = s->faults,
                                                      .sample = atomic_load(&loop->bridge->sample)};
    atomic_store(&loop->n_events, n + 1U);
    const uint64_t one = 1;
    if (loop->wake >= 0 && write(loop->wake, &one, sizeof one) < 0) {
        return; /* the counter is full, so whoever prints is awake already */
    }
}

static void tick(gust_loop *loop, uint32_t periods, uint64_t since)
{
    gust_bridge_tick(loop->bridge, periods);
    gust_times_add(&loop->response, gust_clock_now() - since);
    ++loop->periods;
    loop->missed += periods - 1U;
}

static void serve(gust_loop *loop)
{
    if (loop->watchdog != NULL) {
        gust_watchdog_serve(loop->watchdog);
    }
}

/* Everything that has come in, up to a Sync if there is one to stop at. true: stopped at it, at `*at`. */
static bool drain(gust_loop *loop, bool stop_at_sync, uint64_t *at)
{
    gust_frame frame;
    for (uint32_t n = 0; n < FRAMES_PER_PERIOD; ++n) {
        const gust_transport_status status = loop->transport->receive(loop->transport, &frame);
        if (status != GUST_TRANSPORT_OK) {
            gust_bridge_transport(loop->bridge, status);
            return false;
        }
        loop->drained = n + 1U > loop->drained ? n + 1U : loop->drained;
        if (gust_bridge_receive(loop->bridge, &frame) && stop_at_sync) {
            *at = frame.time;
            return true;
        }
    }
    return false;
}

static void run_monotonic(gust_loop *loop)
{
    const uint64_t period = loop->bridge->link.period;
    gust_state state = GUST_STATE_SAFE; /* so that the first state is told */
    uint32_t faults = 0;
    uint64_t deadline = gust_clock_now() + period;
    uint32_t periods = 1;
    while (!atomic_load(&loop->stop)) {
        gust_clock_sleep(deadline);
        const uint64_t late = gust_clock_now() - deadline;
        loop->latest = late > loop->latest ? late : loop->latest;
        periods = 1U + (uint32_t)(late / period);
        uint64_t unused = 0;
        (void)drain(loop, false, &unused);
        tick(loop, periods, deadline);
        serve(loop);
        tell_changes(loop, &state, &faults);
        deadline += (uint64_t)periods * period;
    }
}

static void run_synchronous(gust_loop *loop)
{
    gust_state state = GUST_STATE_SAFE;
    uint32_t faults = 0;
    uint64_t limit = gust_clock_now() + loop->patience;
    while (!atomic_load(&loop->stop)) {
        uint64_t since = 0;
        const bool synced = drain(loop, true, &since);
        const uint64_t now = gust_clock_now();
        if (synced) {
            tick(loop, loop->bridge->sync_periods, since);
        } else if (now >= limit) {
            tick(loop, 1, now);
        } else {
            const uint64_t slice = now + SLICE;
            (void)loop->transport->wait(loop->transport, slice < limit ? slice : limit);
        }
        if (synced || now >= limit) {
            limit = now + loop->patience;
        }
        serve(loop);
        tell_changes(loop, &state, &faults);
    }
}

void gust_loop_run(gust_loop *loop)
{
    if (loop->bridge->config.synchronous) {
        run_synchronous(loop);
    } else {
        run_monotonic(loop);
    }
    gust_bridge_stop(loop->bridge);
}
