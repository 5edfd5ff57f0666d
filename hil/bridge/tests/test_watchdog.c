/* The watchdog with its thread and the clock of this computer. Times are chosen so that a slow machine only
 * makes the test longer: what is asserted is who did what, not when. */
#include "stand.h"

#include <string.h>

#include "gustform_bridge/clock.h"
#include "gustform_bridge/watchdog.h"

#define TIMEOUT UINT64_C(20000000) /* ns */
#define PATIENT UINT64_C(20000000000)

/* A transport of the watchdog's own, in another thread: counts, and keeps the last frame. */
typedef struct mailbox {
    gust_transport transport; /* first */
    _Atomic uint32_t n;
    gust_frame first;
    gust_transport_status status;
} mailbox;

static gust_transport_status keep(gust_transport *transport, const gust_frame *frame)
{
    mailbox *box = (mailbox *)transport;
    if (box->status != GUST_TRANSPORT_OK) {
        return box->status;
    }
    if (atomic_load(&box->n) == 0) {
        box->first = *frame;
    }
    atomic_fetch_add(&box->n, 1U);
    return GUST_TRANSPORT_OK;
}

static stand s;
static mailbox box;
static gust_watchdog watchdog;
static gust_error error;

static void begin(gust_transport_status status)
{
    memset(&box, 0, sizeof box);
    box.transport.send = keep;
    box.status = status;
    stand_begin(&s, &test_database, true);
    stand_run(&s);
}

static void wait_until_fired(void)
{
    const uint64_t limit = gust_clock_now() + PATIENT;
    while (atomic_load(&watchdog.fired) == 0 && gust_clock_now() < limit) {
        gust_clock_sleep(gust_clock_now() + PERIOD_NS);
    }
    assert_true(atomic_load(&watchdog.fired) > 0);
}

/* The loop stalls: the watchdog sends SAFE references by itself, and the loop wakes up in SAFE. */
static void stalled_loop(void **unused)
{
    (void)unused;
    begin(GUST_TRANSPORT_OK);
    const uint32_t sample = s.number - 1U;
    assert_true(gust_watchdog_start(&watchdog, &s.bridge, &box.transport, TIMEOUT, 0, &error));
    wait_until_fired(); /* nobody serves it */
    gust_watchdog_stop(&watchdog);
    assert_true(atomic_load(&box.n) > 0);
    assert_int_equal(atomic_load(&watchdog.sent), atomic_load(&box.n));
    gust_received received;
    assert_int_equal(gust_link_receive(&s.converter, &box.first, &received), GUST_HEARD_GOOD);
    assert_int_equal(received.lost, 0); /* the counter goes on where the loop had stopped */
    assert_true(received.values[2] == (double)sample);
    assert_true(received.values[3] == 0.0 && received.values[4] == 1.0 && received.values[6] == 90.0);
    assert_int_equal(stand_state(&s), GUST_STATE_RUN); /* the loop does not know yet */
    stand_period(&s);
    assert_int_equal(s.bridge.supervision.faults, GUST_FAULT_WATCHDOG);
    assert_false(s.heard.enabled);
    stand_run(&s);
}

/* It fires between the supervision of a tick and the sending: the command is not sent. */
static gust_controller stalling;

static uint32_t stall(void *context)
{
    wait_until_fired();
    return test_controller.step(context);
}

static void stall_within_a_tick(void **unused)
{
    (void)unused;
    begin(GUST_TRANSPORT_OK);
    stalling = test_controller;
    stalling.step = stall;
    s.bridge.config.controller = &stalling;
    assert_true(gust_watchdog_start(&watchdog, &s.bridge, &box.transport, TIMEOUT, 0, &error));
    stand_period(&s);
    gust_watchdog_stop(&watchdog);
    s.bridge.config.controller = &test_controller;
    assert_int_equal(s.bridge.supervision.faults, GUST_FAULT_WATCHDOG);
    assert_int_equal(s.heard.references, 1);
    assert_false(s.heard.enabled);
}

static void served_loop(void **unused)
{
    (void)unused;
    begin(GUST_TRANSPORT_OK);
    assert_true(gust_watchdog_start(&watchdog, &s.bridge, &box.transport, PATIENT, 0, &error));
    for (int k = 0; k < 50; ++k) {
        stand_period(&s);
        gust_watchdog_serve(&watchdog);
        gust_clock_sleep(gust_clock_now() + PERIOD_NS);
    }
    gust_watchdog_stop(&watchdog);
    assert_int_equal(atomic_load(&watchdog.fired), 0);
    assert_int_equal(stand_state(&s), GUST_STATE_RUN);
}

/* Its deadline to the nanosecond, without a thread; and a bus that takes nothing. */
static void looks(void **unused)
{
    (void)unused;
    begin(GUST_TRANSPORT_FULL);
    memset(&watchdog, 0, sizeof watchdog);
    watchdog.bridge = &s.bridge;
    watchdog.transport = &box.transport;
    watchdog.period = PERIOD_NS;
    atomic_store(&watchdog.deadline, 1000);
    assert_int_equal(gust_watchdog_look(&watchdog, 999), 1000);
    assert_int_equal(atomic_load(&watchdog.fired), 0);
    assert_int_equal(gust_watchdog_look(&watchdog, 1000), 1000 + PERIOD_NS);
    assert_int_equal(atomic_load(&watchdog.fired), 1);
    assert_int_equal(atomic_load(&watchdog.sent), 0);
    box.status = GUST_TRANSPORT_OK;
    (void)gust_watchdog_look(&watchdog, 1001);
    assert_int_equal(atomic_load(&watchdog.sent), 1);
    gust_bus_inject(&s.bus.node[0], &box.first); /* only the one that was sent is ours */
    gust_bus_inject(&s.bus.node[0], &box.first);
    stand_period(&s);
    assert_int_equal(s.bridge.supervision.faults, GUST_FAULT_WATCHDOG | GUST_FAULT_MASQUERADE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(stalled_loop), cmocka_unit_test(stall_within_a_tick),
                                       cmocka_unit_test(served_loop), cmocka_unit_test(looks)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
