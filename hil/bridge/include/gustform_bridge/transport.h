/* What carries frames: SocketCAN, or a loop inside one process.
 *
 * Ownership: a transport is made by one of the _open functions below and given back to its `close`. Nothing is
 * allocated between the two. No call blocks except `wait`. One thread.
 */
#ifndef GUSTFORM_BRIDGE_TRANSPORT_H
#define GUSTFORM_BRIDGE_TRANSPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "frame.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum gust_transport_status {
    GUST_TRANSPORT_OK = 0,
    GUST_TRANSPORT_EMPTY = 1,  /* nothing to receive; `wait` timed out */
    GUST_TRANSPORT_FULL = -1,  /* ENOBUFS, EAGAIN: the frame was not taken, and never will be sent */
    GUST_TRANSPORT_DOWN = -2,  /* ENETDOWN, ENODEV: no bus */
    GUST_TRANSPORT_FAILED = -3 /* anything else; errno tells */
} gust_transport_status;

typedef struct gust_transport gust_transport;

struct gust_transport {
    /* Hand over one frame, at once or not at all. */
    gust_transport_status (*send)(gust_transport *transport, const gust_frame *frame);
    /* Take the oldest frame that has come in, error frames and own echoes included. */
    gust_transport_status (*receive)(gust_transport *transport, gust_frame *frame);
    /* Until a frame is there, or until `deadline` (ns of `now`). */
    gust_transport_status (*wait)(gust_transport *transport, uint64_t deadline);
    /* Frames handed over that have not left yet, as far as is known. */
    uint32_t (*pending)(gust_transport *transport);
    /* Forget what has not left, where that can be done. */
    void (*flush)(gust_transport *transport);
    /* ns; CLOCK_MONOTONIC, or the virtual time of the loop. */
    uint64_t (*now)(gust_transport *transport);
    void (*close)(gust_transport *transport);
};

#ifdef __cplusplus
}
#endif

#endif
