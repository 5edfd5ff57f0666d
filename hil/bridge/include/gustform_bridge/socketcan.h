/* A CAN interface of Linux as a transport: CAN_RAW with FD frames, error frames and own echoes, never blocking.
 *
 * A frame that was handed over can be called back by nobody: `flush` does nothing, and what stands in the queue
 * of the interface when the bus comes back leaves late. That is why the bridge keeps one sample of references
 * under way at most, and why references carry the number of their sample.
 */
#ifndef GUSTFORM_BRIDGE_SOCKETCAN_H
#define GUSTFORM_BRIDGE_SOCKETCAN_H

#include <stdbool.h>
#include <stdint.h>

#include "bind.h"
#include "transport.h"

typedef struct gust_socketcan {
    gust_transport transport; /* first */
    int descriptor;
    bool fd;             /* the interface carries CAN FD */
    uint32_t under_way;  /* handed over, no echo yet */
    uint64_t overflowed; /* frames that the kernel dropped for want of room in the receive buffer */
} gust_socketcan;

/* false and a text if there is no such interface or it is not allowed. `listen` = false: sends only. The caller
 * owns the struct; `transport.close` closes the socket. */
bool gust_socketcan_open(gust_socketcan *socketcan, const char *interface, bool listen, gust_error *error);

#endif
