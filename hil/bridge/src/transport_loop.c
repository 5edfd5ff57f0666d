#include "gustform_bridge/loop_transport.h"

#include <string.h>

#define ERROR_BUS_OFF   UINT32_C(0x40)
#define ERROR_RESTARTED UINT32_C(0x100)

static gust_bus_node *of(gust_transport *transport)
{
    return (gust_bus_node *)transport;
}

static gust_transport_status send_frame(gust_transport *transport, const gust_frame *frame)
{
    gust_bus_node *node = of(transport);
    if (node->off) {
        return GUST_TRANSPORT_DOWN;
    }
    if (node->full > 0) {
        --node->full;
        return GUST_TRANSPORT_FULL;
    }
    if (node->n_queued >= node->capacity) {
        return GUST_TRANSPORT_FULL;
    }
    node->queue[node->n_queued] = *frame;
    node->queue[node->n_queued].time = node->bus->now;
    ++node->n_queued;
    return GUST_TRANSPORT_OK;
}

static gust_transport_status receive_frame(gust_transport *transport, gust_frame *frame)
{
    gust_bus_node *node = of(transport);
    if (node->n_received == 0) {
        return GUST_TRANSPORT_EMPTY;
    }
    *frame = node->received[node->first_received];
    node->first_received = (node->first_received + 1U) % GUST_BUS_RECEIVED;
    --node->n_received;
    return GUST_TRANSPORT_OK;
}

static gust_transport_status wait_frame(gust_transport *transport, uint64_t deadline)
{
    gust_bus_node *node = of(transport);
    if (node->n_received == 0 && deadline > node->bus->now) {
        gust_bus_run(node->bus, deadline);
    }
    return node->n_received > 0 ? GUST_TRANSPORT_OK : GUST_TRANSPORT_EMPTY;
}

static uint32_t pending(gust_transport *transport)
{
    return of(transport)->n_queued;
}

static void flush(gust_transport *transport)
{
    of(transport)->n_queued = 0;
}

static uint64_t bus_now(gust_transport *transport)
{
    return of(transport)->bus->now;
}

static void leave(gust_transport *transport)
{
    of(transport)->off = true;
}

void gust_bus_init(gust_bus *bus, uint64_t frame_time)
{
    memset(bus, 0, sizeof *bus);
    bus->frame_time = frame_time;
    for (uint32_t k = 0; k < GUST_BUS_NODES; ++k) {
        bus->node[k].bus = bus;
        bus->node[k].capacity = GUST_BUS_QUEUE;
        bus->node[k].transport = (gust_transport){.send = send_frame,
                                                  .receive = receive_frame,
                                                  .wait = wait_frame,
                                                  .pending = pending,
                                                  .flush = flush,
                                                  .now = bus_now,
                                                  .close = leave};
    }
}

void gust_bus_inject(gust_bus_node *node, const gust_frame *frame)
{
    if (node->n_received >= GUST_BUS_RECEIVED) {
        ++node->overflowed;
        return;
    }
    gust_frame *place = &node->received[(node->first_received + node->n_received) % GUST_BUS_RECEIVED];
    *place = *frame;
    place->time = node->bus->now;
    ++node->n_received;
}

/* The node whose first frame wins the arbitration; NULL: nobody has one. */
static gust_bus_node *winner(gust_bus *bus)
{
    gust_bus_node *best = NULL;
    for (uint32_t k = 0; k < GUST_BUS_NODES; ++k) {
        gust_bus_node *node = &bus->node[k];
        if (node->n_queued > 0 && (best == NULL || node->queue[0].id < best->queue[0].id)) {
            best = node;
        }
    }
    return best;
}

static void deliver(gust_bus *bus, gust_bus_node *sender, gust_frame *frame)
{
    gust_frame echo = *frame;
    echo.flags |= GUST_FRAME_OWN;
    gust_bus_inject(sender, &echo);
    if (bus->tap != NULL && !bus->tap(bus->context, sender, frame)) {
        return;
    }
    for (uint32_t k = 0; k < GUST_BUS_NODES; ++k) {
        gust_bus_node *node = &bus->node[k];
        if (node == sender || node->off) {
            continue;
        }
        if (node->deaf > 0) {
            --node->deaf;
            continue;
        }
        gust_bus_inject(node, frame);
    }
}

void gust_bus_run(gust_bus *bus, uint64_t time)
{
    gust_bus_node *sender = bus->held ? NULL : winner(bus);
    while (sender != NULL && bus->now + bus->frame_time <= time) {
        gust_frame frame = sender->queue[0];
        --sender->n_queued;
        memmove(&sender->queue[0], &sender->queue[1], sender->n_queued * sizeof frame);
        bus->now += bus->frame_time;
        deliver(bus, sender, &frame);
        sender = winner(bus);
    }
    bus->now = time > bus->now ? time : bus->now;
}

static void tell(gust_bus_node *node, uint32_t class)
{
    const gust_frame error = {.id = class, .flags = GUST_FRAME_ERROR, .length = 8};
    gust_bus_inject(node, &error);
}

void gust_bus_off(gust_bus_node *node)
{
    node->off = true;
    node->n_queued = 0;
    tell(node, ERROR_BUS_OFF);
}

void gust_bus_restart(gust_bus_node *node)
{
    node->off = false;
    tell(node, ERROR_RESTARTED);
}
