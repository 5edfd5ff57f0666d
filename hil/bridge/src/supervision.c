#include "gustform_bridge/supervision.h"

#include <math.h>
#include <string.h>

#define ERRORS_THAT_COUNT UINT32_C(0xffffffdb)

void gust_limits_default(gust_limits *limits)
{
    memset(limits, 0, sizeof *limits);
    limits->missing = 2;
    limits->drift = 1;
    limits->deadlines = 2;
    limits->quiet = 20;
    limits->heartbeat = 300;
    limits->errors = 2;
    limits->error_mask = ERRORS_THAT_COUNT;
    limits->fingerprint = true;
    for (uint32_t k = 0; k < GUST_SUPERVISED_VALUES; ++k) {
        limits->rate[k] = INFINITY;
    }
}

void gust_supervision_start(gust_supervision *s, const gust_limits *limits)
{
    memset(s, 0, sizeof *s); /* state INIT, nothing heard */
    s->limits = *limits;
}

void gust_supervision_raise(gust_supervision *s, uint32_t faults)
{
    if (faults == 0) {
        return;
    }
    s->silent = 0;
    uint32_t leading = s->state == GUST_STATE_INIT ? faults & ~GUST_FAULTS_WAITING : faults;
    if (leading != 0) {
        s->state = GUST_STATE_SAFE;
        s->faults |= leading;
    }
}

void gust_supervision_reject(gust_supervision *s, gust_decoded why, bool cyclic)
{
    static const uint32_t FAULTS[] = {[GUST_DECODED] = 0,
                                      [GUST_UNKNOWN_ID] = 0,
                                      [GUST_WRONG_LENGTH] = GUST_FAULT_LENGTH,
                                      [GUST_BAD_CRC] = GUST_FAULT_CRC,
                                      [GUST_UNKNOWN_MULTIPLEXER] = GUST_FAULT_MULTIPLEXER,
                                      [GUST_NOT_FINITE] = GUST_FAULT_NOT_FINITE,
                                      [GUST_OUT_OF_RANGE] = GUST_FAULT_RANGE};
    if (why != GUST_WRONG_LENGTH && why != GUST_BAD_CRC) {
        gust_supervision_raise(s, FAULTS[why]);
    } else if (cyclic) {
        s->reasons |= FAULTS[why];
    }
}

void gust_supervision_repeat(gust_supervision *s)
{
    s->reasons |= (uint32_t)GUST_FAULT_STALE;
}

void gust_supervision_heartbeat(gust_supervision *s)
{
    s->heartbeat = true;
    s->since_heartbeat = 0;
}

void gust_supervision_set_points(gust_supervision *s)
{
    s->since_set_points = 0;
}

void gust_supervision_fingerprint(gust_supervision *s, bool ours)
{
    s->known = ours;
    s->stranger = !ours;
    if (s->stranger) {
        gust_supervision_raise(s, GUST_FAULT_FINGERPRINT);
    }
}

void gust_supervision_converter(gust_supervision *s, uint32_t state)
{
    s->converter = state;
    if (state == GUST_CONVERTER_TRIPPED) {
        gust_supervision_raise(s, GUST_FAULT_CONVERTER);
    } else if (s->state == GUST_STATE_RUN) {
        if (state == GUST_CONVERTER_RUNNING) {
            s->ran = true;
        } else if (s->ran) {
            gust_supervision_raise(s, GUST_FAULT_CONVERTER);
        }
    }
}

/* Nothing that persists: it would have been raised again. */
static bool quiet(const gust_supervision *s)
{
    return s->silent > s->limits.quiet;
}

gust_answer gust_supervision_command(gust_supervision *s, gust_command command, uint32_t nonce)
{
    if (s->commanded && nonce == s->nonce) {
        return GUST_ANSWER_REPEATED;
    }
    s->commanded = true;
    s->nonce = nonce;
    if (command == GUST_COMMAND_START && s->state == GUST_STATE_READY) {
        s->state = GUST_STATE_RUN;
        s->ran = false;
        s->wrong_steps = 0;
        return GUST_ANSWER_DONE;
    }
    if (command == GUST_COMMAND_STOP && s->state == GUST_STATE_RUN) {
        s->state = GUST_STATE_READY;
        return GUST_ANSWER_DONE;
    }
    if (command == GUST_COMMAND_RESET && s->state == GUST_STATE_SAFE && quiet(s)) {
        s->state = GUST_STATE_INIT;
        s->faults = 0;
        s->measured = false;
        return GUST_ANSWER_DONE;
    }
    return GUST_ANSWER_REFUSED;
}

/* Faults of one period's sample at once, and whether it is fresh. */
static uint32_t judge_sample(gust_supervision *s, const gust_period *period)
{
    const int32_t tolerated = (int32_t)s->limits.missing;
    s->fresh = false;
    if (!period->sample) {
        return 0;
    }
    /* What is lost was missed in earlier periods, or in periods that the loop itself missed; and a Sync may be
     * lost as often as a sample, so a sample may be ahead of the last one. */
    const uint32_t explained = s->missing + (period->periods - 1U) + s->limits.drift;
    const bool jumped = (s->sampled && period->lost > explained) || period->lag < -tolerated - 1;
    uint32_t faults = jumped ? (uint32_t)GUST_FAULT_COUNTER : 0;
    if (period->lag > tolerated) {
        faults |= (uint32_t)GUST_FAULT_STALE;
    } else if (period->lag > 0) {
        s->reasons |= (uint32_t)GUST_FAULT_STALE;
    } else {
        s->fresh = true;
    }
    s->sampled = true;
    return faults;
}

/* Periods in a row without a fresh sample; one that nothing accounts for is a loss. */
static uint32_t count_losses(gust_supervision *s, const gust_period *period)
{
    if (s->fresh) {
        s->elapsed = s->missing + period->periods;
        s->missing = 0;
        s->causes = 0;
    } else {
        s->missing += period->periods;
        s->causes |= s->reasons != 0 ? s->reasons : (uint32_t)GUST_FAULT_TIMEOUT;
    }
    s->reasons = 0;
    s->unsynced = period->sync ? 0 : s->unsynced + period->periods;
    uint32_t faults = s->missing > s->limits.missing ? s->causes : 0;
    if (s->unsynced > s->limits.missing) {
        faults |= (uint32_t)GUST_FAULT_TIMEOUT;
    }
    return faults;
}

/* What other messages have to say, and for how long they have not. */
static uint32_t count_silence(gust_supervision *s, const gust_period *period)
{
    s->since_heartbeat += period->periods;
    s->since_set_points += period->periods;
    const bool alive = s->heartbeat && s->since_heartbeat <= s->limits.heartbeat;
    uint32_t faults = 0;
    if (s->limits.heartbeat != 0 && !alive) {
        faults = GUST_FAULT_HEARTBEAT;
        s->known = false; /* who comes back has to say again who it is */
        s->heartbeat = false;
    }
    if (s->limits.set_points != 0 && s->since_set_points > s->limits.set_points) {
        faults |= (uint32_t)GUST_FAULT_TIMEOUT;
    }
    if (s->stranger) {
        faults |= (uint32_t)GUST_FAULT_FINGERPRINT;
    }
    if (s->converter == GUST_CONVERTER_TRIPPED) {
        faults |= (uint32_t)GUST_FAULT_CONVERTER;
    }
    return faults;
}

void gust_supervision_tick(gust_supervision *s, const gust_period *period)
{
    ++s->silent;
    uint32_t faults = period->periods > s->limits.deadlines + 1U ? (uint32_t)GUST_FAULT_DEADLINE : 0;
    faults |= judge_sample(s, period);
    faults |= count_losses(s, period);
    faults |= count_silence(s, period);
    gust_supervision_raise(s, faults);
    bool known = s->known || !s->limits.fingerprint;
    if (s->state == GUST_STATE_INIT && s->fresh && quiet(s) && known) {
        s->state = GUST_STATE_READY;
    }
}

void gust_supervision_measured(gust_supervision *s, const double *values, uint32_t n)
{
    bool jumped = false;
    for (uint32_t k = 0; k < n; ++k) {
        jumped = jumped || fabs(values[k] - s->last[k]) > s->limits.rate[k] * s->elapsed;
        s->last[k] = values[k];
    }
    gust_supervision_raise(s, s->measured && jumped ? (uint32_t)GUST_FAULT_PLAUSIBILITY : 0);
    s->measured = true;
}

void gust_supervision_stepped(gust_supervision *s, uint32_t errors)
{
    s->wrong_steps = (errors & s->limits.error_mask) != 0 ? s->wrong_steps + 1U : 0;
    if (s->wrong_steps > s->limits.errors) {
        gust_supervision_raise(s, GUST_FAULT_CONTROLLER);
    }
}

int32_t gust_sample_difference(uint32_t a, uint32_t b, uint64_t modulus)
{
    const uint64_t ahead = ((uint64_t)a + modulus - (uint64_t)b % modulus) % modulus;
    const uint64_t behind = modulus - ahead;
    return ahead < behind ? (int32_t)ahead : (int32_t)(-(int64_t)behind);
}
