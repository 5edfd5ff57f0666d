#include "gustform_bridge/socketcan.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "gustform_bridge/clock.h"

#define NS_PER_S       UINT64_C(1000000000)
#define RECEIVE_BUFFER (4 * 1024 * 1024)

static gust_socketcan *of(gust_transport *transport)
{
    return (gust_socketcan *)transport;
}

static uint64_t clock_now(gust_transport *transport)
{
    (void)transport;
    return gust_clock_now();
}

static gust_transport_status status_of(int error)
{
    switch (error) {
    case ENOBUFS:
    case EAGAIN:
        return GUST_TRANSPORT_FULL;
    case ENETDOWN:
    case ENETUNREACH:
    case ENODEV:
    case ENXIO:
        return GUST_TRANSPORT_DOWN;
    default:
        return GUST_TRANSPORT_FAILED;
    }
}

static gust_transport_status send_frame(gust_transport *transport, const gust_frame *frame)
{
    gust_socketcan *socketcan = of(transport);
    const bool fd = (frame->flags & GUST_FRAME_FD) != 0;
    struct canfd_frame raw;
    memset(&raw, 0, sizeof raw);
    raw.can_id = frame->id | ((frame->flags & GUST_FRAME_EXTENDED) != 0 ? CAN_EFF_FLAG : 0U) |
                 ((frame->flags & GUST_FRAME_ERROR) != 0 ? CAN_ERR_FLAG : 0U);
    raw.len = frame->length;
    raw.flags = fd ? CANFD_BRS : 0;
    if (frame->length > (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) {
        errno = EINVAL;
        return GUST_TRANSPORT_FAILED;
    }
    memcpy(raw.data, frame->data, frame->length);
    const size_t size = fd ? CANFD_MTU : CAN_MTU;
    const ssize_t sent = send(socketcan->descriptor, &raw, size, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (sent != (ssize_t)size) {
        return status_of(errno);
    }
    ++socketcan->under_way;
    return GUST_TRANSPORT_OK;
}

static void take_flags(const struct canfd_frame *raw, size_t size, int message_flags, gust_frame *frame)
{
    frame->flags = size == CANFD_MTU ? GUST_FRAME_FD : 0;
    if ((raw->can_id & CAN_ERR_FLAG) != 0) {
        frame->flags |= GUST_FRAME_ERROR;
        frame->id = raw->can_id & CAN_ERR_MASK;
    } else if ((raw->can_id & CAN_EFF_FLAG) != 0) {
        frame->flags |= GUST_FRAME_EXTENDED;
        frame->id = raw->can_id & CAN_EFF_MASK;
    } else {
        frame->id = raw->can_id & CAN_SFF_MASK;
    }
    if ((raw->can_id & CAN_RTR_FLAG) != 0) {
        frame->flags |= GUST_FRAME_REMOTE;
    }
    /* Set on an echo of what this very socket has sent. */
    if (((unsigned)message_flags & (unsigned)MSG_CONFIRM) != 0) {
        frame->flags |= GUST_FRAME_OWN;
    }
}

static gust_transport_status receive_frame(gust_transport *transport, gust_frame *frame)
{
    gust_socketcan *socketcan = of(transport);
    struct canfd_frame raw;
    struct iovec part = {.iov_base = &raw, .iov_len = sizeof raw};
    struct msghdr message;
    memset(&message, 0, sizeof message);
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    const ssize_t size = recvmsg(socketcan->descriptor, &message, MSG_DONTWAIT);
    if (size < 0) {
        return errno == EAGAIN ? GUST_TRANSPORT_EMPTY : status_of(errno);
    }
    const bool fd = size == (ssize_t)CANFD_MTU;
    if ((!fd && size != (ssize_t)CAN_MTU) || raw.len > (fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) {
        return GUST_TRANSPORT_FAILED;
    }
    take_flags(&raw, (size_t)size, message.msg_flags, frame);
    if ((frame->flags & GUST_FRAME_OWN) != 0 && socketcan->under_way > 0) {
        --socketcan->under_way;
    }
    if ((frame->flags & GUST_FRAME_ERROR) != 0 && (frame->id & CAN_ERR_BUSOFF) != 0) {
        socketcan->under_way = 0; /* the driver drops what it had */
    }
    frame->time = clock_now(transport); /* stamps of the kernel are of another clock */
    frame->length = raw.len;
    memcpy(frame->data, raw.data, frame->length);
    memset(frame->data + frame->length, 0, sizeof frame->data - frame->length);
    return GUST_TRANSPORT_OK;
}

static gust_transport_status wait_frame(gust_transport *transport, uint64_t deadline)
{
    struct pollfd descriptor = {.fd = of(transport)->descriptor, .events = POLLIN};
    const uint64_t now = clock_now(transport);
    const uint64_t left = deadline > now ? deadline - now : 0;
    const struct timespec timeout = {.tv_sec = (time_t)(left / NS_PER_S), .tv_nsec = (long)(left % NS_PER_S)};
    const int ready = ppoll(&descriptor, 1, &timeout, NULL);
    if (ready < 0 && errno != EINTR) {
        return GUST_TRANSPORT_FAILED;
    }
    return ready > 0 ? GUST_TRANSPORT_OK : GUST_TRANSPORT_EMPTY;
}

static uint32_t pending(gust_transport *transport)
{
    return of(transport)->under_way;
}

static void flush(gust_transport *transport)
{
    (void)transport; /* the queue of an interface cannot be called back */
}

static void close_socket(gust_transport *transport)
{
    (void)close(of(transport)->descriptor);
    of(transport)->descriptor = -1;
}

/* All frames, all error classes and own echoes, or nothing at all. */
static bool set_options(gust_socketcan *socketcan, bool listen)
{
    const int on = 1;
    const int buffer = RECEIVE_BUFFER;
    const can_err_mask_t errors = listen ? CAN_ERR_MASK : 0;
    const int d = socketcan->descriptor;
    if (!listen && setsockopt(d, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0) != 0) {
        return false;
    }
    if (listen && setsockopt(d, SOL_SOCKET, SO_RCVBUFFORCE, &buffer, sizeof buffer) != 0) {
        (void)setsockopt(d, SOL_SOCKET, SO_RCVBUF, &buffer, sizeof buffer); /* as much as is allowed */
    }
    return setsockopt(d, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) == 0 &&
           setsockopt(d, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) == 0 &&
           (!listen || setsockopt(d, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &on, sizeof on) == 0);
}

static bool bind_to(gust_socketcan *socketcan, const char *interface, gust_error *error)
{
    struct ifreq request;
    memset(&request, 0, sizeof request);
    if (strlen(interface) >= sizeof request.ifr_name) {
        return gust_fail(
            error,
            "GF8060: the name of interface '%.32s' is too long. List those there are with: ip link show type can",
            interface);
    }
    memcpy(request.ifr_name, interface, strlen(interface));
    if (ioctl(socketcan->descriptor, SIOCGIFINDEX, &request) != 0) {
        return gust_fail(error,
                         "GF8060: there is no interface '%s' (%s). Make one with: ip link add %s type vcan",
                         interface, strerror(errno), interface);
    }
    struct sockaddr_can address;
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = request.ifr_ifindex;
    if (bind(socketcan->descriptor, (const struct sockaddr *)&address, sizeof address) != 0) {
        return gust_fail(error,
                         "GF8061: interface '%s' is no CAN interface (%s). See: ip -details link show %s",
                         interface, strerror(errno), interface);
    }
    if (ioctl(socketcan->descriptor, SIOCGIFMTU, &request) == 0) {
        socketcan->fd = request.ifr_mtu >= (int)CANFD_MTU;
    }
    return true;
}

bool gust_socketcan_open(gust_socketcan *socketcan, const char *interface, bool listen, gust_error *error)
{
    memset(socketcan, 0, sizeof *socketcan);
    socketcan->transport = (gust_transport){.send = send_frame,
                                            .receive = receive_frame,
                                            .wait = wait_frame,
                                            .pending = pending,
                                            .flush = flush,
                                            .now = clock_now,
                                            .close = close_socket};
    socketcan->descriptor = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    if (socketcan->descriptor < 0) {
        return gust_fail(error, "GF8061: the kernel gives no CAN socket (%s). Load it with: modprobe can-raw",
                         strerror(errno));
    }
    if (!set_options(socketcan, listen)) {
        close_socket(&socketcan->transport);
        return gust_fail(error,
                         "GF8061: the kernel's CAN sockets are too old (%s). Linux 4.4 or newer is needed",
                         strerror(errno));
    }
    if (!bind_to(socketcan, interface, error)) {
        close_socket(&socketcan->transport);
        return false;
    }
    return true;
}
