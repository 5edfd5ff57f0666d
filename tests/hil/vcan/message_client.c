/* The message set in C on a real bus: answers each frame with the same values under the next counter.
 *
 *   message_client INTERFACE
 *
 * Each frame that decodes is encoded again and sent back with its identifier; each that does not is answered by
 * one of identifier 0x7FF, whose first byte is enum gust_decoded. Prints "ready" when it listens, ends with the
 * first remote frame. */
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "gustform_bridge/messages.h"

static int open_bus(const char *interface)
{
    const int bus = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    const int on = 1;
    struct sockaddr_can address;

    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = (int)if_nametoindex(interface);
    if (bus < 0 || address.can_ifindex == 0 ||
        setsockopt(bus, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
        bind(bus, (const struct sockaddr *)&address, sizeof address) != 0)
        return -1;
    return bus;
}

static void answer(const gust_frame *frame, gust_frame *reply)
{
    const gust_message *message = NULL;
    double values[GUST_MESSAGE_SIGNALS];
    uint8_t counter = 0;
    const gust_decoded result = gust_message_decode(&gust_messages, frame, &message, values, &counter);

    memset(reply, 0, sizeof *reply);
    if (result == GUST_DECODED && gust_message_encode(message, values, (uint8_t)(counter + 1U), reply) == 0U)
        return;
    reply->id = 0x7FF;
    reply->flags = frame->flags & GUST_FRAME_FD;
    reply->length = 1;
    reply->data[0] = (uint8_t)result;
}

static int send_frame(int bus, const gust_frame *frame)
{
    struct canfd_frame raw;
    const int fd = (frame->flags & GUST_FRAME_FD) != 0;

    memset(&raw, 0, sizeof raw);
    raw.can_id = frame->id | ((frame->flags & GUST_FRAME_EXTENDED) != 0 ? CAN_EFF_FLAG : 0U);
    raw.len = frame->length;
    raw.flags = fd ? CANFD_BRS : 0;
    memcpy(raw.data, frame->data, sizeof raw.data);
    const size_t size = fd ? CANFD_MTU : CAN_MTU;
    return write(bus, &raw, size) == (ssize_t)size ? 0 : -1;
}

int main(int argc, char **argv)
{
    const int bus = argc == 2 ? open_bus(argv[1]) : -1;
    struct canfd_frame raw;

    if (bus < 0)
        return 2;
    puts("ready");
    fflush(stdout);
    for (;;) {
        memset(&raw, 0, sizeof raw);
        const ssize_t got = read(bus, &raw, sizeof raw);
        gust_frame frame = {.length = raw.len};
        gust_frame reply;
        if (got != (ssize_t)CAN_MTU && got != (ssize_t)CANFD_MTU)
            return 1;
        if ((raw.can_id & CAN_RTR_FLAG) != 0)
            return 0;
        frame.id = raw.can_id & ((raw.can_id & CAN_EFF_FLAG) != 0 ? CAN_EFF_MASK : CAN_SFF_MASK);
        frame.flags = (uint8_t)((got == (ssize_t)CANFD_MTU ? GUST_FRAME_FD : 0) |
                                ((raw.can_id & CAN_EFF_FLAG) != 0 ? GUST_FRAME_EXTENDED : 0));
        memcpy(frame.data, raw.data, sizeof frame.data);
        answer(&frame, &reply);
        if (send_frame(bus, &reply) != 0)
            return 1;
    }
}
