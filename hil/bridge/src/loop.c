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

/* Everything that has come in, up to a Sync if `periods` is not NULL, to which the periods until it are added.
 *
 * While references are under way a Sync is passed over: what follows it in the queue may be their echo. So a
 * loop that comes late makes one tick of the Syncs that have piled up, and no burst. */
static void drain(gust_loop *loop, uint32_t *periods, uint64_t *since)
{
    gust_frame frame;
    for (uint32_t n = 0; n < FRAMES_PER_PERIOD; ++n) {
        const gust_transport_status status = loop->transport->receive(loop->transport, &frame);
        if (status != GUST_TRANSPORT_OK) {
            gust_bridge_transport(loop->bridge, status);
            return;
        }
        loop->drained = n + 1U > loop->drained ? n + 1U : loop->drained;
        if (!gust_bridge_receive(loop->bridge, &frame) || periods == NULL) {
            continue;
        }
        *since = *periods == 0 ? frame.time : *since;
        *periods += loop->bridge->sync_periods;
        if (loop->bridge->link.under_way == 0) {
            return;
        }
    }
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
        gust_times_add(&loop->lateness, late);
        periods = 1U + (uint32_t)(late / period);
        drain(loop, NULL, NULL);
        tick(loop, periods, deadline);
        serve(loop);
        tell_changes(loop, &state, &faults);
        deadline += (uint64_t)periods * period;
    }
}

static uint64_t sooner(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

/* A period ends with its Sync when the references before it have left, or have had a period's time to. */
static void run_synchronous(gust_loop *loop)
{
    gust_state state = GUST_STATE_SAFE;
    uint32_t faults = 0;
    uint32_t periods = 0;
    uint64_t since = 0;
    uint64_t ticked = gust_clock_now();
    while (!atomic_load(&loop->stop)) {
        drain(loop, &periods, &since);
        const uint64_t now = gust_clock_now();
        const uint64_t left = ticked + loop->bridge->link.period;
        const uint64_t limit = ticked + loop->patience;
        if (periods > 0 && (loop->bridge->link.under_way == 0 || now >= left)) {
            tick(loop, periods, since);
            ticked = now;
            periods = 0;
        } else if (now >= limit) {
            tick(loop, 1, now);
            ticked = now;
        } else {
            (void)loop->transport->wait(loop->transport, sooner(now + SLICE, periods > 0 ? left : limit));
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
