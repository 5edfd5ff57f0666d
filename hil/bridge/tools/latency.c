/* gust-latency: how soon a gust-bridge answers, and how soon it is safe, in wall time.
 *
 * This program is the converter: every period, at absolute deadlines, it sends measurements and Sync. It
 * measures the time from the Sync handed over to the complete references; then, for each kind of fault, from
 * the moment of the fault to the first references that are not enabled. One line of JSON on stdout. Exit: 0
 * measured, 1 the bridge did not come to RUN, 2 usage or no bus.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gustform_bridge/clock.h"
#include "gustform_bridge/plant.h"
#include "gustform_bridge/socketcan.h"
#include "gustform_bridge/times.h"

#define EXIT_USAGE    2
#define PERIOD        UINT64_C(1000000) /* ns, unless Sync has a cycle */
#define NS_PER_US     UINT64_C(1000)
#define ERROR_BUS_OFF UINT32_C(0x40)
#define SETTLE        40U    /* periods of quiet before a reset */
#define LONGEST       20000U /* periods to wait for a state */
#define TOLERATED     20U    /* answers that may fail before this converter trips */

enum { RUN_PERIODS = 5000, TRIALS = 100 };

typedef enum fault { EMERGENCY_STOP, BUS_OFF, LOSS, BAD_CRC, N_FAULTS } fault;

typedef struct tester {
    gust_socketcan socket;
    gust_plant plant;
    const char *names[GUST_SIGNALS];
    double measured[GUST_SIGNALS];
    uint32_t n;
    double start[GUST_SIGNALS];
    const char *commands[GUST_SIGNALS];
    uint32_t n_commands;
    uint64_t period, deadline;
    uint64_t synced; /* when the Sync was handed over */
    uint64_t safe;   /* when references came that were not enabled, since `watch`; 0: none */
    uint64_t struck; /* when the fault began; 0: not yet */
    bool watch;
    uint32_t nonce;
    uint64_t missed;
    gust_times response;
    gust_times to_safe[N_FAULTS];
} tester;

static void take_names(tester *t, gust_part part)
{
    for (uint32_t piece = 0; piece < GUST_PIECES; ++piece) {
        const gust_message *message = gust_message_find(&gust_messages, part, (uint8_t)piece);
        for (uint32_t k = 0; message != NULL && k < message->n_signals; ++k) {
            const gust_signal *signal = &message->signals[k];
            if (signal->field != GUST_FIELD_QUANTITY) {
                continue;
            }
            if (part == GUST_PART_REFERENCES && t->n_commands < GUST_SIGNALS) {
                t->start[t->n_commands] = signal->safe;
                t->commands[t->n_commands++] = signal->quantity;
            } else if (part != GUST_PART_REFERENCES && t->n < GUST_SIGNALS) {
                t->measured[t->n] = signal->safe;
                t->names[t->n++] = signal->quantity;
            }
        }
    }
}

static void send_event(tester *t, gust_part part, double command)
{
    const gust_message *message = gust_message_find(&gust_messages, part, 0);
    double values[GUST_MESSAGE_SIGNALS] = {0.0};
    uint32_t cut = 0;
    if (message == NULL) {
        return;
    }
    gust_link_put(message, values, GUST_FIELD_COMMAND, command);
    gust_link_put(message, values, GUST_FIELD_NONCE, (double)(++t->nonce % 65536U));
    (void)gust_link_send(&t->plant.link, message, values, &cut);
}

/* Everything that has come in. true: the answer is complete, at `*at`. */
static bool listen(tester *t, uint64_t *at)
{
    gust_transport *transport = &t->socket.transport;
    gust_frame frame;
    bool answered = false;
    while (transport->receive(transport, &frame) == GUST_TRANSPORT_OK) {
        const uint64_t before = t->plant.heard;
        if (gust_plant_receive(&t->plant, &frame)) {
            *at = frame.time;
            answered = true;
        }
        if (t->watch && t->safe == 0 && t->plant.heard != before && t->plant.blocked) {
            t->safe = frame.time;
        }
    }
    return answered;
}

/* One period, with a fault in it if `act` is not N_FAULTS. */
static void period(tester *t, fault act)
{
    gust_transport *transport = &t->socket.transport;
    gust_clock_sleep(t->deadline);
    const uint64_t late = gust_clock_now() - t->deadline;
    t->missed += late / t->period;
    t->deadline += (late / t->period) * t->period;
    uint64_t at = 0;
    (void)listen(t, &at);
    t->struck = act != N_FAULTS && t->struck == 0 ? gust_clock_now() : t->struck;
    t->plant.mute = act == LOSS || act == BAD_CRC;
    if (act == EMERGENCY_STOP) {
        send_event(t, GUST_PART_EMERGENCY_STOP, 1.0);
    } else if (act == BUS_OFF) {
        const gust_frame error = {.id = ERROR_BUS_OFF, .flags = GUST_FRAME_ERROR, .length = 8};
        (void)transport->send(transport, &error);
    } else if (act == BAD_CRC) {
        const gust_message *message = gust_message_find(&gust_messages, GUST_PART_MEASUREMENTS, 0);
        double values[GUST_MESSAGE_SIGNALS];
        gust_frame frame;
        gust_bind_safe(message, values);
        (void)gust_link_protect(&t->plant.link, message, values, &frame);
        frame.data[frame.length - 1] ^= 1U;
        (void)transport->send(transport, &frame);
    }
    gust_plant_send(&t->plant, t->measured);
    t->synced = gust_clock_now();
    t->deadline += t->period;
    while (!listen(t, &at) && gust_clock_now() < t->deadline) {
        (void)transport->wait(transport, t->deadline);
    }
    if (at > t->synced && act == N_FAULTS && !t->watch) {
        gust_times_add(&t->response, at - t->synced);
    }
    gust_plant_finish(&t->plant);
}

/* By reset and start, whatever the state. */
static bool run_up(tester *t)
{
    for (uint32_t k = 0; k < SETTLE; ++k) {
        period(t, N_FAULTS); /* quiet, and time to hear the state */
    }
    for (uint32_t k = 0; k < LONGEST; ++k) {
        const gust_state state = (gust_state)t->plant.controller;
        if (state == GUST_STATE_RUN) {
            return true;
        }
        if (k % SETTLE == 0 && state != GUST_STATE_INIT) {
            const gust_command command = state == GUST_STATE_SAFE ? GUST_COMMAND_RESET : GUST_COMMAND_START;
            send_event(t, GUST_PART_OPERATOR_COMMAND, (double)command);
        }
        period(t, N_FAULTS);
    }
    return false;
}

static bool trial(tester *t, fault act)
{
    const bool lasting = act == LOSS || act == BAD_CRC;
    t->safe = 0;
    t->struck = 0;
    t->watch = true;
    for (uint32_t k = 0; k < LONGEST && t->safe == 0; ++k) {
        period(t, k == 0 || lasting ? act : N_FAULTS);
    }
    t->watch = false;
    if (t->safe == 0) {
        return false;
    }
    gust_times_add(&t->to_safe[act], t->safe > t->struck ? t->safe - t->struck : 0);
    return true;
}

static void print_times(const char *name, const gust_times *times)
{
    (void)printf("\"%s\": {\"n\": %llu, \"median\": %u, \"p99\": %u, \"max\": %llu}", name,
                 (unsigned long long)times->n, gust_times_quantile(times, 0.5),
                 gust_times_quantile(times, 0.99), (unsigned long long)(times->longest / NS_PER_US));
}

static int measure(tester *t, uint32_t periods, uint32_t trials)
{
    static const char *const NAMES[] = {"emergency stop", "bus-off", "loss", "bad CRC"};
    t->deadline = gust_clock_now() + t->period;
    if (!run_up(t)) {
        (void)fputs("gust-latency: the bridge does not come to RUN. Is gust-bridge on the same interface?\n",
                    stderr);
        return EXIT_FAILURE;
    }
    memset(&t->response, 0, sizeof t->response);
    t->missed = 0;
    for (uint32_t k = 0; k < periods; ++k) {
        period(t, N_FAULTS);
    }
    const gust_times response = t->response;
    const uint64_t missed = t->missed;
    for (uint32_t k = 0; k < trials * N_FAULTS; ++k) {
        if (!run_up(t) || !trial(t, (fault)(k % N_FAULTS))) {
            (void)fprintf(stderr, "gust-latency: no end of %s in trial %u\n", NAMES[k % N_FAULTS], k);
            return EXIT_FAILURE;
        }
    }
    (void)printf("{\"period_us\": %llu, \"missed\": %llu, ", (unsigned long long)(t->period / NS_PER_US),
                 (unsigned long long)missed);
    print_times("response_us", &response);
    (void)printf(", \"to_safe_us\": {");
    for (uint32_t k = 0; k < N_FAULTS; ++k) {
        (void)printf("%s", k > 0 ? ", " : "");
        print_times(NAMES[k], &t->to_safe[k]);
    }
    (void)printf("}}\n");
    return EXIT_SUCCESS;
}

int main(int n, char **arguments)
{
    gust_error error;
    if (n < 2 || n > 4) {
        (void)fputs("usage: gust-latency INTERFACE [PERIODS [TRIALS]]\n", stderr);
        return EXIT_USAGE;
    }
    tester *t = calloc(1, sizeof *t);
    if (t == NULL) {
        return EXIT_FAILURE;
    }
    take_names(t, GUST_PART_MEASUREMENTS);
    take_names(t, GUST_PART_SET_POINTS);
    take_names(t, GUST_PART_REFERENCES);
    const gust_message *sync = gust_message_find(&gust_messages, GUST_PART_SYNC, 0);
    t->period = sync != NULL && sync->cycle != 0 ? sync->cycle * NS_PER_US : PERIOD;
    const gust_plant_config config = {.messages = &gust_messages,
                                      .transport = &t->socket.transport,
                                      .period = t->period,
                                      .measurements = t->names,
                                      .n_measurements = t->n,
                                      .commands = t->commands,
                                      .n_commands = t->n_commands,
                                      .start = t->start,
                                      .missing = TOLERATED};
    int code = EXIT_USAGE;
    if (!gust_plant_init(&t->plant, &config, &error) ||
        !gust_socketcan_open(&t->socket, arguments[1], true, &error)) {
        (void)fprintf(stderr, "gust-latency: %s.\n", error.text);
    } else {
        t->nonce = (uint32_t)(gust_clock_now() / NS_PER_US); /* another one than in the run before */
        code = measure(t, n > 2 ? (uint32_t)strtoul(arguments[2], NULL, 10) : RUN_PERIODS,
                       n > 3 ? (uint32_t)strtoul(arguments[3], NULL, 10) : TRIALS);
        t->socket.transport.close(&t->socket.transport);
    }
    free(t);
    return code;
}
