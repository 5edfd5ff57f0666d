#include "gustform_bridge/plant_program.h"

#ifdef GUST_BRIDGE_PLANT

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "gustform_bridge/clock.h"
#include "gustform_bridge/plant.h"
#include "gustform_bridge/plant_model.h"
#include "gustform_bridge/report.h"
#include "gustform_bridge/socketcan.h"
#include "gustform_bridge/times.h"
#include "gustform_bridge/wakeup.h"

#define NS_PER_S 1e9
#define TEXT     256

typedef struct plant_run {
    const gust_options *options;
    const gust_message_set *messages;
    gust_socketcan socket;
    gust_plant plant;
    gust_plant_model model;
    char text[TEXT];     /* why the model failed */
    gust_times response; /* from Sync to the complete references */
    uint64_t deadline;   /* of the sample, ns; 0: before the first */
    uint64_t latest, missed;
    atomic_bool stop;
    bool failed;
    gust_wakeup wakeup;
    pthread_t thread;
} plant_run;

static void report_state(const plant_run *r)
{
    static const char *const NAMES[] = {"OFF", "READY", "RUNNING", "TRIPPED"};
    (void)printf("{\"event\": \"converter\", \"state\": \"%s\", \"controller\": \"%s\", \"sample\": %u, "
                 "\"time_ns\": %llu}\n",
                 NAMES[r->plant.state % 4U], gust_state_name((gust_state)r->plant.controller), r->plant.number,
                 (unsigned long long)gust_clock_now());
    (void)fflush(stdout);
}

/* What has come in; true: the answer to this sample is among it, at `*at`. */
static bool listen(plant_run *r, uint64_t *at)
{
    gust_transport *transport = &r->socket.transport;
    gust_frame frame;
    bool answered = false;
    while (transport->receive(transport, &frame) == GUST_TRANSPORT_OK) {
        if (gust_plant_receive(&r->plant, &frame)) {
            *at = frame.time;
            answered = true;
        }
    }
    return answered;
}

/* Until the sample is due; what was missed is counted and not caught up. */
static void wait_for_sample(plant_run *r)
{
    const uint64_t period = r->plant.config.period;
    if (r->options->synchronous) {
        return;
    }
    if (r->deadline == 0) {
        r->deadline = gust_clock_now();
    }
    gust_clock_sleep(r->deadline);
    const uint64_t late = gust_clock_now() - r->deadline;
    r->latest = late > r->latest ? late : r->latest;
    r->missed += late / period;
    r->deadline += (late / period) * period;
}

static void wait_for_answer(plant_run *r)
{
    gust_transport *transport = &r->socket.transport;
    const uint64_t sent = gust_clock_now();
    const uint64_t limit =
        r->options->synchronous ? sent + r->options->patience : r->deadline + r->plant.config.period;
    uint64_t at = 0;
    while (!listen(r, &at)) {
        if (gust_clock_now() >= limit || transport->wait(transport, limit) != GUST_TRANSPORT_OK) {
            return;
        }
    }
    gust_times_add(&r->response, at > sent ? at - sent : 0);
}

/* One sample of the model: the bus in place of its controller. */
static int step(void *context, double time, const double *measurements, double *commands)
{
    plant_run *r = context;
    const uint32_t state = r->plant.state;
    const uint32_t controller = r->plant.controller;
    uint64_t unused = 0;
    (void)time;
    if (atomic_load(&r->stop)) {
        return 1;
    }
    wait_for_sample(r);
    (void)listen(r, &unused);
    gust_plant_send(&r->plant, measurements);
    wait_for_answer(r);
    gust_plant_finish(&r->plant);
    r->deadline += r->plant.config.period;
    memcpy(commands, r->plant.command, r->plant.config.n_commands * sizeof *commands);
    if (r->plant.state != state || r->plant.controller != controller) {
        report_state(r);
    }
    return 0;
}

static bool open_model(plant_run *r, gust_error *error)
{
    const char *file = r->options->model;
    if (file == NULL) {
        return gust_fail(error, "GF8057: --role plant needs a model. Give one with: --model FILE.gust");
    }
    if (!gust_plant_model_open(&r->model, file, step, r, r->text, sizeof r->text)) {
        return gust_fail(
            error,
            "GF8057: the model %.64s is of no use: %.96s. Write: control: {type: DualPort, sampled: 1 ms}",
            file, r->text);
    }
    const gust_plant_config config = {.messages = r->messages,
                                      .transport = &r->socket.transport,
                                      .period = (uint64_t)(r->model.period * NS_PER_S + 0.5),
                                      .measurements = r->model.measurements,
                                      .n_measurements = r->model.n_measurements,
                                      .commands = r->model.commands,
                                      .n_commands = r->model.n_commands,
                                      .start = r->model.start,
                                      .missing = r->options->limits.missing};
    return gust_plant_init(&r->plant, &config, error);
}

static void *simulate(void *context)
{
    plant_run *r = context;
    const uint64_t one = 1;
    r->failed = !gust_plant_model_run(&r->model, r->text, sizeof r->text);
    if (write(r->wakeup.word, &one, sizeof one) < 0) {
        r->failed = true;
    }
    return NULL;
}

static void print_end(const plant_run *r)
{
    const gust_plant *p = &r->plant;
    (void)printf(
        "{\"event\": \"end\", \"role\": \"plant\", \"time\": %.6f, \"samples\": %llu, \"answers\": %llu, "
        "\"trips\": %llu, \"missed\": %llu, \"latest_ns\": %llu, \"response_us\": {\"median\": %u, \"p99\": %u, "
        "\"max\": %llu}, \"sent\": %llu, \"lost\": %llu, \"not_sent\": %llu}\n",
        gust_plant_model_time(&r->model), (unsigned long long)p->ticks, (unsigned long long)p->answers,
        (unsigned long long)p->trips, (unsigned long long)r->missed, (unsigned long long)r->latest,
        gust_times_quantile(&r->response, 0.5), gust_times_quantile(&r->response, 0.99),
        (unsigned long long)(r->response.longest / 1000U), (unsigned long long)p->link.counts.sent,
        (unsigned long long)p->link.counts.lost, (unsigned long long)p->link.counts.not_sent);
    (void)fflush(stdout);
}

static bool run(plant_run *r, gust_error *error)
{
    if (!open_model(r, error) || !gust_socketcan_open(&r->socket, r->options->interface, true, error) ||
        !gust_wakeup_open(&r->wakeup, error)) {
        return false;
    }
    const size_t stack = (size_t)8 * 1024 * 1024; /* the solver's, not a loop's */
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes) != 0 || pthread_attr_setstacksize(&attributes, stack) != 0 ||
        pthread_create(&r->thread, &attributes, simulate, r) != 0) {
        return gust_fail(error, "GF8062: no thread for the model. Look at: ulimit -u");
    }
    (void)pthread_attr_destroy(&attributes);
    struct pollfd descriptors[] = {{.fd = r->wakeup.signals, .events = POLLIN},
                                   {.fd = r->wakeup.word, .events = POLLIN}};
    while (poll(descriptors, 2, -1) < 0 && errno == EINTR) {
    }
    atomic_store(&r->stop, true);
    (void)pthread_join(r->thread, NULL);
    print_end(r);
    return true;
}

int gust_plant_program(const gust_options *options, const gust_message_set *messages)
{
    gust_error error = {.text = ""};
    plant_run *r = calloc(1, sizeof *r);
    if (r == NULL) {
        (void)fputs("gust-bridge: GF8062: no memory.\n", stderr);
        return EXIT_FAILURE;
    }
    r->options = options;
    r->messages = messages;
    bool good = run(r, &error);
    if (!good) {
        (void)fprintf(stderr, "gust-bridge: %s.\n", error.text);
    }
    if (r->failed) {
        (void)fprintf(stderr, "gust-bridge: GF8057: the simulation failed: %s.\n", r->text);
    }
    good = good && !r->failed;
    gust_plant_model_close(&r->model);
    if (r->socket.transport.close != NULL) {
        r->socket.transport.close(&r->socket.transport);
    }
    free(r);
    return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

#endif
