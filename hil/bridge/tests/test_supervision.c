/* Supervision alone: every fault in every state, every way in and out, every count at its limit and one beyond.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "gustform_bridge/supervision.h"

#define QUIET 20U

static const gust_period GOOD = {.periods = 1, .sync = true, .sample = true};
static const gust_period LOST = {.periods = 1, .sync = true};

#define BIT(number, name, sentence) UINT32_C(1) << number##U,
static const uint32_t FAULTS[] = {GUST_FAULT_LIST(BIT)};
#undef BIT
#define N_FAULTS (sizeof FAULTS / sizeof FAULTS[0])

static void ticks(gust_supervision *s, const gust_period *period, uint32_t n)
{
    for (uint32_t k = 0; k < n; ++k) {
        gust_supervision_tick(s, period);
    }
}

static void begin(gust_supervision *s)
{
    gust_limits limits;
    gust_limits_default(&limits);
    gust_supervision_start(s, &limits);
}

static void to_ready(gust_supervision *s)
{
    gust_supervision_heartbeat(s);
    gust_supervision_fingerprint(s, true);
    ticks(s, &GOOD, QUIET + 2U);
    assert_int_equal(s->state, GUST_STATE_READY);
}

static gust_answer command(gust_supervision *s, gust_command what)
{
    return gust_supervision_command(s, what, s->nonce + 1U);
}

/* Brought to a state by the way that leads there. */
static void bring(gust_supervision *s, gust_state state)
{
    begin(s);
    if (state == GUST_STATE_INIT) {
        return;
    }
    to_ready(s);
    if (state == GUST_STATE_RUN) {
        assert_int_equal(command(s, GUST_COMMAND_START), GUST_ANSWER_DONE);
    } else if (state == GUST_STATE_SAFE) {
        gust_supervision_raise(s, GUST_FAULT_WATCHDOG);
    }
    assert_int_equal(s->state, state);
}

static void defaults(void **unused)
{
    (void)unused;
    struct {
        gust_limits limits;
        double beyond;
    } room;
    memset(&room, 0xff, sizeof room);
    gust_limits_default(&room.limits);
    assert_true(isnan(room.beyond)); /* untouched */
    const gust_limits limits = room.limits;
    assert_int_equal(limits.missing, 2);
    assert_int_equal(limits.drift, 1);
    assert_int_equal(limits.deadlines, 2);
    assert_int_equal(limits.quiet, QUIET);
    assert_int_equal(limits.heartbeat, 300);
    assert_int_equal(limits.set_points, 0);
    assert_int_equal(limits.errors, 2);
    assert_int_equal(limits.error_mask, 0xffffffdb);
    assert_true(limits.fingerprint);
    for (uint32_t k = 0; k < GUST_SUPERVISED_VALUES; ++k) {
        assert_true(isinf(limits.rate[k]) && limits.rate[k] > 0.0);
    }
    gust_supervision s;
    memset(&s, 0xff, sizeof s);
    gust_supervision_start(&s, &limits);
    assert_int_equal(s.state, GUST_STATE_INIT);
    assert_int_equal(s.faults, 0);
    assert_memory_equal(&s.limits, &limits, sizeof limits);
}

static void every_fault_in_every_state(void **unused)
{
    (void)unused;
    for (size_t k = 0; k < N_FAULTS; ++k) {
        for (unsigned from = GUST_STATE_INIT; from <= GUST_STATE_SAFE; ++from) {
            gust_supervision s;
            bring(&s, (gust_state)from);
            const uint32_t before = s.faults;
            gust_supervision_raise(&s, FAULTS[k]);
            const bool waits = from == GUST_STATE_INIT && (FAULTS[k] & GUST_FAULTS_WAITING) != 0;
            assert_int_equal(s.state, waits ? GUST_STATE_INIT : GUST_STATE_SAFE);
            assert_int_equal(s.faults, waits ? 0 : before | FAULTS[k]);
        }
    }
}

/* Which faults may wait is part of the policy, so it stands here a second time. */
static void faults_that_wait(void **unused)
{
    (void)unused;
    const uint32_t expected = (1U << 0U) | (1U << 1U) | (1U << 2U) | (1U << 3U) | (1U << 8U) | (1U << 10U) |
                              (1U << 11U) | (1U << 14U) | (1U << 16U) | (1U << 17U) | (1U << 18U);
    assert_int_equal(GUST_FAULTS_WAITING, expected);
}

static void no_fault_is_none(void **unused)
{
    (void)unused;
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    gust_supervision_raise(&s, 0);
    assert_int_equal(s.state, GUST_STATE_RUN);
    gust_supervision_raise(&s, GUST_FAULT_SEND);
    ticks(&s, &GOOD, 7);
    const uint32_t silent = s.silent;
    gust_supervision_raise(&s, 0);
    assert_int_equal(s.silent, silent); /* nothing is no news */
}

/* Every command in every state. */
static void commands(void **unused)
{
    (void)unused;
    static const struct {
        gust_state from;
        gust_command what;
        gust_state to;
        gust_answer answer;
    } table[] = {
        {GUST_STATE_INIT, GUST_COMMAND_NONE, GUST_STATE_INIT, GUST_ANSWER_REFUSED},
        {GUST_STATE_INIT, GUST_COMMAND_START, GUST_STATE_INIT, GUST_ANSWER_REFUSED},
        {GUST_STATE_INIT, GUST_COMMAND_STOP, GUST_STATE_INIT, GUST_ANSWER_REFUSED},
        {GUST_STATE_INIT, GUST_COMMAND_RESET, GUST_STATE_INIT, GUST_ANSWER_REFUSED},
        {GUST_STATE_READY, GUST_COMMAND_NONE, GUST_STATE_READY, GUST_ANSWER_REFUSED},
        {GUST_STATE_READY, GUST_COMMAND_START, GUST_STATE_RUN, GUST_ANSWER_DONE},
        {GUST_STATE_READY, GUST_COMMAND_STOP, GUST_STATE_READY, GUST_ANSWER_REFUSED},
        {GUST_STATE_READY, GUST_COMMAND_RESET, GUST_STATE_READY, GUST_ANSWER_REFUSED},
        {GUST_STATE_RUN, GUST_COMMAND_NONE, GUST_STATE_RUN, GUST_ANSWER_REFUSED},
        {GUST_STATE_RUN, GUST_COMMAND_START, GUST_STATE_RUN, GUST_ANSWER_REFUSED},
        {GUST_STATE_RUN, GUST_COMMAND_STOP, GUST_STATE_READY, GUST_ANSWER_DONE},
        {GUST_STATE_RUN, GUST_COMMAND_RESET, GUST_STATE_RUN, GUST_ANSWER_REFUSED},
        {GUST_STATE_SAFE, GUST_COMMAND_NONE, GUST_STATE_SAFE, GUST_ANSWER_REFUSED},
        {GUST_STATE_SAFE, GUST_COMMAND_START, GUST_STATE_SAFE, GUST_ANSWER_REFUSED},
        {GUST_STATE_SAFE, GUST_COMMAND_STOP, GUST_STATE_SAFE, GUST_ANSWER_REFUSED},
        {GUST_STATE_SAFE, GUST_COMMAND_RESET, GUST_STATE_INIT, GUST_ANSWER_DONE},
    };
    for (size_t k = 0; k < sizeof table / sizeof table[0]; ++k) {
        gust_supervision s;
        bring(&s, table[k].from);
        ticks(&s, &GOOD, table[k].from == GUST_STATE_SAFE ? QUIET + 1U : 0);
        assert_int_equal(command(&s, table[k].what), table[k].answer);
        assert_int_equal(s.state, table[k].to);
        /* The same once more does nothing. */
        assert_int_equal(gust_supervision_command(&s, table[k].what, s.nonce), GUST_ANSWER_REPEATED);
        assert_int_equal(s.state, table[k].to);
    }
}

static void first_nonce_may_be_any(void **unused)
{
    (void)unused;
    gust_supervision s;
    begin(&s);
    to_ready(&s);
    assert_int_equal(gust_supervision_command(&s, GUST_COMMAND_START, 0), GUST_ANSWER_DONE);
    assert_int_equal(gust_supervision_command(&s, GUST_COMMAND_STOP, 0), GUST_ANSWER_REPEATED);
    assert_int_equal(s.state, GUST_STATE_RUN);
}

/* A refused command has used up its nonce: a repeat must not act later, when the state is another one. */
static void refused_nonce_is_spent(void **unused)
{
    (void)unused;
    gust_supervision s;
    begin(&s);
    assert_int_equal(gust_supervision_command(&s, GUST_COMMAND_START, 7), GUST_ANSWER_REFUSED);
    to_ready(&s);
    assert_int_equal(gust_supervision_command(&s, GUST_COMMAND_START, 7), GUST_ANSWER_REPEATED);
    assert_int_equal(s.state, GUST_STATE_READY);
}

static void reset_waits_for_quiet(void **unused)
{
    (void)unused;
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    gust_supervision_raise(&s, GUST_FAULT_MASQUERADE);
    ticks(&s, &GOOD, QUIET);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_REFUSED);
    assert_int_equal(s.state, GUST_STATE_SAFE);
    ticks(&s, &GOOD, 1);
    assert_int_equal(s.faults, GUST_FAULT_MASQUERADE); /* told until the reset */
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_DONE);
    assert_int_equal(s.faults, 0);
    assert_int_equal(s.state, GUST_STATE_INIT);
    ticks(&s, &GOOD, 1);
    assert_int_equal(s.state, GUST_STATE_READY); /* never RUN by itself */
    ticks(&s, &GOOD, 1000);
    assert_int_equal(s.state, GUST_STATE_SAFE); /* no heartbeat meanwhile */
}

static void new_fault_begins_the_wait_anew(void **unused)
{
    (void)unused;
    gust_supervision s;
    bring(&s, GUST_STATE_SAFE);
    ticks(&s, &GOOD, QUIET);
    gust_supervision_raise(&s, GUST_FAULT_SEND);
    ticks(&s, &GOOD, QUIET);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_REFUSED);
    ticks(&s, &GOOD, 1);
    assert_int_equal(s.faults, GUST_FAULT_WATCHDOG | GUST_FAULT_SEND);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_DONE);
}

/* Causes that last hold SAFE for as long as they last. */
static void persisting_causes(void **unused)
{
    (void)unused;
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    gust_supervision_converter(&s, GUST_CONVERTER_TRIPPED);
    assert_int_equal(s.faults, GUST_FAULT_CONVERTER);
    ticks(&s, &GOOD, 5 * QUIET);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_REFUSED);
    gust_supervision_converter(&s, GUST_CONVERTER_READY);
    ticks(&s, &GOOD, QUIET + 1U);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_DONE);

    bring(&s, GUST_STATE_RUN);
    gust_supervision_fingerprint(&s, false);
    assert_int_equal(s.faults, GUST_FAULT_FINGERPRINT);
    ticks(&s, &GOOD, 5 * QUIET);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_REFUSED);
    gust_supervision_fingerprint(&s, true);
    ticks(&s, &GOOD, QUIET + 1U);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_DONE);

    bring(&s, GUST_STATE_RUN);
    ticks(&s, &LOST, 5 * QUIET);
    assert_int_equal(s.faults, GUST_FAULT_TIMEOUT);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_REFUSED);
    ticks(&s, &GOOD, QUIET);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_REFUSED);
    ticks(&s, &GOOD, 1);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_DONE);
}

/* INIT ends when the fingerprint, the heartbeat and a fresh sample are there and nothing is wrong. */
static void way_to_ready(void **unused)
{
    (void)unused;
    for (unsigned without = 0; without < 4U; ++without) {
        gust_supervision s;
        begin(&s);
        if (without != 1U) {
            gust_supervision_heartbeat(&s);
        }
        if (without != 2U) {
            gust_supervision_fingerprint(&s, true);
        }
        ticks(&s, without == 3U ? &LOST : &GOOD, 100);
        assert_int_equal(s.state, without == 0 ? GUST_STATE_READY : GUST_STATE_INIT);
        assert_int_equal(s.faults, 0);
    }
    gust_supervision s;
    begin(&s);
    s.limits.fingerprint = false; /* the database has none */
    s.limits.heartbeat = 0;
    ticks(&s, &GOOD, QUIET);
    assert_int_equal(s.state, GUST_STATE_INIT); /* time to hear whoever repeats an old command */
    ticks(&s, &GOOD, 1);
    assert_int_equal(s.state, GUST_STATE_READY);
    begin(&s);
    gust_supervision_heartbeat(&s);
    gust_supervision_fingerprint(&s, true);
    gust_supervision_converter(&s, GUST_CONVERTER_TRIPPED);
    ticks(&s, &GOOD, 100);
    assert_int_equal(s.state, GUST_STATE_INIT);
    gust_supervision_converter(&s, GUST_CONVERTER_OFF);
    ticks(&s, &GOOD, QUIET);
    assert_int_equal(s.state, GUST_STATE_INIT);
    ticks(&s, &GOOD, 1);
    assert_int_equal(s.state, GUST_STATE_READY);
}

static void losses(void **unused)
{
    (void)unused;
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    for (int k = 0; k < 5; ++k) { /* tolerated again and again, if good ones are between */
        ticks(&s, &LOST, 2);
        assert_false(s.fresh);
        assert_int_equal(s.state, GUST_STATE_RUN);
        gust_period after = GOOD;
        after.lost = 2;
        ticks(&s, &after, 1);
        assert_true(s.fresh);
        assert_int_equal(s.elapsed, 3);
        assert_int_equal(s.state, GUST_STATE_RUN);
    }
    ticks(&s, &GOOD, 1);
    assert_int_equal(s.elapsed, 1);
    ticks(&s, &LOST, 3);
    assert_int_equal(s.state, GUST_STATE_SAFE);
    assert_int_equal(s.faults, GUST_FAULT_TIMEOUT);
}

/* The limit is the limit, whatever it is. */
static void other_limits(void **unused)
{
    (void)unused;
    for (uint32_t missing = 0; missing < 6U; ++missing) {
        gust_supervision s;
        bring(&s, GUST_STATE_RUN);
        s.limits.missing = missing;
        ticks(&s, &LOST, missing);
        assert_int_equal(s.state, GUST_STATE_RUN);
        ticks(&s, &LOST, 1);
        assert_int_equal(s.state, GUST_STATE_SAFE);
    }
}

static void causes_of_losses(void **unused)
{
    (void)unused;
    static const struct {
        gust_decoded why;
        uint32_t fault;
    } counted[] = {{GUST_WRONG_LENGTH, GUST_FAULT_LENGTH}, {GUST_BAD_CRC, GUST_FAULT_CRC}};
    for (size_t k = 0; k < 2; ++k) {
        gust_supervision s;
        bring(&s, GUST_STATE_RUN);
        for (int n = 0; n < 3; ++n) {
            assert_int_equal(s.state, GUST_STATE_RUN);
            gust_supervision_reject(&s, counted[k].why, true);
            ticks(&s, &LOST, 1);
        }
        assert_int_equal(s.state, GUST_STATE_SAFE);
        assert_int_equal(s.faults, counted[k].fault);
        /* of frames that are not samples they are nobody's business */
        bring(&s, GUST_STATE_RUN);
        for (int n = 0; n < 9; ++n) {
            gust_supervision_reject(&s, counted[k].why, false);
            ticks(&s, &GOOD, 1);
        }
        for (int n = 0; n < 3; ++n) {
            gust_supervision_reject(&s, counted[k].why, false);
            ticks(&s, &LOST, 1);
        }
        assert_int_equal(s.faults, GUST_FAULT_TIMEOUT);
    }
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    for (int n = 0; n < 3; ++n) {
        gust_supervision_repeat(&s);
        ticks(&s, &LOST, 1);
    }
    assert_int_equal(s.faults, GUST_FAULT_STALE);
    /* Different ones in a row are all told; those before the last good sample are not. */
    bring(&s, GUST_STATE_RUN);
    gust_supervision_repeat(&s);
    ticks(&s, &LOST, 1);
    ticks(&s, &GOOD, 1);
    ticks(&s, &LOST, 1);
    gust_supervision_reject(&s, GUST_BAD_CRC, true);
    ticks(&s, &LOST, 1);
    assert_int_equal(s.state, GUST_STATE_RUN);
    gust_supervision_reject(&s, GUST_WRONG_LENGTH, true);
    ticks(&s, &LOST, 1);
    assert_int_equal(s.faults, GUST_FAULT_TIMEOUT | GUST_FAULT_CRC | GUST_FAULT_LENGTH);
    /* What came beside a good sample is no reason for the losses after it. */
    bring(&s, GUST_STATE_RUN);
    gust_supervision_repeat(&s);
    ticks(&s, &GOOD, 1);
    ticks(&s, &LOST, 3);
    assert_int_equal(s.faults, GUST_FAULT_TIMEOUT);
}

static void lose_for_many_reasons(gust_supervision *s, gust_decoded first, gust_decoded second)
{
    gust_period late = GOOD;
    late.lag = 1;
    for (int n = 0; n < 3; ++n) {
        gust_supervision_reject(s, first, true);
        gust_supervision_reject(s, second, true);
        gust_supervision_repeat(s);
        ticks(s, &late, 1);
    }
}

/* One reason does not hide another. */
static void several_reasons(void **unused)
{
    (void)unused;
    const uint32_t both = (uint32_t)GUST_FAULT_CRC | (uint32_t)GUST_FAULT_LENGTH;
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    lose_for_many_reasons(&s, GUST_BAD_CRC, GUST_WRONG_LENGTH);
    assert_int_equal(s.faults, both | (uint32_t)GUST_FAULT_STALE);
    bring(&s, GUST_STATE_RUN);
    lose_for_many_reasons(&s, GUST_WRONG_LENGTH, GUST_BAD_CRC);
    assert_int_equal(s.faults, both | (uint32_t)GUST_FAULT_STALE);
    bring(&s, GUST_STATE_RUN); /* and what is no reason adds none */
    for (int n = 0; n < 3; ++n) {
        gust_supervision_reject(&s, GUST_BAD_CRC, false);
        gust_supervision_reject(&s, GUST_WRONG_LENGTH, false);
        gust_supervision_repeat(&s);
        ticks(&s, &LOST, 1);
    }
    assert_int_equal(s.faults, GUST_FAULT_STALE);
    bring(&s, GUST_STATE_RUN);
    gust_period late = GOOD;
    late.lag = 3;
    late.lost = 9;
    ticks(&s, &late, 1);
    assert_int_equal(s.faults, GUST_FAULT_COUNTER | GUST_FAULT_STALE);
    bring(&s, GUST_STATE_RUN);
    const gust_period silence = {.periods = 1};
    for (int n = 0; n < 3; ++n) {
        gust_supervision_reject(&s, GUST_BAD_CRC, true);
        ticks(&s, &silence, 1);
    }
    assert_int_equal(s.faults, GUST_FAULT_CRC | GUST_FAULT_TIMEOUT);
    bring(&s, GUST_STATE_RUN);
    s.limits.set_points = 300;
    gust_supervision_heartbeat(&s);
    gust_supervision_set_points(&s);
    ticks(&s, &GOOD, 301);
    assert_int_equal(s.faults, GUST_FAULT_HEARTBEAT | GUST_FAULT_TIMEOUT);
    bring(&s, GUST_STATE_RUN);
    gust_supervision_heartbeat(&s);
    gust_supervision_fingerprint(&s, false);
    gust_supervision_converter(&s, GUST_CONVERTER_TRIPPED);
    ticks(&s, &GOOD, 300);
    const uint32_t lasting = (uint32_t)GUST_FAULT_FINGERPRINT | (uint32_t)GUST_FAULT_CONVERTER;
    assert_int_equal(s.faults, lasting);
    ticks(&s, &GOOD, 1);
    assert_int_equal(s.faults, lasting | (uint32_t)GUST_FAULT_HEARTBEAT);
}

static void wrong_under_a_good_crc(void **unused)
{
    (void)unused;
    static const struct {
        gust_decoded why;
        uint32_t fault;
    } table[] = {{GUST_UNKNOWN_MULTIPLEXER, GUST_FAULT_MULTIPLEXER},
                 {GUST_NOT_FINITE, GUST_FAULT_NOT_FINITE},
                 {GUST_OUT_OF_RANGE, GUST_FAULT_RANGE},
                 {GUST_DECODED, 0},
                 {GUST_UNKNOWN_ID, 0}};
    for (size_t k = 0; k < sizeof table / sizeof table[0]; ++k) {
        for (int cyclic = 0; cyclic < 2; ++cyclic) {
            gust_supervision s;
            bring(&s, GUST_STATE_RUN);
            gust_supervision_reject(&s, table[k].why, cyclic != 0);
            assert_int_equal(s.faults, table[k].fault);
            assert_int_equal(s.state, table[k].fault != 0 ? GUST_STATE_SAFE : GUST_STATE_RUN);
        }
    }
}

/* A counter may jump over what was missed, over what the loop itself missed, and by the drift of the clocks. */
static void counter_jumps(void **unused)
{
    (void)unused;
    for (uint32_t drift = 0; drift < 2U; ++drift) {
        for (uint32_t missed = 0; missed < 3U; ++missed) {
            for (uint32_t periods = 1; periods < 3U; ++periods) {
                for (uint32_t lost = 0; lost < 8U; ++lost) {
                    gust_supervision s;
                    bring(&s, GUST_STATE_RUN);
                    s.limits.drift = drift;
                    ticks(&s, &LOST, missed);
                    gust_period period = GOOD;
                    period.lost = lost;
                    period.periods = periods;
                    ticks(&s, &period, 1);
                    const bool explained = lost <= missed + (periods - 1U) + drift;
                    assert_int_equal(s.state, explained ? GUST_STATE_RUN : GUST_STATE_SAFE);
                    assert_int_equal(s.faults, explained ? 0 : GUST_FAULT_COUNTER);
                }
            }
        }
    }
    gust_supervision s;
    begin(&s);
    gust_period first = GOOD;
    first.lost = 99; /* the first one follows nothing */
    gust_supervision_heartbeat(&s);
    gust_supervision_fingerprint(&s, true);
    ticks(&s, &first, 1);
    assert_int_equal(s.silent, 1);
    ticks(&s, &GOOD, QUIET);
    assert_int_equal(s.state, GUST_STATE_READY);
}

static void lag(void **unused)
{
    (void)unused;
    for (int32_t behind = -6; behind < 6; ++behind) {
        gust_supervision s;
        bring(&s, GUST_STATE_RUN);
        gust_period period = GOOD;
        period.lag = behind;
        ticks(&s, &period, 1);
        uint32_t expected = behind > 2 ? GUST_FAULT_STALE : 0;
        expected |= behind < -3 ? GUST_FAULT_COUNTER : 0;
        assert_int_equal(s.faults, expected);
        assert_int_equal(s.state, expected != 0 ? GUST_STATE_SAFE : GUST_STATE_RUN);
        assert_int_equal(s.fresh, behind <= 0);
        if (expected == 0 && behind > 0) { /* late, so it counts as missing */
            ticks(&s, &period, 1);
            assert_int_equal(s.state, GUST_STATE_RUN);
            ticks(&s, &period, 1);
            assert_int_equal(s.faults, GUST_FAULT_STALE);
        }
    }
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    gust_period nothing = LOST;
    nothing.lag = 99; /* of no sample at all */
    ticks(&s, &nothing, 1);
    assert_int_equal(s.state, GUST_STATE_RUN);
}

static void sync_is_missed(void **unused)
{
    (void)unused;
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    gust_period period = GOOD;
    period.sync = false;
    ticks(&s, &period, 2);
    ticks(&s, &GOOD, 1);
    ticks(&s, &period, 2);
    assert_int_equal(s.state, GUST_STATE_RUN);
    ticks(&s, &period, 1);
    assert_int_equal(s.faults, GUST_FAULT_TIMEOUT);
    bring(&s, GUST_STATE_RUN);
    period.periods = 3;
    ticks(&s, &period, 1);
    assert_int_equal(s.faults, GUST_FAULT_TIMEOUT);
}

static void missed_periods(void **unused)
{
    (void)unused;
    for (uint32_t periods = 1; periods < 6U; ++periods) {
        gust_supervision s;
        bring(&s, GUST_STATE_RUN);
        gust_period period = GOOD;
        period.periods = periods;
        ticks(&s, &period, 1);
        assert_int_equal(s.faults, periods > 3U ? GUST_FAULT_DEADLINE : 0);
        assert_int_equal(s.elapsed, periods);
        bring(&s, GUST_STATE_RUN);
        period.sample = false; /* they count as losses, too */
        ticks(&s, &period, 1);
        assert_int_equal(s.state, periods > 2U ? GUST_STATE_SAFE : GUST_STATE_RUN);
    }
}

static void to_ready_again(gust_supervision *s)
{
    gust_supervision_heartbeat(s);
    gust_supervision_fingerprint(s, true);
    ticks(s, &GOOD, QUIET + 1U);
    assert_int_equal(command(s, GUST_COMMAND_RESET), GUST_ANSWER_DONE);
    ticks(s, &GOOD, 1);
    assert_int_equal(s->state, GUST_STATE_READY);
}

static void heartbeat_stops(void **unused)
{
    (void)unused;
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    gust_supervision_heartbeat(&s);
    ticks(&s, &GOOD, 300);
    assert_int_equal(s.state, GUST_STATE_RUN);
    ticks(&s, &GOOD, 1);
    assert_int_equal(s.faults, GUST_FAULT_HEARTBEAT);
    ticks(&s, &GOOD, 2 * QUIET);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_REFUSED);
    gust_supervision_heartbeat(&s);
    ticks(&s, &GOOD, QUIET + 1U);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_DONE);
    ticks(&s, &GOOD, 100); /* who comes back has to say again who it is */
    assert_int_equal(s.state, GUST_STATE_INIT);
    gust_supervision_fingerprint(&s, true);
    ticks(&s, &GOOD, 1);
    assert_int_equal(s.state, GUST_STATE_READY);
    /* A heartbeat that stopped stays stopped, however far its age is counted. */
    ticks(&s, &GOOD, 301);
    assert_int_equal(s.faults, GUST_FAULT_HEARTBEAT);
    s.since_heartbeat = UINT32_MAX;
    ticks(&s, &GOOD, 1);
    assert_int_equal(s.since_heartbeat, 0);
    assert_int_equal(s.silent, 0);
    /* periods that were missed count as well */
    to_ready_again(&s);
    gust_period three = GOOD;
    three.periods = 3;
    gust_supervision_heartbeat(&s);
    ticks(&s, &three, 100);
    assert_int_equal(s.state, GUST_STATE_READY);
    ticks(&s, &three, 1);
    assert_int_equal(s.state, GUST_STATE_SAFE);
    /* and where the database has none, nobody waits for it */
    bring(&s, GUST_STATE_RUN);
    s.limits.heartbeat = 0;
    ticks(&s, &GOOD, 2000);
    assert_int_equal(s.state, GUST_STATE_RUN);
}

static void set_points_stop(void **unused)
{
    (void)unused;
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    s.limits.heartbeat = 0;
    s.limits.set_points = 50;
    gust_supervision_set_points(&s);
    ticks(&s, &GOOD, 50);
    assert_int_equal(s.state, GUST_STATE_RUN);
    gust_supervision_set_points(&s);
    gust_period two = GOOD;
    two.periods = 2;
    ticks(&s, &two, 25);
    assert_int_equal(s.state, GUST_STATE_RUN);
    ticks(&s, &GOOD, 1);
    assert_int_equal(s.faults, GUST_FAULT_TIMEOUT);
}

static void converter_leaves(void **unused)
{
    (void)unused;
    for (uint32_t state = GUST_CONVERTER_OFF; state <= GUST_CONVERTER_TRIPPED; ++state) {
        gust_supervision s;
        bring(&s, GUST_STATE_RUN); /* it may take its time to start */
        gust_supervision_converter(&s, GUST_CONVERTER_READY);
        gust_supervision_converter(&s, GUST_CONVERTER_OFF);
        ticks(&s, &GOOD, 100);
        assert_int_equal(s.state, GUST_STATE_RUN);
        gust_supervision_converter(&s, GUST_CONVERTER_RUNNING);
        gust_supervision_converter(&s, GUST_CONVERTER_RUNNING);
        assert_int_equal(s.state, GUST_STATE_RUN);
        gust_supervision_converter(&s, state);
        assert_int_equal(s.faults, state == GUST_CONVERTER_RUNNING ? 0 : GUST_FAULT_CONVERTER);
    }
    gust_supervision s;
    bring(&s, GUST_STATE_RUN); /* stopped and started again: it may take its time again */
    gust_supervision_converter(&s, GUST_CONVERTER_RUNNING);
    assert_int_equal(command(&s, GUST_COMMAND_STOP), GUST_ANSWER_DONE);
    gust_supervision_converter(&s, GUST_CONVERTER_READY);
    assert_int_equal(s.state, GUST_STATE_READY);
    assert_int_equal(command(&s, GUST_COMMAND_START), GUST_ANSWER_DONE);
    gust_supervision_converter(&s, GUST_CONVERTER_READY);
    assert_int_equal(s.state, GUST_STATE_RUN);
    /* running while it is not asked to is told when it trips, not before */
    bring(&s, GUST_STATE_READY);
    gust_supervision_converter(&s, GUST_CONVERTER_RUNNING);
    assert_int_equal(command(&s, GUST_COMMAND_START), GUST_ANSWER_DONE);
    gust_supervision_converter(&s, GUST_CONVERTER_READY);
    assert_int_equal(s.state, GUST_STATE_RUN);
}

static void plausibility(void **unused)
{
    (void)unused;
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    s.limits.rate[1] = 0.25;
    ticks(&s, &GOOD, 1);
    gust_supervision_measured(&s, (double[]){5.0, 1.0}, 2);    /* the first one follows nothing */
    gust_supervision_measured(&s, (double[]){-50.0, 1.25}, 2); /* any change of the other one is allowed */
    gust_supervision_measured(&s, (double[]){-50.0, 1.0}, 2);
    assert_int_equal(s.state, GUST_STATE_RUN);
    ticks(&s, &LOST, 2);
    ticks(&s, &GOOD, 1);
    gust_supervision_measured(&s, (double[]){0.0, 1.75}, 2); /* three periods long */
    assert_int_equal(s.state, GUST_STATE_RUN);
    ticks(&s, &GOOD, 1);
    gust_supervision_measured(&s, (double[]){0.0, 1.4375}, 2);
    assert_int_equal(s.faults, GUST_FAULT_PLAUSIBILITY);
    /* After a reset the past is forgotten. */
    ticks(&s, &GOOD, QUIET + 1U);
    assert_int_equal(command(&s, GUST_COMMAND_RESET), GUST_ANSWER_DONE);
    ticks(&s, &GOOD, 1);
    gust_supervision_measured(&s, (double[]){0.0, 9.0}, 2);
    assert_int_equal(s.state, GUST_STATE_READY);
    bring(&s, GUST_STATE_RUN); /* upwards as well, and what is beyond n is not looked at */
    s.limits.rate[0] = 0.25;
    s.limits.rate[1] = 0.25;
    ticks(&s, &GOOD, 1);
    gust_supervision_measured(&s, (double[]){1.0, 1.0}, 2);
    gust_supervision_measured(&s, (double[]){1.0, 9.0}, 1);
    assert_int_equal(s.state, GUST_STATE_RUN);
    gust_supervision_measured(&s, (double[]){1.3125}, 1);
    assert_int_equal(s.faults, GUST_FAULT_PLAUSIBILITY);
}

static void controller_errors(void **unused)
{
    (void)unused;
    gust_supervision s;
    bring(&s, GUST_STATE_RUN);
    for (int k = 0; k < 20; ++k) {
        gust_supervision_stepped(&s, 4U); /* an output at its limit is none */
        gust_supervision_stepped(&s, 1U);
        gust_supervision_stepped(&s, 0x80000000U);
        gust_supervision_stepped(&s, 0);
    }
    assert_int_equal(s.state, GUST_STATE_RUN);
    gust_supervision_stepped(&s, 1U);
    gust_supervision_stepped(&s, 8U);
    assert_int_equal(s.state, GUST_STATE_RUN);
    gust_supervision_stepped(&s, 5U);
    assert_int_equal(s.faults, GUST_FAULT_CONTROLLER);
    bring(&s, GUST_STATE_RUN); /* a new start begins with a clean sheet */
    gust_supervision_stepped(&s, 1U);
    gust_supervision_stepped(&s, 1U);
    assert_int_equal(command(&s, GUST_COMMAND_STOP), GUST_ANSWER_DONE);
    assert_int_equal(command(&s, GUST_COMMAND_START), GUST_ANSWER_DONE);
    gust_supervision_stepped(&s, 1U);
    gust_supervision_stepped(&s, 1U);
    assert_int_equal(s.state, GUST_STATE_RUN);
    gust_supervision_stepped(&s, 1U);
    assert_int_equal(s.state, GUST_STATE_SAFE);
}

static void differences(void **unused)
{
    (void)unused;
    const uint64_t word = UINT64_C(1) << 32U;
    assert_int_equal(gust_sample_difference(5, 3, word), 2);
    assert_int_equal(gust_sample_difference(3, 5, word), -2);
    assert_int_equal(gust_sample_difference(1, UINT32_MAX, word), 2);
    assert_int_equal(gust_sample_difference(UINT32_MAX, 1, word), -2);
    assert_int_equal(gust_sample_difference(0x7fffffff, 0, word), INT32_MAX);
    assert_int_equal(gust_sample_difference(0x80000000U, 0, word), INT32_MIN);
    for (uint32_t a = 0; a < 16U; ++a) {
        for (int32_t d = -8; d < 8; ++d) {
            const uint32_t b = (a + 16U - (uint32_t)d) % 16U;
            assert_int_equal(gust_sample_difference(a, b, 16), d);
        }
    }
    assert_int_equal(gust_sample_difference(3, 18, 16), 1); /* b of a longer counter */
    assert_int_equal(gust_sample_difference(19, 2, 16), 1); /* a of a longer one */
    assert_int_equal(gust_sample_difference(3, 52, 10), 1); /* and of one that is no power of two */
    assert_int_equal(gust_sample_difference(1, 9, 10), 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(defaults),
        cmocka_unit_test(every_fault_in_every_state),
        cmocka_unit_test(faults_that_wait),
        cmocka_unit_test(no_fault_is_none),
        cmocka_unit_test(commands),
        cmocka_unit_test(first_nonce_may_be_any),
        cmocka_unit_test(refused_nonce_is_spent),
        cmocka_unit_test(reset_waits_for_quiet),
        cmocka_unit_test(new_fault_begins_the_wait_anew),
        cmocka_unit_test(persisting_causes),
        cmocka_unit_test(way_to_ready),
        cmocka_unit_test(losses),
        cmocka_unit_test(other_limits),
        cmocka_unit_test(causes_of_losses),
        cmocka_unit_test(several_reasons),
        cmocka_unit_test(wrong_under_a_good_crc),
        cmocka_unit_test(counter_jumps),
        cmocka_unit_test(lag),
        cmocka_unit_test(sync_is_missed),
        cmocka_unit_test(missed_periods),
        cmocka_unit_test(heartbeat_stops),
        cmocka_unit_test(set_points_stop),
        cmocka_unit_test(converter_leaves),
        cmocka_unit_test(plausibility),
        cmocka_unit_test(controller_errors),
        cmocka_unit_test(differences),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
