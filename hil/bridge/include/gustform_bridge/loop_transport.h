/* A bus inside one process, with virtual time and faults that can be put in: for tests, and for both roles in
 * one program.
 *
 * Every node has a queue of what it handed over and one of what it has received. `gust_bus_run` lets time pass:
 * each frame takes `frame_time` on the bus, the lowest identifier of all nodes goes first, and every node hears
 * it, its sender as an echo. Owned by the caller, no allocation, one thread.
 */
#ifndef GUSTFORM_BRIDGE_LOOP_TRANSPORT_H
#define GUSTFORM_BRIDGE_LOOP_TRANSPORT_H

#include <stdbool.h>
#include <stdint.h>

#include "transport.h"

#define GUST_BUS_NODES    4
#define GUST_BUS_RECEIVED 256 /* frames; more are lost and counted */
#define GUST_BUS_QUEUE    16  /* frames of a sender */

typedef struct gust_bus gust_bus;

typedef struct gust_bus_node {
    gust_transport transport; /* first */
    gust_bus *bus;
    gust_frame received[GUST_BUS_RECEIVED];
    uint32_t first_received, n_received;
    gust_frame queue[GUST_BUS_QUEUE];
    uint32_t n_queued;
    uint32_t capacity; /* of the queue, 1 ... GUST_BUS_QUEUE */
    uint32_t full;     /* fault: so many frames more are refused */
    uint32_t deaf;     /* fault: so many frames more are not heard */
    bool off;          /* fault: has left the bus; nothing in, nothing out */
    uint64_t overflowed;
} gust_bus_node;

struct gust_bus {
    gust_bus_node node[GUST_BUS_NODES];
    uint64_t now;        /* ns */
    uint64_t frame_time; /* ns */
    bool held;           /* fault: somebody else keeps the bus; frames stay in their queues */
    /* Sees each frame before the others hear it, and may change it; false: it is lost. NULL: none. */
    bool (*tap)(void *context, gust_bus_node *sender, gust_frame *frame);
    void *context;
};

void gust_bus_init(gust_bus *bus, uint64_t frame_time);

/* Until `now` is `time`: frames leave and are heard. Frames that do not fit in are left for later. */
void gust_bus_run(gust_bus *bus, uint64_t time);

/* A node leaves the bus: what it had is dropped, and it hears the error frame. */
void gust_bus_off(gust_bus_node *node);

/* It comes back. */
void gust_bus_restart(gust_bus_node *node);

/* A frame out of nowhere, heard by one node. */
void gust_bus_inject(gust_bus_node *node, const gust_frame *frame);

#endif
