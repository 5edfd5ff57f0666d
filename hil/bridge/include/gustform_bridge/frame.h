/* One frame of a CAN bus, classic or FD, whatever carries it. */
#ifndef GUSTFORM_BRIDGE_FRAME_H
#define GUSTFORM_BRIDGE_FRAME_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define GUST_FRAME_DATA 64 /* bytes of the longest frame */

/* Flags of a frame. */
#define GUST_FRAME_FD       0x01U /* CAN FD, always with bit-rate switch */
#define GUST_FRAME_EXTENDED 0x02U /* 29-bit identifier */
#define GUST_FRAME_REMOTE   0x04U /* remote request: never part of the message set */
#define GUST_FRAME_ERROR    0x08U /* of the driver: `id` holds the class bits of linux/can/error.h */
#define GUST_FRAME_OWN      0x10U /* echo of a frame that this transport has sent: it has left */

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
