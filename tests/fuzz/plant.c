/* libFuzzer on the converter's node: any sequence of frames and periods. Whatever comes, the plant acts on
 * numbers within the ranges of the message set, and on those of its start while it is not running.
 *
 * Input: records as those of bridge.c, without reports of the transport. */
#include <stdio.h>

#include "gustform_bridge/loop_transport.h"
#include "gustform_bridge/plant.h"
#include "records.h"

enum { PLANT, PERIOD = 1000000, FRAME = 20000, COMMANDS = 3, MISSING = 3 };

static const char *const measured[] = {"v_dc", "omega_r", "Q_gsc"};
static const char *const commanded[COMMANDS] = {"omega_gsc", "V_gsc", "beta_ref"};
static const double at_start[COMMANDS] = {1.0, 1.0, 0.0};

typedef struct stand {
    gust_bus bus;
    gust_plant plant;
} stand;

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size);

static void look(const gust_plant *plant)
{
    for (size_t k = 0; k < COMMANDS; k++) {
        const gust_place *const place = &plant->commanded[k];
        const gust_message *const message = gust_message_find(&gust_messages, place->part, place->piece);
        const gust_signal *const signal = &message->signals[place->signal];
        check(plant->command[k] >= signal->low && plant->command[k] <= signal->high);
        check(plant->state == GUST_CONVERTER_RUNNING || plant->command[k] == at_start[k]);
    }
}

static void period(stand *s, uint8_t op)
{
    const double values[] = {1.0, 1.2, (double)op / 64.0};
    gust_transport *const transport = &s->bus.node[PLANT].transport;
    gust_frame frame;

    gust_plant_finish(&s->plant);
    look(&s->plant);
    gust_plant_send(&s->plant, values);
    gust_bus_run(&s->bus, s->bus.now + PERIOD);
    while (transport->receive(transport, &frame) == GUST_TRANSPORT_OK)
        (void)gust_plant_receive(&s->plant, &frame);
}

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size)
{
    static stand s; /* large; as new each time */
    reader r = {.next = input, .left = size};
    gust_error error = {.text = ""};

    memset(&s, 0, sizeof s);
    gust_bus_init(&s.bus, FRAME);
    const gust_plant_config config = {.messages = &gust_messages,
                                      .transport = &s.bus.node[PLANT].transport,
                                      .period = PERIOD,
                                      .measurements = measured,
                                      .n_measurements = 3,
                                      .commands = commanded,
                                      .n_commands = COMMANDS,
                                      .start = at_start,
                                      .missing = MISSING};
    check(gust_plant_init(&s.plant, &config, &error));
    while (r.left > 0) {
        const uint8_t op = take(&r);
        if ((op & 3U) == 0) {
            period(&s, op);
        } else {
            gust_frame frame = (op & 3U) == 1U ? good_frame(&r, op) : any_frame(&r);
            frame.time = s.bus.now;
            (void)gust_plant_receive(&s.plant, &frame);
        }
    }
    if (getenv("GUST_FUZZ_TELL") != NULL)
        (void)printf("state %d\n", (int)s.plant.state);
    return 0;
}
