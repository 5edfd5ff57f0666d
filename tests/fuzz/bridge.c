/* libFuzzer on the bridge with an exported controller behind it: any sequence of frames, echoes, errors and
 * ticks. Whatever comes, each frame that it sends is one of its message set with every value in range, and
 * references are enabled in RUN only.
 *
 * A few quiet periods lead out of INIT and SAFE here, so that short inputs get there.
 *
 * Input: one byte of options, then records. The low bits of a record's first byte say what it is: a tick, a
 * frame of the message set under a good CRC and the next counter, any frame, a report of the transport. */
#include <stdio.h>

#include "gustform_bridge/bridge.h"
#include "gustform_bridge/loop_transport.h"
#include "records.h"

extern const gust_controller GUST_FUZZ_CONTROLLER;

enum { BRIDGE, LISTENER, PERIOD = 1000000, FRAME = 20000, QUIET = 3 };

typedef struct stand {
    gust_bus bus;
    gust_bridge bridge;
    bool synchronous;
} stand;

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size);

/* What the bridge has sent. */
static void listen(stand *s)
{
    gust_transport *const transport = &s->bus.node[LISTENER].transport;
    gust_frame frame;

    while (transport->receive(transport, &frame) == GUST_TRANSPORT_OK) {
        const gust_message *message = NULL;
        double values[GUST_MESSAGE_SIGNALS];
        uint8_t counter = 0;
        if ((frame.flags & GUST_FRAME_ERROR) != 0)
            continue;
        check(gust_message_decode(&gust_messages, &frame, &message, values, &counter) == GUST_DECODED);
        const int enable = gust_message_signal(message, GUST_FIELD_ENABLE, NULL);
        if (message->part == GUST_PART_REFERENCES && enable >= 0 && values[enable] != 0.0)
            check(s->bridge.supervision.state == GUST_STATE_RUN);
    }
}

static void tick(stand *s, uint32_t periods)
{
    gust_bridge_tick(&s->bridge, periods);
    gust_bus_run(&s->bus, s->bus.now + (uint64_t)periods * PERIOD);
    listen(s);
}

static void hear(stand *s, gust_frame *frame)
{
    frame->time = s->bus.now;
    if (gust_bridge_receive(&s->bridge, frame) && s->synchronous)
        tick(s, s->bridge.sync_periods);
}

/* The bus gives the bridge what is under way to it: its own echoes. */
static void drain(stand *s)
{
    gust_transport *const transport = &s->bus.node[BRIDGE].transport;
    gust_frame frame;

    while (transport->receive(transport, &frame) == GUST_TRANSPORT_OK)
        hear(s, &frame);
}

static void report(stand *s, uint8_t op)
{
    static const gust_transport_status statuses[] = {GUST_TRANSPORT_OK, GUST_TRANSPORT_FULL,
                                                     GUST_TRANSPORT_DOWN, GUST_TRANSPORT_FAILED};

    switch (op >> 2 & 7U) {
    case 0:
        gust_bus_off(&s->bus.node[BRIDGE]);
        break;
    case 1:
        gust_bus_restart(&s->bus.node[BRIDGE]);
        break;
    case 2:
        s->bus.held = !s->bus.held;
        break;
    case 3:
        gust_bridge_latch(&s->bridge, 1U << (op >> 5));
        break;
    case 4:
        s->bus.node[BRIDGE].full += op >> 5;
        break;
    case 5:
        gust_bridge_stop(&s->bridge);
        break;
    default:
        gust_bridge_transport(&s->bridge, statuses[op >> 5 & 3U]);
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size)
{
    static stand s; /* large; as new each time */
    reader r = {.next = input, .left = size};
    const uint8_t options = take(&r);

    memset(&s, 0, sizeof s);
    gust_bus_init(&s.bus, FRAME);
    s.synchronous = (options & 1U) != 0;
    gust_bridge_config config = {.controller = &GUST_FUZZ_CONTROLLER,
                                 .messages = &gust_messages,
                                 .transport = &s.bus.node[BRIDGE].transport,
                                 .rates = gust_default_rates,
                                 .n_rates = gust_n_default_rates,
                                 .synchronous = s.synchronous,
                                 .tune = (options & 2U) != 0,
                                 .age = PERIOD};
    gust_limits_default(&config.limits);
    config.limits.heartbeat = 0;
    config.limits.quiet = QUIET;
    gust_error error = {.text = ""};
    check(gust_bridge_init(&s.bridge, &config, &error));
    while (r.left > 0) {
        const uint8_t op = take(&r);
        gust_frame frame;
        drain(&s);
        switch (op & 3U) {
        case 0:
            tick(&s, 1U + (op >> 2 & 3U));
            break;
        case 1:
            frame = good_frame(&r, op);
            hear(&s, &frame);
            break;
        case 2:
            frame = any_frame(&r);
            hear(&s, &frame);
            break;
        default:
            report(&s, op);
            break;
        }
    }
    if (getenv("GUST_FUZZ_TELL") != NULL)
        (void)printf("state %d\n", (int)s.bridge.supervision.state);
    return 0;
}
