/* One frame of a CAN bus, classic or FD, whatever carries it. */
#ifndef GUSTFORM_BRIDGE_FRAME_H
#define GUSTFORM_BRIDGE_FRAME_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GUST_FRAME_DATA 64 /* bytes of the longest frame */

enum gust_frame_flags {
    GUST_FRAME_FD = 1U << 0,       /* CAN FD, always with bit-rate switch */
    GUST_FRAME_EXTENDED = 1U << 1, /* 29-bit identifier */
    GUST_FRAME_REMOTE = 1U << 2,   /* remote request: never part of the message set */
    GUST_FRAME_ERROR = 1U << 3, /* error frame of the driver: `id` holds the class bits of linux/can/error.h */
    GUST_FRAME_OWN = 1U << 4    /* echo of a frame that this transport has sent: it has left the queue */
};

typedef struct gust_frame {
    uint64_t time; /* ns of the transport's clock, at reception */
    uint32_t id;   /* without the flags */
    uint8_t flags;
    uint8_t length; /* bytes of data: 0 ... 8, FD also 12, 16, 20, 24, 32, 48, 64 */
    uint8_t data[GUST_FRAME_DATA];
} gust_frame;

#ifdef __cplusplus
}
#endif

#endif
