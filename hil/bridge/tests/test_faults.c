/* Whole bridge on a bus: the life of a run, each fault on the bus, what is heard of it and how soon. */
#include "stand.h"

#include <math.h>
#include <string.h>

#define MEASURED(s) ((double[32]){[2] = (s)->number, [3] = 1.0, [4] = 1.0})

static stand s; /* too large for a stack under sanitizers */

static uint32_t never_empty(gust_transport *transport)
{
    (void)transport;
    return 1;
}

/* ---- A run without faults ---- */

static void life(void **unused)
{
    (void)unused;
    for (int synchronous = 0; synchronous < 2; ++synchronous) {
        stand_begin(&s, &test_database, synchronous != 0);
        stand_period(&s);
        assert_int_equal(stand_state(&s), GUST_STATE_INIT);
        assert_int_equal(s.heard.references, 1);
        assert_false(s.heard.enabled);
        assert_true(s.heard.omega_gsc == 1.0 && s.heard.beta_ref == 90.0 && s.heard.i_d_gsc == 0.25);
        assert_int_equal(s.heard.states, 1);
        stand_period(&s);
        assert_int_equal(s.heard.heartbeats, 1);
        stand_period(&s);
        assert_int_equal(s.heard.fingerprints, 1);
        stand_ready(&s);
        assert_int_equal(s.told_state, GUST_STATE_READY); /* told in the period of the change */
        s.v_dc = 1.125;
        stand_send(&s, GUST_PART_SET_POINTS, 0, (double[32]){[2] = 0.75});
        stand_press(&s, GUST_COMMAND_START);
        stand_period(&s);
        assert_int_equal(stand_state(&s), GUST_STATE_RUN);
        assert_true(s.heard.enabled);
        assert_int_equal(s.heard.sample, s.number - 1U);
        assert_true(s.heard.omega_gsc == 1.0 + 0.5 * 0.125); /* the droop, on the very first sample */
        assert_true(s.heard.beta_ref == (double)(float)(100.0 * 0.25 * 1e-3));
        assert_true(s.heard.i_d_gsc == 0.25); /* what this controller does not command */
        stand_periods(&s, 1000);
        assert_int_equal(s.bridge.steps, 1001);
        assert_int_equal(s.bridge.held, 0);
        stand_press(&s, GUST_COMMAND_STOP);
        stand_period(&s);
        assert_int_equal(stand_state(&s), GUST_STATE_READY);
        assert_false(s.heard.enabled);
        assert_true(s.heard.beta_ref == 90.0);
        stand_press(&s, GUST_COMMAND_START); /* begins anew: the integral too */
        stand_period(&s);
        assert_true(s.heard.beta_ref == (double)(float)(100.0 * 0.25 * 1e-3));
        gust_bridge_stop(&s.bridge);
        gust_bus_run(&s.bus, s.bus.now + PERIOD_NS);
        stand_drain(&s);
        assert_int_equal(s.out_of_range, 0);
        assert_int_equal(s.bridge.link.counts.cut, 0);
        assert_int_equal(s.bridge.link.counts.echoed, s.bridge.link.counts.sent);
    }
}

static void cyclic_messages(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_database, false);
    stand_run(&s);
    uint32_t states = 0, heartbeats = 0, fingerprints = 0;
    for (int k = 0; k < 2000; ++k) {
        stand_period(&s);
        states += s.heard.states;
        heartbeats += s.heard.heartbeats;
        fingerprints += s.heard.fingerprints;
        assert_int_equal(s.heard.references, 1);
    }
    assert_int_equal(states, 200);
    assert_int_equal(heartbeats, 20);
    assert_int_equal(fingerprints, 2);
}

static uint32_t beside_references(void)
{
    return s.heard.states + s.heard.responses + s.heard.heartbeats + s.heard.fingerprints;
}

/* An operator asks in each period: nobody waits longer for a turn than there are others, and references wait
 * for one frame of them at most. */
static void turns(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_database, true);
    stand_run(&s);
    uint32_t states = 0, responses = 0, heartbeats = 0, fingerprints = 0;
    for (int k = 0; k < 2000; ++k) {
        stand_request(&s, 0.0, TEST_K_DROOP, 0.0);
        stand_period(&s);
        assert_int_equal(s.heard.references, 1);
        assert_int_equal(beside_references(), 1);
        states += s.heard.states;
        responses += s.heard.responses;
        heartbeats += s.heard.heartbeats;
        fingerprints += s.heard.fingerprints;
    }
    assert_int_equal(states, 200);
    assert_int_equal(heartbeats, 20);
    assert_int_equal(fingerprints, 2);
    assert_int_equal(responses, 2000 - 222);
    assert_int_equal(stand_state(&s), GUST_STATE_RUN);
}

/* Nothing joins a queue in which something is left; a state that changes is told as soon as it is empty. */
static void nothing_joins_a_queue(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_database, true);
    s.bridge.config.limits.missing = 20;
    stand_run(&s);
    while (s.heard.states == 0) {
        stand_period(&s);
    }
    s.bus.held = true;
    for (int k = 0; k < 15; ++k) {
        gust_bridge_tick(&s.bridge, 1);
        assert_true(s.bus.node[0].n_queued <=
                    2); /* references, which are called back, and one frame of others */
    }
    s.bus.held = false;
    stand_period(&s);
    stand_period(&s);
    assert_int_equal(stand_state(&s), GUST_STATE_SAFE);
    assert_int_equal(s.told_state, GUST_STATE_SAFE);
    /* An echo that got lost: after so many periods the turns go on. */
    s.bridge.config.limits.missing = 2;
    s.bus.node[0].transport.pending = never_empty;
    uint32_t states = 0;
    for (int k = 0; k < 300; ++k) {
        stand_period(&s);
        states += s.heard.states;
    }
    assert_true(states > 20);
}

/* Bare database: no Sync, heartbeat, fingerprint or state. */
static void bare(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_bare, false);
    stand_run(&s);
    s.v_dc = 1.25;
    stand_periods(&s, 3000);
    assert_true(s.heard.omega_gsc == 1.125);
    assert_int_equal(stand_state(&s), GUST_STATE_RUN);
}

static void pieces(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_pieces, true);
    stand_run(&s);
    s.v_dc = 1.25;
    stand_periods(&s, 100);
    assert_true(s.heard.enabled && s.heard.omega_gsc == 1.125);
    assert_int_equal(s.heard.sample, (s.number - 1U) % 16U);
    for (uint32_t k = 0; k < 3U; ++k) { /* half a sample is none */
        assert_int_equal(stand_state(&s), GUST_STATE_RUN);
        stand_send(&s, GUST_PART_MEASUREMENTS, 0, (double[32]){[2] = s.number % 16U, [3] = 1.5});
        stand_sync(&s);
        stand_finish(&s);
        assert_true(k == 2U || s.heard.omega_gsc == 1.125);
    }
    assert_int_equal(stand_state(&s), GUST_STATE_SAFE);
    assert_int_equal(s.bridge.supervision.faults, GUST_FAULT_TIMEOUT);
}

/* ---- Faults: what is done in each period of the fault; NULL: the bus as it is ---- */

static void loss(void)
{
    stand_sync(&s);
}

static void all_lost(void)
{
}

static void bit_flip(void)
{
    gust_frame frame = stand_frame(&s, GUST_PART_MEASUREMENTS, 0, MEASURED(&s));
    frame.data[9] ^= 4U;
    stand_put(&s, &frame);
    stand_sync(&s);
}

static gust_frame repeated;

static void stale_repeat(void)
{
    stand_put(&s, &repeated);
    stand_sync(&s);
}

static void counter_jump(void)
{
    (void)stand_frame(&s, GUST_PART_MEASUREMENTS, 0, MEASURED(&s));
    (void)stand_frame(&s, GUST_PART_MEASUREMENTS, 0, MEASURED(&s));
    (void)stand_frame(&s, GUST_PART_MEASUREMENTS, 0, MEASURED(&s));
    stand_measure(&s);
    stand_sync(&s);
}

/* A frame with a good CRC around a value that no encoder would send. */
static void spoil(double value)
{
    gust_message message = *gust_message_find(&test_database, GUST_PART_MEASUREMENTS, 0);
    gust_signal signals[8];
    memcpy(signals, message.signals, message.n_signals * sizeof signals[0]);
    for (uint32_t k = 0; k < message.n_signals; ++k) {
        signals[k].low = -(double)INFINITY;
        signals[k].high = (double)INFINITY;
        signals[k].safe = value;
    }
    message.signals = signals;
    const gust_message *own = gust_message_find(&test_database, GUST_PART_MEASUREMENTS, 0);
    _Atomic uint32_t *counter = &s.converter.message[gust_link_number(&s.converter, own)].counter;
    gust_frame frame;
    double values[32] = {[2] = s.number, [3] = value, [4] = 1.0};
    (void)gust_message_encode(&message, values, (uint8_t)*counter, &frame);
    ++*counter;
    stand_put(&s, &frame);
    stand_sync(&s);
}

static void not_a_number(void)
{
    spoil((double)NAN);
}

static void infinite(void)
{
    spoil((double)INFINITY);
}

static void out_of_range(void)
{
    spoil(2.5);
}

static void implausible(void)
{
    s.v_dc = 1.75;
    stand_measure(&s);
    stand_sync(&s);
}

static void wrong_length(void)
{
    gust_frame frame = stand_frame(&s, GUST_PART_MEASUREMENTS, 0, MEASURED(&s));
    frame.length = 24;
    stand_put(&s, &frame);
    stand_sync(&s);
}

static void classic_frame(void)
{
    gust_frame frame = stand_frame(&s, GUST_PART_MEASUREMENTS, 0, MEASURED(&s));
    frame.flags = 0;
    frame.length = 8;
    stand_put(&s, &frame);
    stand_sync(&s);
}

static void masquerade(void)
{
    stand_measure(&s);
    const gust_frame frame =
        stand_frame(&s, GUST_PART_REFERENCES, 0, (double[32]){[2] = s.number, [3] = 1.0, [4] = 1.0});
    gust_bus_inject(&s.bus.node[0], &frame); /* from a third node */
    stand_sync(&s);
}

/* Samples of long ago, with counters and CRC in order. */
static void delay(void)
{
    stand_send(&s, GUST_PART_MEASUREMENTS, 0, (double[32]){[2] = s.number - 3U, [3] = 1.0, [4] = 1.0});
    stand_sync(&s);
}

/* One period late, as a queue would do it. */
static void short_delay(void)
{
    stand_send(&s, GUST_PART_MEASUREMENTS, 0, (double[32]){[2] = s.number - 1U, [3] = 1.0, [4] = 1.0});
    stand_sync(&s);
}

static void bus_off(void)
{
    const gust_frame frame = {.id = 0x40, .flags = GUST_FRAME_ERROR, .length = 8};
    gust_bus_inject(&s.bus.node[0], &frame);
    stand_measure(&s);
    stand_sync(&s);
}

static void wrong_fingerprint(void)
{
    stand_fingerprint(&s, 1);
    stand_measure(&s);
    stand_sync(&s);
}

static void no_buffers(void)
{
    s.bus.node[0].full = 1;
    stand_measure(&s);
    stand_sync(&s);
}

static void multiplexer(void)
{
    gust_frame frame = stand_frame(&s, GUST_PART_PARAMETER_REQUEST, 0, (double[32]){[2] = 2.0});
    gust_message wide = *gust_message_find(&test_database, GUST_PART_PARAMETER_RESPONSE, 0);
    const gust_message *own = gust_message_find(&test_database, GUST_PART_PARAMETER_REQUEST, 0);
    wide.id = own->id; /* packs any operation */
    wide.multiplexer = -1;
    wide.e2e = own->e2e;
    gust_signal signals[8];
    memcpy(signals, wide.signals, wide.n_signals * sizeof signals[0]);
    signals[2].high = 99.0;
    wide.signals = signals;
    static bool (*packed)(const double *, uint8_t *);
    packed = gust_message_find(&test_database, GUST_PART_EMERGENCY_STOP, 0)->pack;
    wide.pack = packed; /* the first word alone, which is the multiplexer */
    (void)gust_message_encode(&wide, (double[32]){[2] = 77.0}, 1, &frame);
    stand_put(&s, &frame);
    stand_measure(&s);
    stand_sync(&s);
}

static void emergency_stop(void)
{
    stand_emergency(&s);
    stand_measure(&s);
    stand_sync(&s);
}

/* Damaged, but somebody did press. */
static void torn_emergency_stop(void)
{
    gust_frame frame = stand_frame(&s, GUST_PART_EMERGENCY_STOP, 0, (double[32]){[2] = 1.0});
    frame.data[4] ^= 1U;
    stand_put(&s, &frame);
    stand_measure(&s);
    stand_sync(&s);
}

static void tripped(void)
{
    s.converter_state = GUST_CONVERTER_TRIPPED;
    stand_send(&s, GUST_PART_CONVERTER_STATE, 0, (double[32]){[2] = GUST_CONVERTER_TRIPPED});
    stand_measure(&s);
    stand_sync(&s);
}

static void controller_wrong(void)
{
    test_controller_fail(s.bridge.context, 1, 16U);
    stand_measure(&s);
    stand_sync(&s);
}

static void watchdog_spoke(void)
{
    gust_bridge_latch(&s.bridge, GUST_FAULT_WATCHDOG);
    stand_measure(&s);
    stand_sync(&s);
}

static void sync_jump(void)
{
    s.number += 50U;
    stand_measure(&s);
    stand_sync(&s);
}

typedef struct fault {
    const char *name;
    void (*act)(void);
    uint32_t tolerated; /* periods of it, without SAFE */
    uint32_t told;      /* the fault, in the period after */
} fault;

static const fault FAULTS[] = {
    {"loss", loss, 2, GUST_FAULT_TIMEOUT},
    {"burst loss", all_lost, 2, GUST_FAULT_TIMEOUT},
    {"bit flip", bit_flip, 2, GUST_FAULT_CRC},
    {"stale repeat", stale_repeat, 2, GUST_FAULT_STALE},
    {"counter jump", counter_jump, 0, GUST_FAULT_COUNTER},
    {"NaN", not_a_number, 0, GUST_FAULT_NOT_FINITE},
    {"wrong length", wrong_length, 2, GUST_FAULT_LENGTH},
    {"masquerade", masquerade, 0, GUST_FAULT_MASQUERADE},
    {"delay", delay, 0, GUST_FAULT_STALE},
    {"bus-off", bus_off, 0, GUST_FAULT_BUS_OFF},
    {"wrong fingerprint", wrong_fingerprint, 0, GUST_FAULT_FINGERPRINT},
    {"ENOBUFS", no_buffers, 0, GUST_FAULT_SEND},
    {"infinite", infinite, 0, GUST_FAULT_NOT_FINITE},
    {"out of range", out_of_range, 0, GUST_FAULT_RANGE},
    {"implausible", implausible, 0, GUST_FAULT_PLAUSIBILITY},
    {"classic frame", classic_frame, 2, GUST_FAULT_LENGTH},
    {"short delay", short_delay, 2, GUST_FAULT_STALE},
    {"multiplexer", multiplexer, 0, GUST_FAULT_MULTIPLEXER},
    {"emergency stop", emergency_stop, 0, GUST_FAULT_EMERGENCY_STOP},
    {"torn emergency stop", torn_emergency_stop, 0, GUST_FAULT_EMERGENCY_STOP},
    {"tripped", tripped, 0, GUST_FAULT_CONVERTER},
    {"controller error", controller_wrong, 2, GUST_FAULT_CONTROLLER},
    {"watchdog", watchdog_spoke, 0, GUST_FAULT_WATCHDOG},
    {"Sync jump", sync_jump, 0, GUST_FAULT_COUNTER},
};
#define N_FAULTS (sizeof FAULTS / sizeof FAULTS[0])

static void begin_running(bool synchronous)
{
    stand_begin(&s, &test_database, synchronous);
    stand_run(&s);
    s.v_dc = 1.25;
    stand_periods(&s, 50);
    repeated = stand_frame(&s, GUST_PART_MEASUREMENTS, 0, MEASURED(&s));
    stand_put(&s, &repeated); /* the measurements of this period */
    stand_sync(&s);
    stand_finish(&s);
    assert_int_equal(stand_state(&s), GUST_STATE_RUN);
}

/* One period with the fault in it. */
static void act(const fault *f)
{
    stand_status(&s);
    f->act();
    stand_finish(&s);
}

static void each_reaches_safe(void **unused)
{
    (void)unused;
    for (size_t k = 0; k < N_FAULTS; ++k) {
        const fault *f = &FAULTS[k];
        for (int synchronous = 0; synchronous < 2; ++synchronous) {
            begin_running(synchronous != 0);
            for (uint32_t n = 0; n < f->tolerated; ++n) {
                act(f);
                assert_int_equal(stand_state(&s), GUST_STATE_RUN);
                assert_true(s.heard.enabled);
            }
            act(f);
            if (stand_state(&s) != GUST_STATE_SAFE || (s.bridge.supervision.faults & f->told) == 0) {
                fail_msg("%s: state %d, faults %x", f->name, (int)stand_state(&s), s.bridge.supervision.faults);
            }
            /* In that very period the converter hears of it, unless the frame itself could not be sent. */
            const bool unsent = (f->told & (uint32_t)GUST_FAULT_SEND) != 0;
            assert_int_equal(s.heard.references, unsent ? 0 : 1);
            stand_period(&s);
            assert_int_equal(s.heard.references, 1);
            assert_false(s.heard.enabled);
            assert_true(s.heard.omega_gsc == 1.0 && s.heard.beta_ref == 90.0);
            stand_periods(&s, 20);
            assert_int_equal(s.told_state, GUST_STATE_SAFE);
            assert_true((s.told_faults & f->told) != 0);
            assert_int_equal(s.out_of_range, 0);
            assert_true(f->tolerated + 1U <= 3U); /* within 3 ms at 1 kHz */
        }
    }
}

/* What is tolerated goes on afterwards as if nothing had been. */
static void tolerated_faults_pass(void **unused)
{
    (void)unused;
    for (size_t k = 0; k < N_FAULTS; ++k) {
        for (uint32_t n = 1; n <= FAULTS[k].tolerated; ++n) {
            begin_running(true);
            const double held = s.heard.omega_gsc;
            for (uint32_t m = 0; m < n; ++m) {
                act(&FAULTS[k]);
                assert_true(s.heard.enabled && s.heard.omega_gsc == held);
            }
            s.v_dc = 1.125;
            stand_periods(&s, 100);
            assert_int_equal(stand_state(&s), GUST_STATE_RUN);
            assert_true(s.heard.omega_gsc == 1.0625);
        }
    }
}

/* Nothing but a reset with a new nonce leaves SAFE, and it does not while the cause lasts. */
static void only_a_reset_leaves_safe(void **unused)
{
    (void)unused;
    for (size_t k = 0; k < N_FAULTS; ++k) {
        begin_running(false);
        for (uint32_t n = 0; n <= FAULTS[k].tolerated; ++n) {
            act(&FAULTS[k]);
        }
        if (FAULTS[k].act == tripped) {
            s.converter_state = GUST_CONVERTER_READY;
        }
        if (FAULTS[k].act == wrong_fingerprint) {
            stand_fingerprint(&s, test_database.fingerprint);
        }
        stand_press(&s, GUST_COMMAND_RESET); /* too early */
        stand_periods(&s, 100);
        assert_int_equal(stand_state(&s), GUST_STATE_SAFE);
        stand_command(&s, GUST_COMMAND_RESET, s.nonce); /* the same nonce */
        stand_press(&s, GUST_COMMAND_START);
        stand_period(&s);
        stand_press(&s, GUST_COMMAND_STOP);
        stand_periods(&s, 1000);
        assert_int_equal(stand_state(&s), GUST_STATE_SAFE);
        stand_press(&s, GUST_COMMAND_RESET);
        stand_periods(&s, 100);
        assert_int_equal(stand_state(&s), GUST_STATE_READY);
        stand_periods(&s, 500); /* and never RUN without a start */
        assert_false(s.heard.enabled);
        stand_run(&s);
    }
}

/* A bus that is gone and comes back. */
static void bus_comes_back(void **unused)
{
    (void)unused;
    begin_running(false);
    gust_bus_off(&s.bus.node[0]);
    stand_periods(&s, 10);
    assert_int_equal(stand_state(&s), GUST_STATE_SAFE);
    assert_int_equal(s.heard.references, 0);
    gust_bus_restart(&s.bus.node[0]);
    stand_period(&s);
    assert_int_equal(s.heard.references, 1);
    assert_false(s.heard.enabled);
    stand_run(&s);
}

/* References that do not leave: no second one is queued, and after the tolerated time a SAFE one. */
static void held_bus(void **unused)
{
    (void)unused;
    begin_running(false);
    s.bus.held = true;
    stand_drain(&s);
    gust_bridge_tick(&s.bridge, 1);
    assert_int_equal(stand_state(&s), GUST_STATE_RUN);
    const uint32_t queued = s.bus.node[0].n_queued;
    assert_int_equal(s.bridge.link.under_way, 1);
    gust_bus_run(&s.bus, s.bus.now + PERIOD_NS / 2);
    stand_drain(&s);
    gust_bridge_tick(&s.bridge, 1); /* sooner than a period: not late yet, but nothing is queued behind it */
    assert_int_equal(stand_state(&s), GUST_STATE_RUN);
    assert_int_equal(s.bridge.link.under_way, 1);
    gust_bus_run(&s.bus, s.bus.now + PERIOD_NS / 2);
    stand_drain(&s);
    gust_bridge_tick(&s.bridge, 1);
    assert_int_equal(stand_state(&s), GUST_STATE_SAFE);
    assert_true(s.bus.node[0].n_queued <= queued + 1U); /* the SAFE references in place of the old ones */
    assert_int_equal(s.bridge.link.under_way, 1);
    s.bus.held = false;
    stand_periods(&s, 3);
    assert_false(s.heard.enabled);
    assert_true(s.worst_age <= PERIOD_NS);
}

/* The converter says nothing any more, its heartbeat neither; it comes back as another one. */
static void converter_is_swapped(void **unused)
{
    (void)unused;
    begin_running(false);
    for (int k = 0; k < 400; ++k) {
        stand_measure(&s);
        stand_sync(&s);
        stand_finish(&s);
    }
    assert_int_equal(stand_state(&s), GUST_STATE_SAFE);
    assert_int_equal(s.bridge.supervision.faults, GUST_FAULT_HEARTBEAT);
    stand_press(&s, GUST_COMMAND_RESET);
    stand_send(&s, GUST_PART_CONVERTER_HEARTBEAT, 0, (double[32]){0.0});
    for (int k = 0; k < 100; ++k) {
        stand_measure(&s);
        stand_sync(&s);
        stand_finish(&s);
        if (k == 50) {
            stand_press(&s, GUST_COMMAND_RESET);
        }
    }
    assert_int_equal(stand_state(&s), GUST_STATE_INIT); /* for it has not said yet who it is */
    stand_fingerprint(&s, test_database.fingerprint);
    stand_period(&s);
    assert_int_equal(stand_state(&s), GUST_STATE_READY);
}

/* A command that a broken controller made does not leave the range of the database, and is told. */
static void broken_controller(void **unused)
{
    (void)unused;
    static const double NONSENSE[] = {1e30, -1e30, (double)NAN, (double)INFINITY, 91.0, 1e-300};
    for (size_t k = 0; k < sizeof NONSENSE / sizeof NONSENSE[0]; ++k) {
        begin_running(true);
        test_controller_break(s.bridge.context, NONSENSE[k]);
        stand_periods(&s, 3);
        assert_int_equal(stand_state(&s), GUST_STATE_RUN);
        stand_period(&s);
        assert_int_equal(s.bridge.supervision.faults, GUST_FAULT_CONTROLLER);
        stand_periods(&s, 10);
        assert_int_equal(s.out_of_range, 0);
    }
}

static uint64_t step_time; /* ns */

static uint32_t slow_step(void *context)
{
    s.bus.now += step_time;
    return test_controller.step(context);
}

/* The step takes a period or longer: its command is not sent. */
static void late_command(void **unused)
{
    (void)unused;
    gust_controller slow = test_controller;
    slow.step = slow_step;
    for (uint64_t late = 0; late < 2U; ++late) {
        begin_running(false);
        s.bridge.config.controller = &slow;
        step_time = PERIOD_NS + late;
        stand_drain(&s);
        stand_measure(&s);
        stand_sync(&s);
        stand_finish(&s);
        step_time = 0;
        assert_int_equal(s.bridge.supervision.faults, late != 0 ? GUST_FAULT_DEADLINE : 0);
        gust_bus_run(&s.bus, s.bus.now + 10 * FRAME_NS);
        s.bridge.config.controller = &test_controller;
        stand_drain(&s);
    }
}

/* The bridge hears its own watchdog and does not take it for a stranger; the next one it does. */
static void watchdog_frames_are_ours(void **unused)
{
    (void)unused;
    begin_running(false);
    gust_frame frames[GUST_PIECES];
    assert_int_equal(gust_bridge_safe_frames(&s.bridge, frames), 1);
    gust_bus_inject(&s.bus.node[0], &frames[0]);
    stand_period(&s);
    assert_int_equal(stand_state(&s), GUST_STATE_RUN);
    gust_bus_inject(&s.bus.node[0], &frames[0]);
    stand_period(&s);
    assert_int_equal(s.bridge.supervision.faults, GUST_FAULT_MASQUERADE);
    begin_running(false);
    (void)gust_bridge_safe_frames(&s.bridge, frames);
    gust_bridge_not_sent(&s.bridge, 0); /* so any that comes is a stranger's */
    gust_bus_inject(&s.bus.node[0], &frames[0]);
    stand_period(&s);
    assert_int_equal(s.bridge.supervision.faults, GUST_FAULT_MASQUERADE);
}

static void set_points_stay(void **unused)
{
    (void)unused;
    begin_running(false);
    stand_send(&s, GUST_PART_SET_POINTS, 0, (double[32]){[2] = 0.75});
    stand_periods(&s, 5000);
    assert_int_equal(stand_state(&s), GUST_STATE_RUN);
    assert_true(s.heard.beta_ref > 89.0); /* 5 s of overspeed */
    stand_begin(&s, &test_database, false);
    s.bridge.supervision.limits.set_points = 100;
    stand_send(&s, GUST_PART_SET_POINTS, 0, (double[32]){[2] = 0.75});
    stand_run(&s);
    stand_periods(&s, 100);
    assert_int_equal(s.bridge.supervision.faults, GUST_FAULT_TIMEOUT);
}

/* What does not fit is refused at the start, by name. */
static void refused(void **unused)
{
    (void)unused;
    gust_bridge_config config = {
        .controller = &test_controller, .messages = &test_lacking, .transport = &s.bus.node[0].transport};
    gust_limits_default(&config.limits);
    gust_error error;
    assert_false(gust_bridge_init(&s.bridge, &config, &error));
    assert_non_null(strstr(error.text, "GF8050"));
    assert_non_null(strstr(error.text, "output 'beta_ref'"));
    config.messages = &test_bare;
    config.synchronous = true;
    assert_false(gust_bridge_init(&s.bridge, &config, &error));
    assert_non_null(strstr(error.text, "GF8053"));
    config.synchronous = false;
    gust_controller other = test_controller;
    config.controller = &other;
    other.version = 99;
    assert_false(gust_bridge_init(&s.bridge, &config, &error));
    assert_non_null(strstr(error.text, "GF8052"));
    other = test_controller;
    other.context_size = GUST_CONTEXT + 1U;
    assert_false(gust_bridge_init(&s.bridge, &config, &error));
    assert_non_null(strstr(error.text, "GF8051"));
    other = test_controller;
    other.period = 0.0;
    assert_false(gust_bridge_init(&s.bridge, &config, &error));
    other = test_controller;
    gust_controller_signal inputs[] = {test_controller.inputs[0], test_controller.inputs[1],
                                       test_controller.inputs[2]};
    inputs[1].name = "P_pmsg";
    other.inputs = inputs;
    assert_false(gust_bridge_init(&s.bridge, &config, &error));
    assert_non_null(strstr(error.text, "input 'P_pmsg'"));
    gust_message_set empty = test_bare;
    empty.n_messages = 1;
    config.messages = &empty;
    other = test_controller;
    assert_false(gust_bridge_init(&s.bridge, &config, &error));
    assert_non_null(strstr(error.text, "GF8053"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(life),
        cmocka_unit_test(cyclic_messages),
        cmocka_unit_test(turns),
        cmocka_unit_test(nothing_joins_a_queue),
        cmocka_unit_test(bare),
        cmocka_unit_test(pieces),
        cmocka_unit_test(each_reaches_safe),
        cmocka_unit_test(tolerated_faults_pass),
        cmocka_unit_test(only_a_reset_leaves_safe),
        cmocka_unit_test(bus_comes_back),
        cmocka_unit_test(held_bus),
        cmocka_unit_test(converter_is_swapped),
        cmocka_unit_test(broken_controller),
        cmocka_unit_test(late_command),
        cmocka_unit_test(watchdog_frames_are_ours),
        cmocka_unit_test(set_points_stay),
        cmocka_unit_test(refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
