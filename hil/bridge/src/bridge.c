#include "gustform_bridge/bridge.h"

#include <math.h>
#include <string.h>

#define S_PER_NS  1e-9
#define NS_PER_US UINT64_C(1000)
#define NS_PER_S  1e9

/* Heartbeats in a row that may be missed, where the database tells their cycle. */
#define HEARTBEATS UINT64_C(3)

/* An error signal of the bridge, beside those of the controller: a command was cut to the database's range. */
#define ERROR_CUT UINT32_C(0x80000000)

static const gust_part INPUT_PARTS[] = {GUST_PART_MEASUREMENTS, GUST_PART_SET_POINTS};
static const gust_part OUTPUT_PARTS[] = {GUST_PART_REFERENCES};

/* Those that take turns. */
static const gust_part TURNS[GUST_TURNS] = {GUST_PART_CONTROLLER_STATE, GUST_PART_PARAMETER_RESPONSE,
                                            GUST_PART_CONTROLLER_HEARTBEAT, GUST_PART_CONTROLLER_FINGERPRINT};
enum { TURN_OF_STATE = 0, TURN_OF_ANSWER = 1 };

const gust_rate gust_default_rates[] = {{"v_dc", 500.0}, {"omega_r", 5.0}};
const uint32_t gust_n_default_rates = sizeof gust_default_rates / sizeof gust_default_rates[0];

static uint32_t bit(gust_part part)
{
    return UINT32_C(1) << (uint32_t)part;
}

static uint64_t period_ns(const gust_controller *controller)
{
    return (uint64_t)llround(controller->period * NS_PER_S);
}

/* ---- Start ---- */

static bool check_controller(const gust_controller *controller, gust_error *error)
{
    if (controller->version != GUST_CONTROLLER_VERSION) {
        return gust_fail(error,
                         "GF8052: the controller %s has interface version %u, this bridge %d. Export it again",
                         controller->name, controller->version, GUST_CONTROLLER_VERSION);
    }
    if (controller->context_size > GUST_CONTEXT) {
        return gust_fail(
            error,
            "GF8051: the context has %u bytes, at most %d are allowed. Raise GUST_CONTEXT and compile again",
            controller->context_size, GUST_CONTEXT);
    }
    if (period_ns(controller) == 0) {
        return gust_fail(error, "GF8052: the controller %s has no period. Export it again", controller->name);
    }
    return true;
}

static bool bind_signals(gust_bridge *bridge, gust_error *error)
{
    const gust_controller *controller = bridge->config.controller;
    const gust_message_set *set = bridge->config.messages;
    if (!gust_sample_init(&bridge->measurements, set, GUST_PART_MEASUREMENTS) ||
        !gust_sample_init(&bridge->references, set, GUST_PART_REFERENCES)) {
        return gust_fail(
            error,
            "GF8051: the measurements or references have more than %d messages. Raise GUST_PIECES and compile again",
            GUST_PIECES);
    }
    if (bridge->measurements.n == 0 || bridge->references.n == 0) {
        return gust_fail(
            error,
            "GF8053: the database %s has no measurements or no references. Map messages to these parts in mapping.yaml",
            set->name);
    }
    return gust_bind(set, controller->inputs, controller->n_inputs, INPUT_PARTS, 2, "input", bridge->inputs,
                     error) &&
           gust_bind(set, controller->outputs, controller->n_outputs, OUTPUT_PARTS, 1, "output",
                     bridge->outputs, error);
}

/* What of the limits the database and the controller decide. */
static void adapt_limits(gust_bridge *bridge)
{
    gust_limits *limits = &bridge->config.limits;
    const gust_controller *controller = bridge->config.controller;
    const gust_message *heartbeat =
        gust_message_find(bridge->config.messages, GUST_PART_CONVERTER_HEARTBEAT, 0);
    if (heartbeat == NULL) {
        limits->heartbeat = 0;
    } else if (heartbeat->cycle != 0 && limits->heartbeat == 0) {
        limits->heartbeat = (uint32_t)(HEARTBEATS * NS_PER_US * heartbeat->cycle / bridge->link.period) + 1U;
    }
    if (gust_message_find(bridge->config.messages, GUST_PART_CONVERTER_FINGERPRINT, 0) == NULL) {
        limits->fingerprint = false;
    }
    if (bridge->config.synchronous) {
        limits->drift = 0;
    }
    for (uint32_t k = 0; k < controller->n_inputs; ++k) {
        for (uint32_t r = 0; r < bridge->config.n_rates; ++r) {
            if (bridge->inputs[k].part == GUST_PART_MEASUREMENTS &&
                strcmp(bridge->config.rates[r].quantity, controller->inputs[k].name) == 0) {
                limits->rate[k] = bridge->config.rates[r].rate * controller->period;
            }
        }
    }
}

bool gust_bridge_init(gust_bridge *bridge, const gust_bridge_config *config, gust_error *error)
{
    memset(bridge, 0, sizeof *bridge);
    bridge->config = *config;
    if (!check_controller(config->controller, error)) {
        return false;
    }
    if (!gust_link_init(&bridge->link, config->messages, config->transport, period_ns(config->controller))) {
        return gust_fail(
            error,
            "GF8051: the database %s has more than %d messages, or one has more than %d signals. Take fewer",
            config->messages->name, GUST_LINK_MESSAGES, GUST_MESSAGE_SIGNALS);
    }
    bridge->link.own = bit(GUST_PART_REFERENCES) | bit(GUST_PART_CONTROLLER_STATE) |
                       bit(GUST_PART_PARAMETER_RESPONSE) | bit(GUST_PART_CONTROLLER_HEARTBEAT) |
                       bit(GUST_PART_CONTROLLER_FINGERPRINT);
    bridge->link.watched = GUST_PART_REFERENCES;
    if (!bind_signals(bridge, error)) {
        return false;
    }
    for (uint32_t k = 0; k < GUST_TURNS; ++k) {
        bridge->taking_turns[k] = gust_message_find(config->messages, TURNS[k], 0);
    }
    const gust_message *sync = gust_message_find(config->messages, GUST_PART_SYNC, 0);
    bridge->sync_modulus = sync == NULL ? 0 : gust_link_modulus(sync, GUST_FIELD_SAMPLE);
    if (config->synchronous && bridge->sync_modulus == 0) {
        return gust_fail(
            error,
            "GF8053: the database %s has no Sync with a sample number. Map one, or take --clock monotonic",
            config->messages->name);
    }
    adapt_limits(bridge);
    gust_supervision_start(&bridge->supervision, &bridge->config.limits);
    bridge->errors = config->controller->startup(bridge->context);
    if (!gust_parameters_init(&bridge->parameters, config->controller, bridge->context, config->tune)) {
        return gust_fail(
            error, "GF8051: %u parameters, at most %d are allowed. Raise GUST_PARAMETERS and compile again",
            config->controller->n_parameters, GUST_PARAMETERS);
    }
    return true;
}

/* ---- What comes in ---- */

/* true: a new number. */
static bool receive_sync(gust_bridge *bridge, const gust_received *received)
{
    gust_supervision *s = &bridge->supervision;
    const uint32_t number =
        (uint32_t)gust_link_get(received->message, received->values, GUST_FIELD_SAMPLE, 0.0);
    int32_t ahead = 1;
    if (bridge->sync_heard && bridge->sync_modulus != 0) {
        ahead = gust_sample_difference(number, bridge->sync_number, bridge->sync_modulus);
    }
    if (ahead == 0) {
        return false;
    }
    const bool jumped = ahead < 0 || ahead > (int32_t)s->limits.missing + 1;
    if (jumped) {
        gust_supervision_raise(s, GUST_FAULT_COUNTER);
    }
    bridge->sync_number = number;
    bridge->sync_periods = jumped ? 1U : (uint32_t)ahead;
    bridge->sync_heard = true;
    bridge->sync_here = true;
    return true;
}

static void receive_set_points(gust_bridge *bridge, const gust_received *received)
{
    for (uint32_t k = 0; k < bridge->config.controller->n_inputs; ++k) {
        const gust_place *place = &bridge->inputs[k];
        if (place->part == GUST_PART_SET_POINTS && place->piece == received->message->piece) {
            bridge->input[k] = received->values[place->signal];
            bridge->known[k] = true;
        }
    }
    gust_supervision_set_points(&bridge->supervision);
}

static void receive_command(gust_bridge *bridge, const gust_received *received)
{
    const gust_command command =
        (gust_command)gust_link_get(received->message, received->values, GUST_FIELD_COMMAND, 0.0);
    const uint32_t nonce = (uint32_t)gust_link_get(received->message, received->values, GUST_FIELD_NONCE, 0.0);
    if (gust_supervision_command(&bridge->supervision, command, nonce) == GUST_ANSWER_DONE &&
        command == GUST_COMMAND_START) {
        bridge->errors = bridge->config.controller->reinitialise(bridge->context);
        bridge->commanding = false;
    }
}

/* A good frame. true: a new Sync. */
static bool receive_good(gust_bridge *bridge, const gust_received *received)
{
    gust_supervision *s = &bridge->supervision;
    const gust_message *message = received->message;
    const double *values = received->values;
    switch (message->part) {
    case GUST_PART_SYNC:
        return receive_sync(bridge, received);
    case GUST_PART_MEASUREMENTS:
        gust_sample_add(&bridge->measurements, message, values, received->lost);
        break;
    case GUST_PART_SET_POINTS:
        receive_set_points(bridge, received);
        break;
    case GUST_PART_CONVERTER_STATE:
        gust_supervision_converter(s, (uint32_t)gust_link_get(message, values, GUST_FIELD_STATE, 0.0));
        break;
    case GUST_PART_CONVERTER_HEARTBEAT:
        gust_supervision_heartbeat(s);
        break;
    case GUST_PART_CONVERTER_FINGERPRINT:
        gust_supervision_fingerprint(s, gust_link_get(message, values, GUST_FIELD_FINGERPRINT, -1.0) ==
                                            (double)bridge->config.messages->fingerprint);
        break;
    case GUST_PART_OPERATOR_COMMAND:
        receive_command(bridge, received);
        break;
    case GUST_PART_EMERGENCY_STOP:
        if (gust_link_get(message, values, GUST_FIELD_COMMAND, 1.0) != 0.0) {
            gust_supervision_raise(s, GUST_FAULT_EMERGENCY_STOP);
        }
        break;
    case GUST_PART_PARAMETER_REQUEST:
        gust_parameters_ask(&bridge->parameters, message, values);
        break;
    default:
        break; /* own parts do not come here */
    }
    return false;
}

/* A frame that was refused. Whoever presses the emergency stop is right, however damaged the frame. */
static void receive_bad(gust_bridge *bridge, const gust_received *received)
{
    const gust_part part = received->message->part;
    gust_supervision_reject(&bridge->supervision, received->result,
                            part == GUST_PART_SYNC || part == GUST_PART_MEASUREMENTS);
    if (part == GUST_PART_EMERGENCY_STOP) {
        gust_supervision_raise(&bridge->supervision, GUST_FAULT_EMERGENCY_STOP);
    }
}

static void receive_repeat(gust_bridge *bridge, const gust_received *received)
{
    const gust_part part = received->message->part;
    if (part == GUST_PART_SYNC || part == GUST_PART_MEASUREMENTS) {
        gust_supervision_repeat(&bridge->supervision);
    } else if (part == GUST_PART_EMERGENCY_STOP) {
        (void)receive_good(bridge, received);
    }
}

bool gust_bridge_receive(gust_bridge *bridge, const gust_frame *frame)
{
    gust_received received;
    switch (gust_link_receive(&bridge->link, frame, &received)) {
    case GUST_HEARD_GOOD:
        return receive_good(bridge, &received);
    case GUST_HEARD_REPEAT:
        receive_repeat(bridge, &received);
        break;
    case GUST_HEARD_BAD:
        receive_bad(bridge, &received);
        break;
    case GUST_HEARD_MASQUERADE:
        gust_supervision_raise(&bridge->supervision, GUST_FAULT_MASQUERADE);
        break;
    case GUST_HEARD_BUS_OFF:
        gust_bridge_transport(bridge, GUST_TRANSPORT_DOWN);
        break;
    case GUST_HEARD_NOT_SENT:
        gust_supervision_raise(&bridge->supervision, GUST_FAULT_SEND);
        break;
    case GUST_HEARD_NOTHING:
        break;
    }
    return false;
}

void gust_bridge_transport(gust_bridge *bridge, gust_transport_status status)
{
    if (status == GUST_TRANSPORT_FULL) {
        gust_supervision_raise(&bridge->supervision, GUST_FAULT_SEND);
    } else if (status == GUST_TRANSPORT_DOWN || status == GUST_TRANSPORT_FAILED) {
        gust_supervision_raise(&bridge->supervision, GUST_FAULT_BUS_OFF);
        bridge->config.transport->flush(bridge->config.transport);
        bridge->link.under_way = 0; /* a controller that leaves the bus drops what it had */
    }
}

void gust_bridge_latch(gust_bridge *bridge, uint32_t faults)
{
    atomic_fetch_or(&bridge->latched, faults);
}

/* ---- What goes out ---- */

static void fill(gust_bridge *bridge, const gust_message *message, bool enabled, uint32_t number,
                 double *values)
{
    gust_bind_safe(message, values);
    if (enabled) {
        gust_bind_fill(message, bridge->outputs, bridge->config.controller->n_outputs, bridge->command, values);
    }
    const uint64_t modulus = gust_link_modulus(message, GUST_FIELD_SAMPLE);
    gust_link_put(message, values, GUST_FIELD_SAMPLE, modulus == 0 ? 0.0 : (double)(number % modulus));
    gust_link_put(message, values, GUST_FIELD_ENABLE, enabled ? 1.0 : 0.0);
}

/* Asked before each frame, for the watchdog may have spoken or time may have passed since the last one. */
static bool may_command(gust_bridge *bridge)
{
    const uint32_t latched = atomic_exchange(&bridge->latched, 0);
    gust_supervision_raise(&bridge->supervision, latched);
    if (bridge->supervision.state != GUST_STATE_RUN || !bridge->commanding) {
        return false;
    }
    gust_transport *transport = bridge->config.transport;
    if (bridge->config.age != 0 && transport->now(transport) - bridge->begun > bridge->config.age) {
        gust_supervision_raise(&bridge->supervision, GUST_FAULT_DEADLINE);
        return false;
    }
    return true;
}

static void send_references(gust_bridge *bridge)
{
    const uint32_t number = atomic_load(&bridge->sample);
    bridge->cut = false;
    for (uint32_t k = 0; k < bridge->references.n; ++k) {
        const gust_message *message = bridge->references.piece[k].message;
        double values[GUST_MESSAGE_SIGNALS];
        uint32_t cut = 0;
        fill(bridge, message, may_command(bridge), number, values);
        gust_bridge_transport(bridge, gust_link_send(&bridge->link, message, values, &cut));
        bridge->cut = bridge->cut || cut != 0;
    }
}

/* One sample of references at most is under way. In SAFE one that got lost is given up after the tolerated
 * time, so that the converter hears of SAFE when the bus comes back. */
static void send_or_wait(gust_bridge *bridge)
{
    if (bridge->link.under_way > 0) {
        gust_transport *transport = bridge->config.transport;
        /* After a late tick the next one comes sooner than a period; then there is nothing wrong yet. */
        if (!bridge->config.synchronous && bridge->begun - bridge->handed < bridge->link.period * 3U / 4U) {
            return;
        }
        gust_supervision_raise(&bridge->supervision, GUST_FAULT_SEND);
        transport->flush(transport);
        ++bridge->stuck;
        if (transport->pending(transport) > 0 && bridge->stuck <= bridge->config.limits.missing) {
            return;
        }
        bridge->link.under_way = 0;
    }
    bridge->stuck = 0;
    bridge->handed = bridge->begun;
    send_references(bridge);
}

static void send_status(gust_bridge *bridge, const gust_message *message)
{
    double values[GUST_MESSAGE_SIGNALS];
    uint32_t cut = 0;
    fill(bridge, message, false, atomic_load(&bridge->sample), values);
    gust_link_put(message, values, GUST_FIELD_STATE, (double)bridge->supervision.state);
    gust_link_put(message, values, GUST_FIELD_FAULTS, (double)bridge->supervision.faults);
    gust_link_put(message, values, GUST_FIELD_ERRORS, (double)bridge->errors);
    gust_link_put(message, values, GUST_FIELD_FINGERPRINT, (double)bridge->config.messages->fingerprint);
    gust_link_put(message, values, GUST_FIELD_UPTIME,
                  floor((double)(bridge->ticks * bridge->link.period) * S_PER_NS));
    gust_bridge_transport(bridge, gust_link_send(&bridge->link, message, values, &cut));
}

/* `message` NULL: the request is carried out all the same. */
static void answer_parameters(gust_bridge *bridge, const gust_message *message)
{
    const gust_result result =
        gust_parameters_answer(&bridge->parameters, bridge->context, bridge->supervision.state);
    if (message == NULL) {
        return;
    }
    double values[GUST_MESSAGE_SIGNALS];
    uint32_t cut = 0;
    gust_bind_safe(message, values);
    gust_link_put(message, values, GUST_FIELD_OPERATION, (double)bridge->parameters.request.operation);
    gust_link_put(message, values, GUST_FIELD_PARAMETER, (double)bridge->parameters.request.id);
    gust_link_put(message, values, GUST_FIELD_VALUE, bridge->parameters.request.value);
    gust_link_put(message, values, GUST_FIELD_RESULT, (double)result);
    gust_bridge_transport(bridge, gust_link_send(&bridge->link, message, values, &cut));
}

static void want(gust_bridge *bridge, uint32_t periods)
{
    const gust_supervision *s = &bridge->supervision;
    for (uint32_t k = 0; k < GUST_TURNS; ++k) {
        const gust_message *message = bridge->taking_turns[k];
        if (message != NULL && gust_link_due(&bridge->link, message, periods)) {
            bridge->wanted[k] = true;
        }
    }
    if (bridge->parameters.request.asked) {
        bridge->wanted[TURN_OF_ANSWER] = true;
    }
    if (s->state != bridge->told_state || s->faults != bridge->told_faults) {
        bridge->wanted[TURN_OF_STATE] = true;
        bridge->turn = TURN_OF_STATE;
    }
    bridge->told_state = s->state;
    bridge->told_faults = s->faults;
}

/* Whether everything has left that was handed over before this period. */
static bool quiet(gust_bridge *bridge)
{
    gust_transport *transport = bridge->config.transport;
    if (transport->pending(transport) > 0 && ++bridge->unquiet <= bridge->config.limits.missing) {
        return false;
    }
    bridge->unquiet = 0;
    return true;
}

static void send_next(gust_bridge *bridge)
{
    for (uint32_t n = 0; n < GUST_TURNS; ++n) {
        const uint32_t k = (bridge->turn + n) % GUST_TURNS;
        if (!bridge->wanted[k]) {
            continue;
        }
        const gust_message *message = bridge->taking_turns[k];
        bridge->wanted[k] = false;
        bridge->turn = k + 1U;
        if (k == TURN_OF_ANSWER) {
            answer_parameters(bridge, message);
        } else if (message != NULL) {
            send_status(bridge, message);
        }
        return;
    }
}

/* ---- A period ---- */

static void supervise(gust_bridge *bridge, uint32_t periods)
{
    gust_sample *measurements = &bridge->measurements;
    gust_period period = {.periods = periods > 0 ? periods : 1U};
    period.sync = bridge->sync_here || bridge->sync_modulus == 0;
    period.sample = gust_sample_take(measurements, &period.lost);
    if (bridge->sync_heard && measurements->modulus != 0 && bridge->sync_modulus != 0) {
        const uint64_t modulus =
            measurements->modulus < bridge->sync_modulus ? measurements->modulus : bridge->sync_modulus;
        period.lag = gust_sample_difference((uint32_t)(bridge->sync_number % modulus),
                                            (uint32_t)(measurements->number % modulus), modulus);
    }
    bridge->sync_here = false;
    gust_supervision_raise(&bridge->supervision, atomic_exchange(&bridge->latched, 0));
    gust_supervision_tick(&bridge->supervision, &period);
}

static void take_sample(gust_bridge *bridge)
{
    const uint32_t n = bridge->config.controller->n_inputs;
    for (uint32_t k = 0; k < n; ++k) {
        const gust_place *place = &bridge->inputs[k];
        if (place->part == GUST_PART_MEASUREMENTS) {
            bridge->input[k] = bridge->measurements.values[place->piece][place->signal];
            bridge->known[k] = true;
        }
    }
    atomic_store(&bridge->sample, bridge->measurements.number);
    gust_supervision_measured(&bridge->supervision, bridge->input, n);
}

static void step(gust_bridge *bridge)
{
    const gust_controller *controller = bridge->config.controller;
    for (uint32_t k = 0; k < controller->n_inputs; ++k) {
        if (bridge->known[k]) {
            gust_controller_set(controller, bridge->context, &controller->inputs[k], bridge->input[k]);
        }
    }
    bridge->errors = controller->step(bridge->context);
    for (uint32_t k = 0; k < controller->n_outputs; ++k) {
        bridge->command[k] = gust_controller_get(controller, bridge->context, &controller->outputs[k]);
    }
    ++bridge->steps;
    bridge->commanding = true;
    gust_supervision_stepped(&bridge->supervision, bridge->errors | (bridge->cut ? ERROR_CUT : 0U));
}

void gust_bridge_tick(gust_bridge *bridge, uint32_t periods)
{
    gust_supervision *s = &bridge->supervision;
    gust_transport *transport = bridge->config.transport;
    bridge->begun = transport->now(transport);
    bridge->ticks += periods;
    supervise(bridge, periods);
    if (s->fresh) {
        take_sample(bridge);
    }
    if (s->state == GUST_STATE_RUN && s->fresh) {
        step(bridge);
    } else if (s->state == GUST_STATE_RUN) {
        ++bridge->held;
    }
    const bool others_may = quiet(bridge);
    send_or_wait(bridge);
    want(bridge, periods);
    if (others_may) {
        send_next(bridge);
    }
}

void gust_bridge_stop(gust_bridge *bridge)
{
    bridge->supervision.state = GUST_STATE_SAFE;
    send_references(bridge);
    if (bridge->taking_turns[TURN_OF_STATE] != NULL) {
        send_status(bridge, bridge->taking_turns[TURN_OF_STATE]);
    }
}

uint32_t gust_bridge_safe_frames(gust_bridge *bridge, gust_frame frames[GUST_PIECES])
{
    const uint32_t number = atomic_load(&bridge->sample);
    for (uint32_t k = 0; k < bridge->references.n; ++k) {
        const gust_message *message = bridge->references.piece[k].message;
        double values[GUST_MESSAGE_SIGNALS];
        fill(bridge, message, false, number, values);
        (void)gust_link_protect(&bridge->link, message, values, &frames[k]);
        atomic_fetch_add(&bridge->link.message[gust_link_number(&bridge->link, message)].other_thread, 1U);
    }
    return bridge->references.n;
}

void gust_bridge_not_sent(gust_bridge *bridge, uint32_t k)
{
    const gust_message *message = bridge->references.piece[k].message;
    atomic_fetch_sub(&bridge->link.message[gust_link_number(&bridge->link, message)].other_thread, 1U);
}
