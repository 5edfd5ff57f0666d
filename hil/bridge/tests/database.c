#include "database.h"

#include <string.h>

#define HEADER   4U /* bytes: CRC, counter, one to spare */
#define WORD     4U
#define N_HEADER 2U
#define U32_MAX  4294967295.0
#define FLOATS   3.4e38
#define ALL      (-1)

#define CRC_AND_COUNTER                                                                                        \
    {"Crc", "", "", GUST_FIELD_E2E_CRC, 0.0, 65535.0, 0.0, ALL},                                               \
    {                                                                                                          \
        "Counter", "", "", GUST_FIELD_E2E_COUNTER, 0.0, 255.0, 0.0, ALL                                        \
    }
#define QUANTITY(name, unit, low, high, safe) {name, unit, name, GUST_FIELD_QUANTITY, low, high, safe, ALL}
#define FIELD(name, field, high)              {name, "", "", GUST_FIELD_##field, 0.0, high, 0.0, ALL}
#define ONLY(name, field, low, high, code)    {name, "", "", GUST_FIELD_##field, low, high, 0.0, code}

static bool is_number(const gust_signal *signal)
{
    return signal->field != GUST_FIELD_QUANTITY && signal->field != GUST_FIELD_VALUE;
}

/* Every signal has a word of its own, float32 or unsigned, little-endian as the machines these tests run on. */
static void pack(const gust_signal *signals, uint32_t n, const double *values, uint8_t *data)
{
    for (uint32_t k = N_HEADER; k < n; ++k) {
        const uint32_t number = is_number(&signals[k]) ? (uint32_t)values[k] : 0U;
        const float real = is_number(&signals[k]) ? 0.0F : (float)values[k];
        uint8_t *at = data + HEADER + (size_t)(k - N_HEADER) * WORD;
        memcpy(at, is_number(&signals[k]) ? (const void *)&number : (const void *)&real, WORD);
    }
}

static void unpack(const gust_signal *signals, uint32_t n, const uint8_t *data, double *values)
{
    for (uint32_t k = N_HEADER; k < n; ++k) {
        uint32_t number = 0;
        float real = 0.0F;
        const uint8_t *at = data + HEADER + (size_t)(k - N_HEADER) * WORD;
        memcpy(is_number(&signals[k]) ? (void *)&number : (void *)&real, at, WORD);
        values[k] = is_number(&signals[k]) ? (double)number : (double)real;
    }
}

/* Signals, pack and unpack of one message; the multiplexed ones look at their multiplexer, the third signal. */
#define MESSAGE(name, known, ...)                                                                              \
    static const gust_signal name[] = {CRC_AND_COUNTER, __VA_ARGS__};                                          \
    static bool pack_##name(const double *values, uint8_t *data)                                               \
    {                                                                                                          \
        pack(name, sizeof name / sizeof name[0], values, data);                                                \
        return (known);                                                                                        \
    }                                                                                                          \
    static bool unpack_##name(const uint8_t *data, double *values)                                             \
    {                                                                                                          \
        unpack(name, sizeof name / sizeof name[0], data, values);                                              \
        return (known);                                                                                        \
    }

MESSAGE(emergency, true, FIELD("Command", COMMAND, 1.0))
MESSAGE(sync, true, FIELD("Sample", SAMPLE, U32_MAX))
MESSAGE(measurements, true, FIELD("Sample", SAMPLE, U32_MAX), QUANTITY("v_dc", "pu", 0.0, 2.0, 1.0),
        QUANTITY("omega_r", "pu", -0.1, 2.0, 1.0), QUANTITY("wind", "m/s", 0.0, 100.0, 0.0))
MESSAGE(measurements_0, true, FIELD("Sample", SAMPLE, 15.0), QUANTITY("v_dc", "pu", 0.0, 2.0, 1.0))
MESSAGE(measurements_1, true, FIELD("Sample", SAMPLE, 15.0), QUANTITY("omega_r", "pu", -0.1, 2.0, 1.0))
MESSAGE(references, true, FIELD("Sample", SAMPLE, U32_MAX), FIELD("Enable", ENABLE, 1.0),
        QUANTITY("omega_gsc", "pu", 0.5, 1.5, 1.0), QUANTITY("i_d_gsc", "pu", -2.0, 2.0, 0.25),
        QUANTITY("beta_ref", "deg", -10.0, 90.0, 90.0))
MESSAGE(references_0, true, FIELD("Sample", SAMPLE, 15.0), QUANTITY("omega_gsc", "pu", 0.5, 1.5, 1.0))
MESSAGE(references_1, true, FIELD("Sample", SAMPLE, 15.0), FIELD("Enable", ENABLE, 1.0),
        QUANTITY("beta_ref", "deg", -10.0, 90.0, 90.0))
MESSAGE(set_points, true, QUANTITY("omega_del", "pu", 0.0, 2.0, 1.0))
MESSAGE(controller_state, true, FIELD("State", STATE, 3.0), FIELD("Faults", FAULTS, U32_MAX),
        FIELD("Errors", ERRORS, U32_MAX), FIELD("Sample", SAMPLE, U32_MAX))
MESSAGE(converter_state, true, FIELD("State", STATE, 3.0))
MESSAGE(operator_command, true, FIELD("Command", COMMAND, 3.0), FIELD("Nonce", NONCE, 65535.0))
MESSAGE(request, values[N_HEADER] <= 2.0, FIELD("Operation", OPERATION, 2.0),
        FIELD("Parameter", PARAMETER, 65535.0), ONLY("Value", VALUE, -FLOATS, FLOATS, 1))
MESSAGE(response, values[N_HEADER] <= 2.0, FIELD("Operation", OPERATION, 2.0),
        FIELD("Parameter", PARAMETER, 65535.0), FIELD("Result", RESULT, 3.0),
        ONLY("Value", VALUE, -FLOATS, FLOATS, ALL))
MESSAGE(heartbeat, true, FIELD("Uptime", UPTIME, U32_MAX))
MESSAGE(fingerprint, true, FIELD("Fingerprint", FINGERPRINT, U32_MAX))

#define ROW(identifier, layout, is_part, number, mux, us)                                                      \
    {.name = #layout,                                                                                          \
     .id = (identifier),                                                                                       \
     .flags = GUST_FRAME_FD,                                                                                   \
     .length = 32,                                                                                             \
     .n_signals = sizeof layout / sizeof layout[0],                                                            \
     .part = GUST_PART_##is_part,                                                                              \
     .piece = (number),                                                                                        \
     .multiplexer = (mux),                                                                                     \
     .cycle = (us),                                                                                            \
     .e2e = {.profile = 5, .data_id = (identifier)},                                                           \
     .signals = layout,                                                                                        \
     .pack = pack_##layout,                                                                                    \
     .unpack = unpack_##layout}

#define COMMANDS ROW(0x010, emergency, EMERGENCY_STOP, 0, -1, 0), ROW(0x080, sync, SYNC, 0, -1, 1000)
#define OTHERS                                                                                                 \
    ROW(0x120, set_points, SET_POINTS, 0, -1, 10000),                                                          \
        ROW(0x180, controller_state, CONTROLLER_STATE, 0, -1, 10000),                                          \
        ROW(0x190, converter_state, CONVERTER_STATE, 0, -1, 10000),                                            \
        ROW(0x200, operator_command, OPERATOR_COMMAND, 0, -1, 0),                                              \
        ROW(0x300, request, PARAMETER_REQUEST, 0, 2, 0), ROW(0x310, response, PARAMETER_RESPONSE, 0, 2, 0),    \
        ROW(0x701, heartbeat, CONTROLLER_HEARTBEAT, 0, -1, 100000),                                            \
        ROW(0x702, heartbeat, CONVERTER_HEARTBEAT, 0, -1, 100000),                                             \
        ROW(0x7F0, fingerprint, CONTROLLER_FINGERPRINT, 0, -1, 1000000),                                       \
        ROW(0x7F1, fingerprint, CONVERTER_FINGERPRINT, 0, -1, 1000000)

static const gust_message DATABASE[] = {COMMANDS, ROW(0x100, measurements, MEASUREMENTS, 0, -1, 1000),
                                        ROW(0x110, references, REFERENCES, 0, -1, 1000), OTHERS};
static const gust_message PIECES[] = {COMMANDS,
                                      ROW(0x100, measurements_0, MEASUREMENTS, 0, -1, 1000),
                                      ROW(0x101, measurements_1, MEASUREMENTS, 1, -1, 1000),
                                      ROW(0x110, references_0, REFERENCES, 0, -1, 1000),
                                      ROW(0x111, references_1, REFERENCES, 1, -1, 1000),
                                      OTHERS};
static const gust_message LACKING[] = {COMMANDS, ROW(0x100, measurements, MEASUREMENTS, 0, -1, 1000),
                                       ROW(0x110, references_0, REFERENCES, 0, -1, 1000), OTHERS};
static const gust_message BARE[] = {
    ROW(0x100, measurements, MEASUREMENTS, 0, -1, 1000), ROW(0x110, references, REFERENCES, 0, -1, 1000),
    ROW(0x120, set_points, SET_POINTS, 0, -1, 10000), ROW(0x200, operator_command, OPERATOR_COMMAND, 0, -1, 0)};

#define SET(table, number)                                                                                     \
    {.name = #table,                                                                                           \
     .fingerprint = (number),                                                                                  \
     .n_messages = sizeof(table) / sizeof(table)[0],                                                           \
     .messages = (table)}
const gust_message_set test_database = SET(DATABASE, 0xfedcba98U);
const gust_message_set test_pieces = SET(PIECES, 0x12345678U);
const gust_message_set test_lacking = SET(LACKING, 3U);
const gust_message_set test_bare = SET(BARE, 4U);
