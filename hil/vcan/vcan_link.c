/* The rtnetlink message that adds a vcan, and the flag that switches an interface on. */
#define _GNU_SOURCE
#include "vcan_link.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <stddef.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

/* A new-link request with its attributes behind it. */
struct request {
    struct nlmsghdr header;
    struct ifinfomsg link;
    unsigned char attributes[128];
};

/* Appends one attribute and returns where it begins, counted from the start of the request. */
static size_t append(struct request *request, unsigned short type, const void *data, size_t size)
{
    const size_t at = NLMSG_ALIGN(request->header.nlmsg_len);
    const struct rtattr attribute = {.rta_len = (unsigned short)RTA_LENGTH(size), .rta_type = type};
    unsigned char *const place = (unsigned char *)request + at;
    memcpy(place, &attribute, sizeof attribute);
    if (size > 0) {
        memcpy(place + RTA_LENGTH(0), data, size);
    }
    request->header.nlmsg_len = (unsigned)(at + RTA_ALIGN(attribute.rta_len));
    return at;
}

/* Sends the request and takes the kernel's answer to it. */
static int ask(const struct request *request)
{
    const int link = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);
    if (link < 0) {
        return -1;
    }
    struct {
        struct nlmsghdr header;
        struct nlmsgerr error;
        unsigned char rest[256]; /* the kernel repeats the request */
    } answer = {.error = {.error = -EIO}};
    const ssize_t size = request->header.nlmsg_len;
    if (send(link, request, (size_t)size, 0) != size || recv(link, &answer, sizeof answer, 0) < 0) {
        answer.error.error = -errno;
    }
    (void)close(link);
    errno = -answer.error.error;
    return errno == 0 ? 0 : -1;
}

int link_add_vcan(const char *name)
{
    static const char kind[] = "vcan";
    const unsigned mtu = CANFD_MTU;
    if (strlen(name) >= IFNAMSIZ) {
        errno = ENAMETOOLONG;
        return -1;
    }
    struct request request = {
        .header = {.nlmsg_len = NLMSG_LENGTH(sizeof request.link),
                   .nlmsg_type = RTM_NEWLINK,
                   .nlmsg_flags = NLM_F_REQUEST | NLM_F_CREATE | NLM_F_EXCL | NLM_F_ACK},
    };
    (void)append(&request, IFLA_IFNAME, name, strlen(name) + 1);
    (void)append(&request, IFLA_MTU, &mtu, sizeof mtu);
    /* The kind stands inside the link's information: an attribute around an attribute. */
    const size_t outer = append(&request, IFLA_LINKINFO, NULL, 0);
    (void)append(&request, IFLA_INFO_KIND, kind, sizeof kind - 1);
    const unsigned short length = (unsigned short)(request.header.nlmsg_len - outer);
    memcpy((unsigned char *)&request + outer, &length, sizeof length);
    return ask(&request);
}

int link_up(const char *name)
{
    const int any = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (any < 0) {
        return -1;
    }
    struct ifreq request = {0};
    strncpy(request.ifr_name, name, IFNAMSIZ - 1);
    int result = ioctl(any, SIOCGIFFLAGS, &request);
    if (result == 0) {
        request.ifr_flags = (short)((unsigned short)request.ifr_flags | (unsigned)IFF_UP);
        result = ioctl(any, SIOCSIFFLAGS, &request);
    }
    const int error = errno;
    (void)close(any);
    errno = error;
    return result;
}
