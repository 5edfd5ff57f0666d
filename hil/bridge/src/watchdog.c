#include "gustform_bridge/watchdog.h"

#include <string.h>

#include "gustform_bridge/clock.h"

/* ns; after it the thread sees that it is to end. */
#define LONGEST_SLEEP UINT64_C(50000000)

uint64_t gust_watchdog_look(gust_watchdog *watchdog, uint64_t now)
{
    const uint64_t deadline = atomic_load(&watchdog->deadline);
    if (now < deadline) {
        return deadline < now + LONGEST_SLEEP ? deadline : now + LONGEST_SLEEP;
    }
    gust_bridge_latch(watchdog->bridge, GUST_FAULT_WATCHDOG);
    atomic_fetch_add(&watchdog->fired, 1U);
    gust_frame frames[GUST_PIECES];
    const uint32_t n = gust_bridge_safe_frames(watchdog->bridge, frames);
    for (uint32_t k = 0; k < n; ++k) {
        if (watchdog->transport->send(watchdog->transport, &frames[k]) == GUST_TRANSPORT_OK) {
            atomic_fetch_add(&watchdog->sent, 1U);
        } else {
            gust_bridge_not_sent(watchdog->bridge, k);
        }
    }
    return now + watchdog->period;
}

static void *run(void *context)
{
    gust_watchdog *watchdog = context;
    while (!atomic_load(&watchdog->stop)) {
        gust_clock_sleep(gust_watchdog_look(watchdog, gust_clock_now()));
    }
    return NULL;
}

bool gust_watchdog_start(gust_watchdog *watchdog, gust_bridge *bridge, gust_transport *transport,
                         uint64_t timeout, int priority, gust_error *error)
{
    memset(watchdog, 0, sizeof *watchdog);
    watchdog->bridge = bridge;
    watchdog->transport = transport;
    watchdog->timeout = timeout;
    watchdog->period = bridge->link.period;
    gust_watchdog_serve(watchdog);
    if (!gust_clock_thread(&watchdog->thread, run, watchdog, priority, NULL)) {
        return gust_fail(error, "GF8062: no thread for the watchdog. Look at: ulimit -u");
    }
    return true;
}

void gust_watchdog_serve(gust_watchdog *watchdog)
{
    atomic_store(&watchdog->deadline, gust_clock_now() + watchdog->timeout);
}

void gust_watchdog_stop(gust_watchdog *watchdog)
{
    gust_watchdog_serve(watchdog);
    atomic_store(&watchdog->stop, true);
    (void)pthread_join(watchdog->thread, NULL);
}
