/* Both roles in one process: a controller behind the bridge and a plant behind the converter's node, on one
 * bus. */
#include "stand.h"

#include <string.h>

#include "gustform_bridge/plant.h"

enum { BRIDGE, PLANT, OPERATOR };

/* A rotor and a DC link in Euler steps, in float as what crosses the bus: rotor speed by the pitch, voltage by
 * the frequency. */
typedef struct physics {
    float v_dc, omega_r;
} physics;

static const char *const MEASURED[] = {"v_dc", "omega_r", "omega_del"};
static const char *const COMMANDED[] = {"omega_gsc", "beta_ref"};
static const double START[] = {1.0, 0.0};

static gust_bus bus;
static gust_bridge bridge;
static gust_plant plant;
static gust_link operator;
static uint32_t nonce;

static void measure(const physics *at, double *measured)
{
    measured[0] = (double)at->v_dc;
    measured[1] = (double)at->omega_r;
    measured[2] = 0.875;
}

static void advance(physics *at, const double *command)
{
    const float omega_gsc = (float)command[0];
    const float beta_ref = (float)command[1];
    at->v_dc += 1e-3F * (0.5F - 40.0F * (omega_gsc - 1.0F));
    at->omega_r += 1e-3F * (0.05F - 0.01F * beta_ref);
}

static void begin(const gust_message_set *set)
{
    gust_bus_init(&bus, FRAME_NS);
    gust_bridge_config config = {.controller = &test_controller,
                                 .messages = set,
                                 .transport = &bus.node[BRIDGE].transport,
                                 .synchronous = true};
    gust_limits_default(&config.limits);
    config.limits.heartbeat = 0;
    gust_error error;
    assert_true(gust_bridge_init(&bridge, &config, &error));
    const gust_plant_config other = {.messages = set,
                                     .transport = &bus.node[PLANT].transport,
                                     .period = PERIOD_NS,
                                     .measurements = MEASURED,
                                     .n_measurements = 3,
                                     .commands = COMMANDED,
                                     .n_commands = 2,
                                     .start = START,
                                     .missing = 2};
    assert_true(gust_plant_init(&plant, &other, &error));
    assert_true(gust_link_init(&operator, set, &bus.node[OPERATOR].transport, PERIOD_NS));
    nonce = 1;
}

static void press(gust_command command)
{
    uint32_t cut = 0;
    ++nonce;
    const gust_message *message = gust_message_find(operator.set, GUST_PART_OPERATOR_COMMAND, 0);
    assert_int_equal(
        gust_link_send(&operator, message, (double[32]){[2] = (double)command, [3] = (double)nonce}, &cut),
        GUST_TRANSPORT_OK);
}

/* One period: the plant sends, the bridge answers at the Sync, the plant takes it. `deaf`: it does not hear it.
 */
static void period(physics *at, bool deaf)
{
    double measured[3];
    gust_frame frame;
    measure(at, measured);
    gust_plant_send(&plant, measured);
    gust_bus_run(&bus, bus.now + PERIOD_NS / 2);
    gust_transport *transport = &bus.node[BRIDGE].transport;
    while (transport->receive(transport, &frame) == GUST_TRANSPORT_OK) {
        if (gust_bridge_receive(&bridge, &frame)) {
            gust_bridge_tick(&bridge, bridge.sync_periods);
        }
    }
    bus.node[PLANT].deaf = deaf ? 100 : 0;
    gust_bus_run(&bus, bus.now + PERIOD_NS / 2);
    transport = &bus.node[PLANT].transport;
    while (transport->receive(transport, &frame) == GUST_TRANSPORT_OK) {
        (void)gust_plant_receive(&plant, &frame);
    }
    gust_plant_finish(&plant);
    advance(at, plant.command);
}

static void to_running(physics *at)
{
    for (int k = 0; k < 300 && bridge.supervision.state != GUST_STATE_READY; ++k) {
        period(at, false);
    }
    press(GUST_COMMAND_START);
    period(at, false); /* the Sync goes first, so it is heard in the next one */
    period(at, false);
    assert_int_equal(bridge.supervision.state, GUST_STATE_RUN);
    assert_int_equal(plant.state, GUST_CONVERTER_RUNNING);
}

/* The closed loop over the bus has the bits of the same controller called by hand, with float in between. */
static void lock_step(void **unused)
{
    (void)unused;
    static const gust_message_set *const SETS[] = {&test_database, &test_pieces};
    for (size_t which = 0; which < 2; ++which) {
        begin(SETS[which]);
        physics over_bus = {.v_dc = 1.0F, .omega_r = 1.0F};
        for (int k = 0; k < 100; ++k) {
            period(&over_bus, false);
            over_bus =
                (physics){.v_dc = 1.0F, .omega_r = 1.0F}; /* held at its start until the controller runs */
        }
        assert_int_equal(bridge.supervision.state, GUST_STATE_READY);
        press(GUST_COMMAND_START);
        _Alignas(16) unsigned char context[GUST_CONTEXT];
        assert_true(test_controller.context_size <= sizeof context);
        (void)test_controller.startup(context);
        physics by_hand = over_bus;
        for (int k = 0; k < 20000; ++k) {
            double measured[3], command[2];
            measure(&by_hand, measured);
            for (uint32_t n = 0; n < 3U; ++n) {
                gust_controller_set(&test_controller, context, &test_controller.inputs[n], measured[n]);
            }
            (void)test_controller.step(context);
            for (uint32_t n = 0; n < 2U; ++n) {
                command[n] = gust_controller_get(&test_controller, context, &test_controller.outputs[n]);
            }
            advance(&by_hand, command);
            period(&over_bus, false);
            assert_memory_equal(&over_bus, &by_hand, sizeof by_hand);
        }
        assert_true(by_hand.v_dc != 1.0F && by_hand.omega_r != 1.0F); /* something has moved */
        assert_int_equal(bridge.supervision.state, GUST_STATE_RUN);
        assert_int_equal(plant.link.counts.lost + bridge.link.counts.lost, 0);
        assert_int_equal(plant.trips, 0);
    }
}

static void plant_trips(void **unused)
{
    (void)unused;
    begin(&test_database);
    physics at = {.v_dc = 1.0F, .omega_r = 1.0F};
    to_running(&at);
    for (int k = 0; k < 10; ++k) { /* two lost answers are tolerated, the last command holds */
        period(&at, false);
        const double held = plant.command[0];
        period(&at, true);
        period(&at, true);
        assert_true(plant.command[0] == held);
        assert_int_equal(plant.state, GUST_CONVERTER_RUNNING);
        period(&at, false);
    }
    period(&at, true);
    period(&at, true);
    period(&at, true);
    assert_int_equal(plant.state, GUST_CONVERTER_TRIPPED);
    assert_true(plant.command[0] == START[0] && plant.command[1] == START[1]);
    period(&at, false);
    assert_int_equal(bridge.supervision.state, GUST_STATE_SAFE);
    assert_int_equal(bridge.supervision.faults, GUST_FAULT_CONVERTER);
    assert_int_equal(plant.controller, GUST_STATE_SAFE);
    for (int k = 0; k < 98; ++k) {
        period(&at, false);
        assert_int_equal(plant.state, GUST_CONVERTER_TRIPPED);
    }
    for (int k = 0; k < 50; ++k) {
        period(&at, false);
    }
    assert_int_equal(plant.state, GUST_CONVERTER_READY);
    press(GUST_COMMAND_RESET);
    period(&at, false);
    to_running(&at);
    press(GUST_COMMAND_STOP);
    period(&at, false);
    period(&at, false);
    assert_int_equal(plant.state, GUST_CONVERTER_READY);
    assert_int_equal(bridge.supervision.state, GUST_STATE_READY);
    to_running(&at);
    uint32_t cut = 0;
    const gust_message *stop = gust_message_find(operator.set, GUST_PART_EMERGENCY_STOP, 0);
    (void)gust_link_send(&operator, stop, (double[32]){[2] = 1.0}, &cut);
    period(&at, false);
    assert_int_equal(plant.state, GUST_CONVERTER_TRIPPED);
    assert_int_equal(bridge.supervision.state, GUST_STATE_SAFE);
    assert_int_equal(plant.trips, 2);
}

/* Commands that answer to a sample of long ago are not taken. */
static void stale_commands(void **unused)
{
    (void)unused;
    for (uint32_t behind = 0; behind < 4U; ++behind) {
        begin(&test_database);
        physics at = {.v_dc = 1.0F, .omega_r = 1.0F};
        for (int k = 0; k < 10; ++k) {
            period(&at, false);
        }
        double measured[3];
        measure(&at, measured);
        gust_plant_send(&plant, measured);
        gust_frame frame;
        const gust_message *message = gust_message_find(&test_database, GUST_PART_REFERENCES, 0);
        (void)gust_link_protect(
            &bridge.link, message,
            (double[32]){[2] = (double)(plant.number - behind), [3] = 1.0, [4] = 1.25, [6] = 5.0}, &frame);
        assert_int_equal(gust_plant_receive(&plant, &frame), behind == 0);
        assert_true(plant.command[0] == (behind < 2U ? 1.25 : 1.0));
        /* but one that blocks the converter is, however old */
        plant.state = GUST_CONVERTER_RUNNING;
        (void)gust_link_protect(&bridge.link, message,
                                (double[32]){[2] = (double)(plant.number - behind), [4] = 1.0}, &frame);
        (void)gust_plant_receive(&plant, &frame);
        gust_plant_finish(&plant);
        assert_int_equal(plant.state, GUST_CONVERTER_READY);
    }
}

static void refused(void **unused)
{
    (void)unused;
    static const char *const UNKNOWN[] = {"v_dc", "P_gsc"};
    gust_error error;
    const gust_plant_config config = {.messages = &test_database,
                                      .transport = &bus.node[PLANT].transport,
                                      .period = PERIOD_NS,
                                      .measurements = UNKNOWN,
                                      .n_measurements = 2,
                                      .start = START};
    assert_false(gust_plant_init(&plant, &config, &error));
    assert_non_null(strstr(error.text, "measurement 'P_gsc'"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(lock_step), cmocka_unit_test(plant_trips),
                                       cmocka_unit_test(stale_commands), cmocka_unit_test(refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
