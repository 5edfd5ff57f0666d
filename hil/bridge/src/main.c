/* gust-bridge: a controller on a CAN bus.
 *
 * Three threads: the loop with its deadlines; the watchdog, above it; and this one, which waits for signals,
 * prints what the loop tells, and may block on its output as long as it likes.
 */
#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "gustform_bridge/bridge.h"
#include "gustform_bridge/clock.h"
#include "gustform_bridge/loop.h"
#include "gustform_bridge/options.h"
#include "gustform_bridge/plant_program.h"
#include "gustform_bridge/report.h"
#include "gustform_bridge/socketcan.h"
#include "gustform_bridge/wakeup.h"
#include "gustform_bridge/watchdog.h"

#define JOIN_(a, b)     a##b
#define JOIN(a, b)      JOIN_(a, b)
#define CONTROLLER_HERE JOIN(GUST_BRIDGE_PREFIX, _controller)

extern const gust_controller CONTROLLER_HERE;

#define EXIT_USAGE          2
#define PRIORITY_LOOP       80
#define PRIORITY_WATCHDOG   81
#define WATCHDOG_PERIODS    4U
#define WATCHDOG_SHORTEST   2U
#define NS_PER_MS           UINT64_C(1000000)
#define WATCHDOG_SYNC       (UINT64_C(1000) * NS_PER_MS)
#define WATCHDOG_SYNC_LEAST (UINT64_C(100) * NS_PER_MS)
#define STATUS_MS           1000

/* Everything there is; allocated once, by main. */
typedef struct program {
    gust_options options;
    gust_socketcan loop_socket;
    gust_socketcan watchdog_socket;
    gust_bridge bridge;
    gust_watchdog watchdog;
    gust_loop loop;
    pthread_t thread;
    bool real_time, locked;
    gust_wakeup wakeup;
} program;

static int fail(const gust_error *error, int code)
{
    (void)fprintf(stderr, "gust-bridge: %s.\n", error->text);
    return code;
}

static void *run_loop(void *context)
{
    gust_loop_run(context);
    return NULL;
}

/* The number of events that were printed; those that were overwritten meanwhile are not. */
static uint64_t print_events(gust_loop *loop, uint64_t printed)
{
    const uint64_t n = atomic_load(&loop->n_events);
    uint64_t next = n - printed > GUST_LOOP_EVENTS ? n - GUST_LOOP_EVENTS : printed;
    for (; next < n; ++next) {
        const gust_event event = loop->events[next % GUST_LOOP_EVENTS];
        gust_report_event(stdout, &event);
    }
    return n;
}

static void watch(program *p)
{
    struct pollfd descriptors[] = {{.fd = p->wakeup.signals, .events = POLLIN},
                                   {.fd = p->loop.wake, .events = POLLIN}};
    uint64_t printed = 0;
    bool ended = false;
    while (!ended) {
        const int ready = poll(descriptors, 2, p->options.status ? STATUS_MS : -1);
        ended = descriptors[0].revents != 0 || (ready < 0 && errno != EINTR);
        uint64_t news = 0;
        if (ready > 0 && descriptors[1].revents != 0 && read(p->loop.wake, &news, sizeof news) < 0) {
            ended = errno != EAGAIN;
        }
        printed = print_events(&p->loop, printed);
        if (ready == 0) {
            gust_report_statistics(stdout, "status", &p->loop);
        }
    }
    atomic_store(&p->loop.stop, true);
    (void)pthread_join(p->thread, NULL);
    gust_watchdog_stop(&p->watchdog);
    (void)print_events(&p->loop, printed);
    gust_report_statistics(stdout, "end", &p->loop);
}

static void print_start(const program *p)
{
    const gust_bridge *bridge = &p->bridge;
    (void)printf("{\"event\": \"start\", \"interface\": \"%s\", \"clock\": \"%s\", \"controller\": \"%s\", "
                 "\"database\": \"%s\", \"fingerprint\": %" PRIu32 ", \"period_ns\": %" PRIu64
                 ", \"watchdog_ns\": %" PRIu64 ", \"fd\": %s, \"real_time\": %s, \"locked\": %s}\n",
                 p->options.interface, p->options.synchronous ? "sync" : "monotonic",
                 bridge->config.controller->name, bridge->config.messages->name,
                 bridge->config.messages->fingerprint, bridge->link.period, p->watchdog.timeout,
                 p->loop_socket.fd ? "true" : "false", p->real_time ? "true" : "false",
                 p->locked ? "true" : "false");
    (void)fflush(stdout);
}

static uint64_t watchdog_timeout(const program *p)
{
    const uint64_t period = p->bridge.link.period;
    const bool sync = p->options.synchronous;
    const uint64_t least = sync ? WATCHDOG_SYNC_LEAST : WATCHDOG_SHORTEST * period;
    const uint64_t usual = sync ? WATCHDOG_SYNC : WATCHDOG_PERIODS * period;
    const uint64_t asked = p->options.watchdog != 0 ? p->options.watchdog : usual;
    return asked > least ? asked : least;
}

static bool needs_fd(const gust_message_set *set)
{
    for (uint32_t k = 0; k < set->n_messages; ++k) {
        if ((set->messages[k].flags & GUST_FRAME_FD) != 0) {
            return true;
        }
    }
    return false;
}

static bool open_bus(program *p, gust_error *error)
{
    const char *interface = p->options.interface;
    if (!gust_socketcan_open(&p->loop_socket, interface, true, error) ||
        !gust_socketcan_open(&p->watchdog_socket, interface, false, error)) {
        return false;
    }
    if (needs_fd(&gust_messages) && !p->loop_socket.fd) {
        return gust_fail(
            error,
            "GF8063: interface '%s' carries no CAN FD, and the database %s needs it. Try: ip link set %s mtu 72",
            interface, gust_messages.name, interface);
    }
    return true;
}

static bool start(program *p, gust_error *error)
{
    const gust_bridge_config config = {
        .controller = &CONTROLLER_HERE,
        .messages = &gust_messages,
        .transport = &p->loop_socket.transport,
        .limits = p->options.limits,
        .rates = p->options.rates,
        .n_rates = p->options.n_rates,
        .synchronous = p->options.synchronous,
        .tune = p->options.tune,
        .age = p->options.synchronous ? 0 : (uint64_t)(CONTROLLER_HERE.period * 1e9)};
    if (!gust_bridge_init(&p->bridge, &config, error) || !open_bus(p, error) ||
        !gust_wakeup_open(&p->wakeup, error)) {
        return false;
    }
    p->locked = p->options.real_time && mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    p->loop.wake = p->wakeup.word;
    p->loop.bridge = &p->bridge;
    p->loop.transport = &p->loop_socket.transport;
    p->loop.watchdog = &p->watchdog;
    p->loop.patience = p->options.patience;
    if (!gust_watchdog_start(&p->watchdog, &p->bridge, &p->watchdog_socket.transport, watchdog_timeout(p),
                             p->options.real_time ? PRIORITY_WATCHDOG : 0, error)) {
        return false;
    }
    if (!gust_clock_thread(&p->thread, run_loop, &p->loop, p->options.real_time ? PRIORITY_LOOP : 0,
                           &p->real_time)) {
        gust_watchdog_stop(&p->watchdog);
        return gust_fail(error, "GF8062: no thread for the loop. Look at: ulimit -u");
    }
    return true;
}

static int run(program *p, int n, char **arguments)
{
    gust_error error;
    if (!gust_options_read(&p->options, n, arguments, &error)) {
        return fail(&error, EXIT_USAGE);
    }
    if (p->options.help) {
        (void)fputs(gust_usage, stdout);
        return EXIT_SUCCESS;
    }
    if (p->options.plant) {
#ifdef GUST_BRIDGE_PLANT
        return gust_plant_program(&p->options, &gust_messages);
#else
        (void)gust_fail(
            &error,
            "GF8056: this gust-bridge has no plant. Build it with -DGUST_BRIDGE_PLANT=ON and libgustform, "
            "or take: gustform hil plant");
        return fail(&error, EXIT_USAGE);
#endif
    }
    if (!start(p, &error)) {
        return fail(&error, EXIT_FAILURE);
    }
    print_start(p);
    watch(p);
    p->watchdog_socket.transport.close(&p->watchdog_socket.transport);
    p->loop_socket.transport.close(&p->loop_socket.transport);
    return EXIT_SUCCESS;
}

int main(int n, char **arguments)
{
    program *p = calloc(1, sizeof *p);
    if (p == NULL) {
        (void)fputs("gust-bridge: GF8062: no memory.\n", stderr);
        return EXIT_FAILURE;
    }
    const int code = run(p, n, arguments);
    free(p);
    return code;
}
