/* A thousand trials with a fixed seed: bus-off, emergency stop or a full queue at a random instant of a run,
 * between frames that are late, lost or spoilt. What must hold in each: no enabled command is under way for
 * longer than a period, none is out of its range, and only an operator's reset leaves SAFE. */
#include "stand.h"

#include <string.h>

#define TRIALS 1000U
#define SEED   UINT64_C(20260922)

enum { BUS_OFF, EMERGENCY_STOP, NO_BUFFERS, HELD_BUS, N_KINDS };

static stand s;
static uint64_t state = SEED;

/* xorshift64*: below `n`. */
static uint32_t random_below(uint32_t n)
{
    state ^= state >> 12U;
    state ^= state << 25U;
    state ^= state >> 27U;
    return (uint32_t)((state * UINT64_C(2685821657736338717)) >> 33U) % n;
}

/* Values that move as measurements do. */
static void move(void)
{
    s.v_dc = 1.0 + 0.2 * ((double)random_below(2001) / 1000.0 - 1.0);
    s.omega_r = 1.0 + 0.001 * (double)random_below(4);
}

static void strike(uint32_t kind)
{
    switch (kind) {
    case BUS_OFF:
        gust_bus_off(&s.bus.node[0]);
        break;
    case EMERGENCY_STOP:
        stand_emergency(&s);
        break;
    case NO_BUFFERS:
        s.bus.node[0].full = 1U + random_below(5);
        break;
    default:
        s.bus.held = true;
        break;
    }
}

static void mend(uint32_t kind)
{
    s.bus.held = false;
    s.bus.node[0].full = 0;
    if (kind == BUS_OFF) {
        gust_bus_restart(&s.bus.node[0]);
    }
}

/* A period in which the fault comes after `frames` frames of the bridge have been queued, or before all of
 * them. */
static void struck_period(uint32_t kind, bool after_tick)
{
    stand_status(&s);
    stand_measure(&s);
    stand_sync(&s);
    if (!after_tick) {
        strike(kind);
        stand_finish(&s);
        return;
    }
    gust_bus_run(&s.bus, (uint64_t)s.period * PERIOD_NS + PERIOD_NS / 4);
    stand_drain(&s);
    gust_bridge_tick(&s.bridge, 1); /* its frames are queued, and then it strikes */
    strike(kind);
    gust_bus_run(&s.bus, (uint64_t)s.period * PERIOD_NS + PERIOD_NS / 2);
    ++s.number;
    stand_measure(&s);
    stand_sync(&s);
    stand_finish(&s);
}

static void trial(uint32_t kind)
{
    const uint32_t length = 1U + random_below(40);
    for (uint32_t k = 0; k < length; ++k) {
        move();
        stand_period(&s);
        assert_int_equal(stand_state(&s), GUST_STATE_RUN);
    }
    struck_period(kind, random_below(2) != 0);
    const uint32_t lasting = 1U + random_below(8);
    for (uint32_t k = 0; k < lasting; ++k) {
        move();
        /* While the bus is held the converter's own frames pile up, so it keeps quiet. */
        if (kind == HELD_BUS) {
            stand_finish(&s);
        } else {
            stand_period(&s);
        }
    }
    mend(kind);
    stand_period(&s);
    assert_int_equal(stand_state(&s), GUST_STATE_SAFE);
    stand_press(&s, GUST_COMMAND_START);
    stand_periods(&s, 1U + random_below(60));
    stand_press(&s, GUST_COMMAND_STOP);
    stand_period(&s);
    stand_command(&s, GUST_COMMAND_RESET, s.nonce); /* an old nonce */
    stand_period(&s);
    assert_int_equal(stand_state(&s), GUST_STATE_SAFE);
    assert_false(s.heard.enabled);
    stand_run(&s);
}

static void trials(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_database, false);
    stand_run(&s);
    uint32_t kinds[N_KINDS] = {0};
    for (uint32_t k = 0; k < TRIALS; ++k) {
        const uint32_t kind = random_below(N_KINDS);
        ++kinds[kind];
        trial(kind);
    }
    print_message("%u trials: %u bus-off, %u emergency stop, %u queue full, %u bus held; worst age %llu ns\n",
                  TRIALS, kinds[0], kinds[1], kinds[2], kinds[3], (unsigned long long)s.worst_age);
    assert_true(s.worst_age <= PERIOD_NS);
    assert_true(s.worst_age > 0); /* something was measured */
    assert_int_equal(s.out_of_range, 0);
    for (uint32_t k = 0; k < N_KINDS; ++k) {
        assert_true(kinds[k] > TRIALS / 8U);
    }
}

/* Frames of pure chance, with identifiers of the database: whatever it makes of them, no command leaves its
 * range and SAFE is left by nobody. */
static void noise(void **unused)
{
    (void)unused;
    stand_begin(&s, &test_database, false);
    stand_run(&s);
    for (uint32_t k = 0; k < 50000U; ++k) {
        gust_frame frame;
        memset(&frame, 0, sizeof frame);
        const gust_message *message = &test_database.messages[random_below(test_database.n_messages)];
        frame.id = random_below(8) == 0 ? random_below(0x800) : message->id;
        frame.flags = (uint8_t)(random_below(8) == 0 ? random_below(32) & ~GUST_FRAME_OWN : message->flags);
        frame.length = (uint8_t)(random_below(8) == 0 ? random_below(65) : message->length);
        for (uint32_t n = 0; n < frame.length; ++n) {
            frame.data[n] = (uint8_t)random_below(256);
        }
        gust_bus_inject(&s.bus.node[0], &frame);
        if (k % 8U == 0) {
            stand_finish(&s);
            assert_true(k < 64U || stand_state(&s) == GUST_STATE_SAFE);
        }
    }
    assert_int_equal(s.out_of_range, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(trials), cmocka_unit_test(noise)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
