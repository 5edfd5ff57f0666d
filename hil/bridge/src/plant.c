#include "gustform_bridge/plant.h"

#include <math.h>
#include <string.h>

#define S_PER_NS 1e-9

/* Periods without commands after which a converter that tripped is ready again. */
#define REST 100U

static const gust_part MEASURED_PARTS[] = {GUST_PART_MEASUREMENTS, GUST_PART_SET_POINTS};
static const gust_part COMMAND_PARTS[] = {GUST_PART_REFERENCES};

static uint32_t bit(gust_part part)
{
    return UINT32_C(1) << (uint32_t)part;
}

static bool bind_names(const gust_message_set *set, const char *const *names, uint32_t n,
                       const gust_part *parts, uint32_t n_parts, const char *role, gust_place *places,
                       gust_error *error)
{
    gust_controller_signal signals[GUST_SIGNALS];
    memset(signals, 0, sizeof signals);
    for (uint32_t k = 0; k < n && k < GUST_SIGNALS; ++k) {
        signals[k].name = names[k];
    }
    return gust_bind(set, signals, n, parts, n_parts, role, places, error);
}

static void hold_start(gust_plant *plant)
{
    memcpy(plant->command, plant->config.start, plant->config.n_commands * sizeof plant->command[0]);
}

bool gust_plant_init(gust_plant *plant, const gust_plant_config *config, gust_error *error)
{
    memset(plant, 0, sizeof *plant);
    plant->config = *config;
    if (!gust_link_init(&plant->link, config->messages, config->transport, config->period) ||
        !gust_sample_init(&plant->references, config->messages, GUST_PART_REFERENCES)) {
        return gust_fail(
            error, "GF8051: the database %s has too many messages, or too many signals in one. Take fewer",
            config->messages->name);
    }
    plant->link.own = bit(GUST_PART_SYNC) | bit(GUST_PART_MEASUREMENTS) | bit(GUST_PART_CONVERTER_STATE) |
                      bit(GUST_PART_CONVERTER_HEARTBEAT) | bit(GUST_PART_CONVERTER_FINGERPRINT);
    plant->link.watched = GUST_PART_MEASUREMENTS;
    plant->state = GUST_CONVERTER_READY;
    plant->told = GUST_CONVERTER_OFF;
    if (!bind_names(config->messages, config->measurements, config->n_measurements, MEASURED_PARTS, 2,
                    "measurement", plant->measured, error) ||
        !bind_names(config->messages, config->commands, config->n_commands, COMMAND_PARTS, 1, "command",
                    plant->commanded, error)) {
        return false;
    }
    hold_start(plant);
    return true;
}

static void send_part(gust_plant *plant, gust_part part, const double *measurements)
{
    for (uint32_t piece = 0; piece < GUST_PIECES; ++piece) {
        const gust_message *message = gust_message_find(plant->config.messages, part, (uint8_t)piece);
        if (message == NULL) {
            return;
        }
        double values[GUST_MESSAGE_SIGNALS];
        uint32_t cut = 0;
        gust_bind_safe(message, values);
        gust_bind_fill(message, plant->measured, plant->config.n_measurements, measurements, values);
        const uint64_t modulus = gust_link_modulus(message, GUST_FIELD_SAMPLE);
        gust_link_put(message, values, GUST_FIELD_SAMPLE,
                      modulus == 0 ? 0.0 : (double)(plant->number % modulus));
        gust_link_put(message, values, GUST_FIELD_STATE, (double)plant->state);
        gust_link_put(message, values, GUST_FIELD_FINGERPRINT, (double)plant->config.messages->fingerprint);
        gust_link_put(message, values, GUST_FIELD_UPTIME,
                      floor((double)(plant->ticks * plant->config.period) * S_PER_NS));
        (void)gust_link_send(&plant->link, message, values, &cut);
    }
}

static void send_when_due(gust_plant *plant, gust_part part, const double *measurements, bool now)
{
    const gust_message *message = gust_message_find(plant->config.messages, part, 0);
    if (message != NULL && (gust_link_due(&plant->link, message, 1) || now)) {
        send_part(plant, part, measurements);
    }
}

void gust_plant_send(gust_plant *plant, const double *measurements)
{
    if (plant->ticks > 0) {
        ++plant->number;
    }
    ++plant->ticks;
    plant->answered = false;
    plant->enabled = false;
    send_when_due(plant, GUST_PART_CONVERTER_FINGERPRINT, measurements, false);
    send_when_due(plant, GUST_PART_CONVERTER_HEARTBEAT, measurements, false);
    send_when_due(plant, GUST_PART_CONVERTER_STATE, measurements, plant->state != plant->told);
    plant->told = plant->state;
    send_when_due(plant, GUST_PART_SET_POINTS, measurements, false);
    if (!plant->mute) {
        send_part(plant, GUST_PART_MEASUREMENTS, measurements);
    }
    send_part(plant, GUST_PART_SYNC, measurements);
}

static double enable_of(const gust_sample *references)
{
    double enable = 1.0;
    for (uint32_t k = 0; k < references->n; ++k) {
        const double found =
            gust_link_get(references->piece[k].message, references->values[k], GUST_FIELD_ENABLE, 1.0);
        enable = found < enable ? found : enable;
    }
    return enable;
}

/* References are complete: whether they answer to this sample. Commands for the one before are taken, too. */
static bool take_references(gust_plant *plant)
{
    const uint64_t modulus = plant->references.modulus;
    const int32_t behind = modulus == 0 ? 0
                                        : gust_sample_difference((uint32_t)(plant->number % modulus),
                                                                 plant->references.number, modulus);
    const bool enabled = enable_of(&plant->references) == 1.0;
    ++plant->heard;
    plant->blocked = !enabled;
    /* Whoever does not enable is right, however old the sample. */
    if (enabled && (behind < 0 || behind > 1)) {
        return false;
    }
    plant->answered = true;
    plant->enabled = enabled;
    if (plant->enabled && plant->state != GUST_CONVERTER_TRIPPED) {
        plant->state = GUST_CONVERTER_RUNNING;
        for (uint32_t k = 0; k < plant->config.n_commands; ++k) {
            const gust_place *place = &plant->commanded[k];
            plant->command[k] = plant->references.values[place->piece][place->signal];
        }
    }
    return behind == 0;
}

static void trip(gust_plant *plant)
{
    plant->trips += plant->state != GUST_CONVERTER_TRIPPED;
    plant->state = GUST_CONVERTER_TRIPPED;
    plant->resting = 0;
    hold_start(plant);
}

bool gust_plant_receive(gust_plant *plant, const gust_frame *frame)
{
    gust_received received;
    const gust_heard what = gust_link_receive(&plant->link, frame, &received);
    if (what == GUST_HEARD_BUS_OFF || what == GUST_HEARD_MASQUERADE ||
        (what == GUST_HEARD_BAD && received.message->part == GUST_PART_EMERGENCY_STOP)) {
        trip(plant);
    }
    if (what != GUST_HEARD_GOOD) {
        return false;
    }
    const gust_message *message = received.message;
    switch (message->part) {
    case GUST_PART_REFERENCES: {
        uint32_t lost = 0;
        gust_sample_add(&plant->references, message, received.values, received.lost);
        return gust_sample_take(&plant->references, &lost) && take_references(plant);
    }
    case GUST_PART_CONTROLLER_STATE:
        plant->controller = (uint32_t)gust_link_get(message, received.values, GUST_FIELD_STATE, 0.0);
        plant->faults = (uint32_t)gust_link_get(message, received.values, GUST_FIELD_FAULTS, 0.0);
        break;
    case GUST_PART_CONTROLLER_FINGERPRINT:
        plant->stranger = gust_link_get(message, received.values, GUST_FIELD_FINGERPRINT, -1.0) !=
                          (double)plant->config.messages->fingerprint;
        break;
    case GUST_PART_EMERGENCY_STOP:
        if (gust_link_get(message, received.values, GUST_FIELD_COMMAND, 1.0) != 0.0) {
            trip(plant);
        }
        break;
    default:
        break;
    }
    return false;
}

void gust_plant_finish(gust_plant *plant)
{
    plant->silent = plant->answered ? 0 : plant->silent + 1U;
    plant->answers += plant->answered;
    plant->resting = plant->answered && !plant->enabled ? plant->resting + 1U : 0;
    if (plant->stranger || (plant->state == GUST_CONVERTER_RUNNING && plant->silent > plant->config.missing)) {
        trip(plant);
    } else if (plant->state == GUST_CONVERTER_RUNNING && plant->answered && !plant->enabled) {
        plant->state = GUST_CONVERTER_READY;
        hold_start(plant);
    } else if (plant->state == GUST_CONVERTER_TRIPPED && plant->resting >= REST) {
        plant->state = GUST_CONVERTER_READY;
    }
}
