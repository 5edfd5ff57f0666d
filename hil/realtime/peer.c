/* The other end of the bus for a run in real time: the converter and its operator, with a clock of their own.
 *
 *   peer INTERFACE PERIODS BRIDGE [ARGUMENT...]
 *
 * Starts the bridge, sends it heartbeat, fingerprint, measurements and Sync each millisecond at absolute
 * deadlines, lets it run by an operator's command when it is ready, and listens to its references for PERIODS
 * periods. Then the bridge is sent TERM, and what was measured is printed as one JSON line. Exit code 1 if the
 * bridge left RUN or any period had no reference.
 *
 * A converter does not share its processor with the controller. Here it does, so it works half a period away
 * from the bridge, whose deadlines show in its first references.
 *
 * Links nothing of the bridge but the message set, so that clock, socket and supervision are seen from outside.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <inttypes.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <math.h>
#include <net/if.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "gustform_bridge/faults.h"
#include "gustform_bridge/messages.h"

#define NS_PER_S INT64_C(1000000000)
#define PERIOD   INT64_C(1000000) /* ns */
#define MESSAGES 64
#define LONGEST  100000 /* periods of a run, at most */
#define PRIORITY 90     /* the loop of the bridge has 80 */
#define GIVE_UP  10000  /* periods until RUN */
#define SETTLING 200    /* periods of RUN before those that count */
#define FIRST    20     /* references of the bridge by which its deadlines are found */
#define START    1      /* operator's command */
#define READY    1      /* states of the converter */
#define RUNNING  2
#define US       1e-3

/* What one period looked like from here, ns. */
struct period {
    int64_t sent;     /* when its Sync was handed over */
    int64_t late;     /* of our own deadline */
    int64_t answered; /* when its references were on the bus; 0: never */
};

struct peer {
    int bus;
    int64_t realtime; /* CLOCK_REALTIME - CLOCK_MONOTONIC: stamps of the kernel are of the first */
    uint32_t sample;
    uint8_t counter[MESSAGES];
    int state;  /* of the bridge; -1: not heard */
    bool asked; /* the operator has said start */
    uint32_t running_since;
    uint32_t left;  /* periods in which the bridge said a state other than RUN, after RUN */
    uint32_t wrong; /* frames that the decoder refused */
    struct period periods[LONGEST];
};

static _Noreturn void fail(const char *what)
{
    (void)fprintf(stderr, "peer: %s: %s\n", what, strerror(errno));
    exit(EXIT_FAILURE);
}

static int64_t clock_of(clockid_t id)
{
    struct timespec now;
    (void)clock_gettime(id, &now);
    return (int64_t)now.tv_sec * NS_PER_S + now.tv_nsec;
}

static void sleep_until(int64_t time)
{
    const struct timespec until = {.tv_sec = time / NS_PER_S, .tv_nsec = time % NS_PER_S};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR) {
    }
}

static int open_bus(const char *interface)
{
    const int bus = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    const int on = 1;
    const struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(interface)};
    if (bus < 0 || setsockopt(bus, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
        setsockopt(bus, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) != 0 ||
        bind(bus, (const struct sockaddr *)&address, sizeof address) != 0) {
        fail(interface);
    }
    return bus;
}

/* ---- Sending ---- */

/* Measurements near the steady state at full speed; the link's voltage moves a hundredth to and fro at 5 Hz. */
static double measured(const char *quantity, uint32_t sample, double otherwise)
{
    const struct {
        const char *name;
        double value;
    } known[] = {{"v_dc", 1.0 + 0.01 * sin(2.0 * M_PI * 0.005 * sample)},
                 {"P_pmsg", 0.8},
                 {"P_gsc", 0.8},
                 {"wind", 10.0}};
    for (size_t k = 0; k < sizeof known / sizeof *known; k++) {
        if (strcmp(quantity, known[k].name) == 0) {
            return known[k].value;
        }
    }
    return otherwise;
}

static double value_of(const struct peer *peer, const gust_signal *signal)
{
    switch (signal->field) {
    case GUST_FIELD_QUANTITY:
        return measured(signal->quantity, peer->sample, signal->safe);
    case GUST_FIELD_SAMPLE:
        return peer->sample;
    case GUST_FIELD_STATE:
        return peer->state == GUST_STATE_RUN ? RUNNING : READY;
    case GUST_FIELD_COMMAND:
        return START;
    case GUST_FIELD_NONCE:
        return 1.0;
    case GUST_FIELD_UPTIME:
        return floor(peer->sample * 1e-3);
    case GUST_FIELD_FINGERPRINT:
        return gust_messages.fingerprint;
    default:
        return signal->safe;
    }
}

static void send_part(struct peer *peer, gust_part part)
{
    const gust_message *message = NULL;
    for (uint8_t piece = 0; (message = gust_message_find(&gust_messages, part, piece)) != NULL; piece++) {
        double values[GUST_MESSAGE_SIGNALS] = {0};
        for (int k = 0; k < message->n_signals; k++) {
            values[k] = value_of(peer, &message->signals[k]);
        }
        gust_frame frame;
        uint8_t *const counter = &peer->counter[(message - gust_messages.messages) % MESSAGES];
        (void)gust_message_encode(message, values, *counter, &frame);
        /* Profiles 1 and 2 count less than a byte does. */
        *counter = (uint8_t)((*counter + 1U) % (message->e2e.profile == 5 ? 256U : 240U));
        struct canfd_frame raw = {.can_id = frame.id, .len = frame.length};
        memcpy(raw.data, frame.data, frame.length);
        const size_t size = (frame.flags & GUST_FRAME_FD) != 0 ? CANFD_MTU : CAN_MTU;
        if (send(peer->bus, &raw, size, MSG_DONTWAIT) != (ssize_t)size) {
            fail("send");
        }
    }
}

/* All that the converter and its operator say in one period. */
static void send_all(struct peer *peer)
{
    if (peer->sample % 1000 == 1) {
        send_part(peer, GUST_PART_CONVERTER_FINGERPRINT);
    }
    if (peer->sample % 100 == 0) {
        send_part(peer, GUST_PART_CONVERTER_HEARTBEAT);
    }
    if (peer->sample % 10 == 0) {
        send_part(peer, GUST_PART_CONVERTER_STATE);
        send_part(peer, GUST_PART_SET_POINTS);
    }
    if (peer->state == GUST_STATE_READY && !peer->asked) {
        send_part(peer, GUST_PART_OPERATOR_COMMAND);
        peer->asked = true;
    }
    send_part(peer, GUST_PART_MEASUREMENTS);
    send_part(peer, GUST_PART_SYNC);
}

/* ---- Listening ---- */

/* One frame and when the kernel took it, or false. */
static bool take(const struct peer *peer, gust_frame *frame, int64_t *when)
{
    struct canfd_frame raw;
    char control[CMSG_SPACE(sizeof(struct timespec))];
    struct iovec place = {&raw, sizeof raw};
    struct msghdr message = {
        .msg_iov = &place, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    const ssize_t size = recvmsg(peer->bus, &message, MSG_DONTWAIT);
    if (size < 0) {
        return false;
    }
    *when = 0;
    const struct cmsghdr *const header = CMSG_FIRSTHDR(&message);
    if (header != NULL && header->cmsg_type == SCM_TIMESTAMPNS) {
        struct timespec stamp;
        memcpy(&stamp, CMSG_DATA(header), sizeof stamp);
        *when = (int64_t)stamp.tv_sec * NS_PER_S + stamp.tv_nsec - peer->realtime;
    }
    *frame = (gust_frame){.id = raw.can_id & CAN_SFF_MASK,
                          .flags = size == (ssize_t)CANFD_MTU ? GUST_FRAME_FD : 0,
                          .length = raw.len};
    memcpy(frame->data, raw.data, sizeof raw.data);
    return true;
}

/* When the bridge's references come that it sends while it waits for a converter: half a period away from
 * there. */
static int64_t find_phase(const struct peer *peer)
{
    gust_frame frame;
    int64_t when = 0;
    int heard = 0;
    for (int tries = 0; heard < FIRST && tries < GIVE_UP; tries++) {
        sleep_until(clock_of(CLOCK_MONOTONIC) + PERIOD / 2);
        while (take(peer, &frame, &when)) {
            const gust_message *message = NULL;
            double values[GUST_MESSAGE_SIGNALS];
            uint8_t counter = 0;
            heard += gust_message_decode(&gust_messages, &frame, &message, values, &counter) == GUST_DECODED &&
                     message->part == GUST_PART_REFERENCES;
        }
    }
    if (heard < FIRST) {
        errno = ETIMEDOUT;
        fail("first references");
    }
    return when + PERIOD / 2;
}

static double field(const gust_message *message, const double *values, gust_field wanted)
{
    const int k = gust_message_signal(message, wanted, NULL);
    return k < 0 ? 0.0 : values[k];
}

static void hear_state(struct peer *peer, int state)
{
    if (state == GUST_STATE_RUN && peer->state != GUST_STATE_RUN) {
        peer->running_since = peer->sample;
    }
    if (state != GUST_STATE_RUN && peer->running_since > 0) {
        peer->left++;
    }
    peer->state = state;
}

static void listen_to_all(struct peer *peer)
{
    gust_frame frame;
    int64_t when = 0;
    while (take(peer, &frame, &when)) {
        const gust_message *message = NULL;
        double values[GUST_MESSAGE_SIGNALS];
        uint8_t counter = 0;
        const gust_decoded result = gust_message_decode(&gust_messages, &frame, &message, values, &counter);
        if (result != GUST_DECODED) {
            peer->wrong++;
            continue;
        }
        if (message->part == GUST_PART_CONTROLLER_STATE) {
            hear_state(peer, (int)field(message, values, GUST_FIELD_STATE));
        } else if (message->part == GUST_PART_REFERENCES && field(message, values, GUST_FIELD_ENABLE) > 0.0) {
            const double sample = field(message, values, GUST_FIELD_SAMPLE);
            if (sample >= 0.0 && sample < LONGEST && peer->periods[(uint32_t)sample].answered == 0) {
                peer->periods[(uint32_t)sample].answered = when;
            }
        }
    }
}

/* ---- Results ---- */

static int by_size(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a;
    const int64_t y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

/* {"mean": , "p99": , "max": } of `n` times in ns, printed in us; sorts them. */
static void print_spread(const char *name, int64_t *times, size_t n)
{
    double sum = 0.0;
    for (size_t k = 0; k < n; k++) {
        sum += (double)times[k];
    }
    qsort(times, n, sizeof *times, by_size);
    const size_t at_99 = n > 0 ? (n - 1) * 99 / 100 : 0;
    const size_t last = n > 0 ? n - 1 : 0;
    (void)printf("\"%s_us\": {\"mean\": %.3f, \"p99\": %.3f, \"max\": %.3f}, ", name,
                 n > 0 ? sum / (double)n * US : 0.0, (double)times[at_99] * US, (double)times[last] * US);
}

/* Of the periods first ... first + n - 1; how many had no reference. */
static uint32_t report(const struct peer *peer, uint32_t first, uint32_t n)
{
    static int64_t late[LONGEST];
    static int64_t response[LONGEST];
    static int64_t jitter[LONGEST];
    uint32_t answered = 0;
    uint32_t missing = 0;
    int64_t before = 0;
    for (uint32_t k = 0; k < n; k++) {
        const struct period *const period = &peer->periods[first + k];
        late[k] = period->late;
        if (period->answered == 0) {
            missing++;
            continue;
        }
        response[answered] = period->answered - period->sent;
        jitter[answered] = before == 0 ? 0 : llabs(period->answered - before - PERIOD);
        before = period->answered;
        answered++;
    }
    (void)printf("{\"event\": \"peer\", \"periods\": %" PRIu32 ", \"missing\": %" PRIu32
                 ", \"left_run\": %" PRIu32 ", \"refused\": %" PRIu32 ", ",
                 n, missing, peer->left, peer->wrong);
    print_spread("late", late, n);
    print_spread("jitter", jitter, answered);
    print_spread("sync_to_references", response, answered);
    (void)printf("\"period_ms\": 1}\n");
    return missing + peer->left + peer->wrong;
}

static pid_t start_bridge(char **arguments)
{
    const pid_t child = fork();
    if (child == 0) {
        /* The caller's own program. NOLINTNEXTLINE(clang-analyzer-optin.taint.GenericTaint) */
        (void)execv(arguments[0], arguments);
        fail(arguments[0]);
    }
    return child;
}

int main(int n, char **arguments)
{
    static struct peer peer = {.state = -1};
    const uint32_t periods = n > 3 ? (uint32_t)strtoul(arguments[2], NULL, 10) : 0;
    if (periods == 0 || periods > LONGEST - GIVE_UP - SETTLING - 2) {
        (void)fprintf(stderr, "usage: peer INTERFACE PERIODS BRIDGE [ARGUMENT...]\n");
        return 2;
    }
    peer.bus = open_bus(arguments[1]);
    peer.realtime = clock_of(CLOCK_REALTIME) - clock_of(CLOCK_MONOTONIC);
    const pid_t bridge = start_bridge(arguments + 3);
    const struct sched_param priority = {.sched_priority = PRIORITY};
    if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0 || mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        fail("real time");
    }
    int64_t deadline = find_phase(&peer) + PERIOD;
    uint32_t last = GIVE_UP;
    for (peer.sample = 1; peer.sample <= last + 1; peer.sample++, deadline += PERIOD) {
        sleep_until(deadline);
        struct period *const period = &peer.periods[peer.sample];
        period->late = clock_of(CLOCK_MONOTONIC) - deadline;
        listen_to_all(&peer);
        send_all(&peer);
        period->sent = clock_of(CLOCK_MONOTONIC);
        if (peer.running_since > 0) {
            last = peer.running_since + SETTLING + periods;
        }
    }
    listen_to_all(&peer);
    (void)kill(bridge, SIGTERM);
    int status = 0;
    (void)waitpid(bridge, &status, 0);
    if (peer.running_since == 0) {
        (void)fprintf(stderr, "peer: the bridge was never in RUN, but in state %d\n", peer.state);
        return EXIT_FAILURE;
    }
    const uint32_t wrong = report(&peer, peer.running_since + SETTLING, periods);
    return wrong == 0 && WIFEXITED(status) && WEXITSTATUS(status) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
