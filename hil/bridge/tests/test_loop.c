/* The loop with the clock of this computer, over the in-process bus. What is asserted is what it did, not when.
 */
#include "stand.h"

#include <string.h>

#include "gustform_bridge/clock.h"
#include "gustform_bridge/loop.h"

#define PATIENT UINT64_C(60000000000) /* ns */

static stand s;
static gust_loop loop;

static void *run(void *context)
{
    gust_loop_run(context);
    return NULL;
}

/* Lets the loop run until it has made `periods` ticks, or rather longer. */
static void run_until(uint64_t periods, uint64_t patience)
{
    pthread_t thread;
    memset(&loop, 0, sizeof loop);
    loop.bridge = &s.bridge;
    loop.transport = &s.bus.node[0].transport;
    loop.patience = patience;
    loop.wake = -1;
    const uint64_t ticks = s.bridge.ticks;
    assert_true(gust_clock_thread(&thread, run, &loop, 0, NULL));
    const uint64_t limit = gust_clock_now() + PATIENT;
    while (atomic_load(&loop.periods) < periods && gust_clock_now() < limit) {
        gust_clock_sleep(gust_clock_now() + PERIOD_NS);
    }
    atomic_store(&loop.stop, true);
    assert_int_equal(pthread_join(thread, NULL), 0);
    assert_true(loop.periods >= periods);
    assert_int_equal(s.bridge.ticks - ticks, loop.periods + loop.missed);
}

/* Three periods have piled up: the first is ticked, the other two together, for they come before its echo. */
static void piled_up_syncs(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_database, true);
    stand_run(&s);
    stand_drain(&s);
    for (int k = 0; k < 3; ++k) {
        stand_measure(&s);
        stand_sync(&s);
        ++s.number;
    }
    gust_bus_run(&s.bus, s.bus.now + 20 * FRAME_NS);
    s.bridge.config.age = 0; /* the bus's time jumps to this computer's */
    const uint64_t steps = s.bridge.steps;
    run_until(2, PATIENT);
    assert_int_equal(loop.periods, 2);
    assert_int_equal(loop.missed, 1);
    assert_int_equal(s.bridge.steps, steps + 2U);
    assert_int_equal(atomic_load(&s.bridge.sample), s.number - 1U); /* the newest sample */
    assert_int_equal(s.bridge.supervision.faults, 0);
}

/* No Sync comes: ticked all the same, and safe. */
static void silence(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_database, true);
    stand_run(&s);
    stand_drain(&s);
    s.bridge.config.age = 0;
    run_until(5, 5 * PERIOD_NS);
    assert_int_equal(s.bridge.supervision.state, GUST_STATE_SAFE);
    assert_true((s.bridge.supervision.faults & (uint32_t)GUST_FAULT_TIMEOUT) != 0);
    assert_true(atomic_load(&loop.n_events) >= 2U); /* RUN, SAFE */
    assert_int_equal(loop.events[0].state, GUST_STATE_RUN);
    assert_int_equal(loop.events[1].state, GUST_STATE_SAFE);
}

/* Its own clock, and a watchdog that is served. */
static void monotonic(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_database, false);
    stand_run(&s);
    stand_drain(&s);
    run_until(50, 0);
    assert_int_equal(loop.response.n, loop.periods);
    assert_int_equal(s.bridge.supervision.state, GUST_STATE_SAFE); /* nobody is there */
    assert_true((s.bridge.supervision.faults & (uint32_t)GUST_FAULT_TIMEOUT) != 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(piled_up_syncs), cmocka_unit_test(silence),
                                       cmocka_unit_test(monotonic)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
