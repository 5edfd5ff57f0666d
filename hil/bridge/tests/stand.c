#include "stand.h"

#include <string.h>

enum { BRIDGE, CONVERTER };

/* How long commands are under way; then what the test does with the frame. */
static bool watch(void *context, gust_bus_node *sender, gust_frame *frame)
{
    stand *s = context;
    const gust_message *message = NULL;
    double values[GUST_MESSAGE_SIGNALS];
    uint8_t counter = 0;
    if (sender == &s->bus.node[BRIDGE] &&
        gust_message_decode(s->converter.set, frame, &message, values, &counter) == GUST_DECODED &&
        message->part == GUST_PART_REFERENCES &&
        gust_link_get(message, values, GUST_FIELD_ENABLE, 0.0) == 1.0) {
        const uint64_t age = s->bus.now - frame->time;
        s->worst_age = age > s->worst_age ? age : s->worst_age;
    }
    return s->tap == NULL || s->tap(s, sender, frame);
}

void stand_begin(stand *s, const gust_message_set *set, bool synchronous)
{
    memset(s, 0, sizeof *s);
    gust_bus_init(&s->bus, FRAME_NS);
    s->bus.tap = watch;
    s->bus.context = s;
    gust_bridge_config config = {.controller = &test_controller,
                                 .messages = set,
                                 .transport = &s->bus.node[BRIDGE].transport,
                                 .rates = gust_default_rates,
                                 .n_rates = gust_n_default_rates,
                                 .synchronous = synchronous,
                                 .age = PERIOD_NS};
    gust_limits_default(&config.limits);
    config.limits.heartbeat = 0;
    gust_error error = {.text = ""};
    if (!gust_bridge_init(&s->bridge, &config, &error)) {
        fail_msg("%s", error.text);
    }
    assert_true(gust_link_init(&s->converter, set, &s->bus.node[CONVERTER].transport, PERIOD_NS));
    assert_true(gust_sample_init(&s->references, set, GUST_PART_REFERENCES));
    s->v_dc = 1.0;
    s->omega_r = 1.0;
    s->nonce = 1;
    s->converter_state = GUST_CONVERTER_READY;
}

gust_frame stand_frame(stand *s, gust_part part, uint8_t piece, const double *values)
{
    gust_frame frame;
    const gust_message *message = gust_message_find(s->converter.set, part, piece);
    assert_non_null(message);
    (void)gust_link_protect(&s->converter, message, values, &frame);
    return frame;
}

void stand_put(stand *s, const gust_frame *frame)
{
    gust_transport *transport = &s->bus.node[CONVERTER].transport;
    assert_int_equal(transport->send(transport, frame), GUST_TRANSPORT_OK);
}

void stand_send(stand *s, gust_part part, uint8_t piece, const double *values)
{
    if (gust_message_find(s->converter.set, part, piece) != NULL) {
        const gust_frame frame = stand_frame(s, part, piece, values);
        stand_put(s, &frame);
    }
}

void stand_command(stand *s, gust_command command, uint32_t nonce)
{
    stand_send(s, GUST_PART_OPERATOR_COMMAND, 0, (double[32]){[2] = (double)command, [3] = (double)nonce});
}

void stand_press(stand *s, gust_command command)
{
    ++s->nonce;
    stand_command(s, command, s->nonce);
}

void stand_request(stand *s, double operation, double parameter, double value)
{
    stand_send(s, GUST_PART_PARAMETER_REQUEST, 0, (double[32]){[2] = operation, [3] = parameter, [4] = value});
}

void stand_fingerprint(stand *s, uint32_t fingerprint)
{
    stand_send(s, GUST_PART_CONVERTER_FINGERPRINT, 0, (double[32]){[2] = (double)fingerprint});
}

void stand_emergency(stand *s)
{
    stand_send(s, GUST_PART_EMERGENCY_STOP, 0, (double[32]){[2] = 1.0});
}

void stand_status(stand *s)
{
    if (s->period % 1000U == 0) {
        stand_fingerprint(s, s->converter.set->fingerprint);
    }
    if (s->period % 100U == 0) {
        stand_send(s, GUST_PART_CONVERTER_HEARTBEAT, 0, (double[32]){[2] = s->period / 1000U});
    }
    if (s->period % 10U == 0) {
        stand_send(s, GUST_PART_CONVERTER_STATE, 0, (double[32]){[2] = s->converter_state});
    }
}

void stand_measure(stand *s)
{
    if (gust_message_find(s->converter.set, GUST_PART_MEASUREMENTS, 1) == NULL) {
        stand_send(s, GUST_PART_MEASUREMENTS, 0,
                   (double[32]){[2] = s->number, [3] = s->v_dc, [4] = s->omega_r});
        return;
    }
    stand_send(s, GUST_PART_MEASUREMENTS, 0, (double[32]){[2] = s->number % 16U, [3] = s->v_dc});
    stand_send(s, GUST_PART_MEASUREMENTS, 1, (double[32]){[2] = s->number % 16U, [3] = s->omega_r});
}

void stand_sync(stand *s)
{
    stand_send(s, GUST_PART_SYNC, 0, (double[32]){[2] = s->number});
}

static void hear_references(stand *s, const gust_received *r)
{
    gust_sample_add(&s->references, r->message, r->values, r->lost);
    uint32_t lost = 0;
    if (!gust_sample_take(&s->references, &lost)) {
        return;
    }
    ++s->heard.references;
    s->heard.sample = s->references.number;
    for (uint32_t p = 0; p < s->references.n; ++p) {
        const gust_message *message = s->references.piece[p].message;
        const double *values = s->references.values[p];
        for (uint32_t k = 2; k < message->n_signals; ++k) {
            const gust_signal *signal = &message->signals[k];
            s->out_of_range += !(values[k] >= signal->low && values[k] <= signal->high);
            if (signal->field == GUST_FIELD_ENABLE) {
                s->heard.enabled = values[k] == 1.0;
            } else if (strcmp(signal->quantity, "omega_gsc") == 0) {
                s->heard.omega_gsc = values[k];
            } else if (strcmp(signal->quantity, "i_d_gsc") == 0) {
                s->heard.i_d_gsc = values[k];
            } else if (strcmp(signal->quantity, "beta_ref") == 0) {
                s->heard.beta_ref = values[k];
            }
        }
    }
}

static void hear(stand *s, const gust_received *r)
{
    const double *values = r->values;
    switch (r->message->part) {
    case GUST_PART_REFERENCES:
        hear_references(s, r);
        break;
    case GUST_PART_CONTROLLER_STATE:
        ++s->heard.states;
        s->told_state = (uint32_t)values[2];
        s->told_faults = (uint32_t)values[3];
        break;
    case GUST_PART_PARAMETER_RESPONSE:
        ++s->heard.responses;
        s->heard.operation = values[2];
        s->heard.parameter = values[3];
        s->heard.result = values[4];
        s->heard.value = values[5];
        break;
    case GUST_PART_CONTROLLER_HEARTBEAT:
        ++s->heard.heartbeats;
        break;
    case GUST_PART_CONTROLLER_FINGERPRINT:
        s->heard.fingerprints += (uint32_t)values[2] == s->converter.set->fingerprint;
        break;
    default:
        break;
    }
}

static void listen(stand *s)
{
    gust_frame frame;
    gust_received received;
    gust_transport *transport = &s->bus.node[CONVERTER].transport;
    while (transport->receive(transport, &frame) == GUST_TRANSPORT_OK) {
        const gust_heard what = gust_link_receive(&s->converter, &frame, &received);
        if (what == GUST_HEARD_GOOD) {
            hear(s, &received);
        } else if (what == GUST_HEARD_BAD) {
            ++s->out_of_range;
        }
    }
}

void stand_drain(stand *s)
{
    gust_transport *transport = &s->bus.node[BRIDGE].transport;
    gust_frame frame;
    while (transport->receive(transport, &frame) == GUST_TRANSPORT_OK) {
        (void)gust_bridge_receive(&s->bridge, &frame);
    }
}

void stand_finish(stand *s)
{
    const uint64_t begin = (uint64_t)s->period * PERIOD_NS;
    memset(&s->heard, 0, sizeof s->heard);
    gust_bus_run(&s->bus, begin + PERIOD_NS / 2);
    listen(s); /* what the bridge had still under way */
    stand_drain(s);
    gust_bridge_tick(&s->bridge, 1);
    gust_bus_run(&s->bus, begin + PERIOD_NS);
    listen(s);
    ++s->period;
    ++s->number;
}

void stand_period(stand *s)
{
    stand_status(s);
    stand_measure(s);
    stand_sync(s);
    stand_finish(s);
}

void stand_periods(stand *s, uint32_t n)
{
    for (uint32_t k = 0; k < n; ++k) {
        stand_period(s);
    }
}

gust_state stand_state(const stand *s)
{
    return s->bridge.supervision.state;
}

void stand_ready(stand *s)
{
    if (stand_state(s) == GUST_STATE_SAFE) {
        stand_periods(s, 2 * s->bridge.config.limits.quiet);
        stand_press(s, GUST_COMMAND_RESET);
    }
    for (uint32_t k = 0; k < 2000U && stand_state(s) != GUST_STATE_READY; ++k) {
        stand_period(s);
    }
    assert_int_equal(stand_state(s), GUST_STATE_READY);
}

void stand_run(stand *s)
{
    stand_ready(s);
    stand_press(s, GUST_COMMAND_START);
    stand_periods(s, 5);
    assert_int_equal(stand_state(s), GUST_STATE_RUN);
    assert_true(s->heard.enabled);
}
