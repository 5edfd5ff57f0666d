/* gust-soak: many protected frames through one bus, and what became of them.
 *
 * A child process sends the measurements of the message set, each frame with the next sample number and
 * counter; this process receives, checks and decodes them with the layer that the bridge uses. A socket's
 * buffer is finite, and vcan, unlike a bus, takes frames faster than anyone reads them: so a window of frames
 * may be on their way, and the receiver tells beside the bus when half of it has come in. One line of JSON on
 * stdout. Exit: 0 all arrived in order and unharmed, 1 some did not, 2 usage or no bus.
 */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "gustform_bridge/messages.h"
#include "gustform_bridge/socketcan.h"
#include "gustform_bridge/transport.h"

enum { WINDOW = 128, WARM = 2000, EXIT_USAGE = 2, PATIENCE_MS = 2000 };
static const uint64_t PATIENCE = PATIENCE_MS * UINT64_C(1000000); /* without a frame: the rest is lost */

typedef struct stream {
    const gust_message *data; /* what is sent */
    int sample;               /* number of the signal that counts */
    uint64_t samples;         /* how many numbers it has */
} stream;

/* What one side counts. */
typedef struct tally {
    uint64_t frames, lost, out_of_order, damaged;
    long memory_start, memory_end; /* kB */
    double seconds;
} tally;

/* Frames after which memory is looked at for the first time: whatever is touched only once has been touched. */
static uint64_t warm(uint64_t frames)
{
    return frames / 10U < WARM ? frames / 10U : WARM;
}

/* Resident memory: the second number of statm, in pages. */
static long memory_kb(void)
{
    char line[128];
    FILE *const file = fopen("/proc/self/statm", "re");
    if (file == NULL) {
        return 0;
    }
    const char *const read = fgets(line, sizeof line, file);
    (void)fclose(file);
    const char *const second = read == NULL ? NULL : strchr(line, ' ');
    const long resident = second == NULL ? 0 : strtol(second, NULL, 10);
    return resident * (sysconf(_SC_PAGESIZE) / 1024);
}

static bool stream_of(const gust_message_set *set, stream *what)
{
    what->data = gust_message_find(set, GUST_PART_MEASUREMENTS, 0);
    if (what->data == NULL) {
        return false;
    }
    what->sample = gust_message_signal(what->data, GUST_FIELD_SAMPLE, NULL);
    if (what->sample < 0) {
        return false;
    }
    what->samples = (uint64_t)what->data->signals[what->sample].high + 1U;
    return true;
}

/* Values that walk through the range of each signal, so that no two neighbouring frames are alike. */
static void fill(const stream *what, uint64_t number, double values[GUST_MESSAGE_SIGNALS])
{
    for (int k = 0; k < what->data->n_signals; k++) {
        const gust_signal *const signal = &what->data->signals[k];
        const double share = (double)((number * 37U + (uint64_t)k * 11U) % 101U) / 100.0;
        values[k] = signal->low + share * (signal->high - signal->low);
    }
    values[what->sample] = (double)(number % what->samples);
}

/* Until the receiver opens the window again; false: it does not. */
static bool await_credit(int credits)
{
    struct pollfd end = {.fd = credits, .events = POLLIN};
    char credit = 0;
    return poll(&end, 1, PATIENCE_MS) == 1 && read(credits, &credit, 1) == 1;
}

static tally send_all(gust_transport *bus, const stream *what, uint64_t frames, int credits)
{
    tally result = {0};
    double values[GUST_MESSAGE_SIGNALS];
    gust_frame frame;
    uint64_t open = WINDOW;
    for (uint64_t n = 0; n < frames; n++) {
        if (n == warm(frames)) {
            result.memory_start = memory_kb();
        }
        if (open == 0) {
            if (!await_credit(credits)) {
                break;
            }
            open = WINDOW / 2;
        }
        fill(what, n, values);
        (void)gust_message_encode(what->data, values, (uint8_t)(n % 256U), &frame);
        if (bus->send(bus, &frame) != GUST_TRANSPORT_OK) {
            break;
        }
        result.frames++;
        open--;
    }
    result.memory_end = memory_kb();
    return result;
}

/* What has come in, against what must come next. */
static void judge(const stream *what, const gust_frame *frame, uint64_t *next, uint8_t *counter, tally *result)
{
    double expected[GUST_MESSAGE_SIGNALS];
    double values[GUST_MESSAGE_SIGNALS];
    const gust_message *message = NULL;
    uint8_t received = 0;
    const gust_decoded decoded = gust_message_decode(&gust_messages, frame, &message, values, &received);
    if (decoded != GUST_DECODED) {
        result->damaged++;
        (*next)++;
        return;
    }
    const uint64_t sample = (uint64_t)values[what->sample];
    const uint64_t ahead = (sample + what->samples - *next % what->samples) % what->samples;
    if (ahead > what->samples / 2U) { /* older than the newest */
        result->out_of_order++;
        return;
    }
    result->lost += ahead;
    if (ahead == 0 && *next > 0 && gust_message_ahead(what->data, *counter, received) != 1U) {
        result->out_of_order++;
    }
    fill(what, *next + ahead, expected);
    for (int k = 0; k < message->n_signals; k++) {
        const gust_signal *const signal = &message->signals[k];
        /* A scaled signal of 16 bits is off by half of its resolution, float32 by far less. */
        if (signal->field == GUST_FIELD_QUANTITY &&
            fabs(values[k] - expected[k]) > (signal->high - signal->low) / 65000.0) {
            result->damaged++;
            break;
        }
    }
    *counter = received;
    *next += ahead + 1U;
}

static tally receive_all(gust_transport *bus, const stream *what, uint64_t frames, int credits)
{
    tally result = {0};
    gust_frame frame;
    uint64_t next = 0;
    uint64_t begin = 0;
    uint8_t counter = 0;
    while (next < frames) {
        if (bus->receive(bus, &frame) != GUST_TRANSPORT_OK) {
            const uint64_t deadline = bus->now(bus) + PATIENCE;
            if (bus->wait(bus, deadline) == GUST_TRANSPORT_EMPTY && bus->now(bus) >= deadline) {
                break;
            }
            continue;
        }
        if (frame.id != what->data->id || (frame.flags & (GUST_FRAME_OWN | GUST_FRAME_ERROR)) != 0) {
            continue;
        }
        begin = begin == 0 ? bus->now(bus) : begin;
        judge(what, &frame, &next, &counter, &result);
        if (result.frames++ == warm(frames)) {
            result.memory_start = memory_kb();
        }
        if (result.frames % (WINDOW / 2) == 0) {
            (void)send(credits, "", 1, MSG_NOSIGNAL); /* a sender that has sent all may have ended */
        }
    }
    result.lost += frames - next;
    result.seconds = begin == 0 ? 0.0 : (double)(bus->now(bus) - begin) * 1e-9;
    result.memory_end = memory_kb();
    return result;
}

/* The child: sends, tells what it sent, and ends. */
static int sender(const char *interface, const stream *what, uint64_t frames, int line)
{
    gust_socketcan socketcan;
    gust_error error;
    if (!gust_socketcan_open(&socketcan, interface, false, &error)) {
        return EXIT_USAGE;
    }
    const tally sent = send_all(&socketcan.transport, what, frames, line);
    socketcan.transport.close(&socketcan.transport);
    return write(line, &sent, sizeof sent) == (ssize_t)sizeof sent ? EXIT_SUCCESS : EXIT_FAILURE;
}

/* This process: receives, and hears from the child what was sent. */
static tally receiver(gust_transport *bus, const stream *what, uint64_t frames, int line, tally *sent)
{
    const tally received = receive_all(bus, what, frames, line);
    if (read(line, sent, sizeof *sent) != (ssize_t)sizeof *sent) {
        (void)fprintf(stderr, "gust-soak: the sender did not come to its end\n");
    }
    return received;
}

static int soak(const char *interface, uint64_t frames)
{
    stream what;
    int ends[2];
    if (!stream_of(&gust_messages, &what)) {
        (void)fprintf(stderr, "gust-soak: the database has no measurements with a sample number\n");
        return EXIT_USAGE;
    }
    gust_socketcan socketcan;
    gust_error error;
    if (!gust_socketcan_open(&socketcan, interface, true, &error)) {
        (void)fprintf(stderr, "gust-soak: %s\n", error.text);
        return EXIT_USAGE;
    }
    gust_transport *const bus = &socketcan.transport;
    tally sent = {0};
    tally received = {0};
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends) != 0) {
        bus->close(bus);
        return EXIT_FAILURE;
    }
    const pid_t child = fork();
    if (child == 0) {
        bus->close(bus); /* the receiver's; the sender has one of its own */
        (void)close(ends[0]);
        _exit(sender(interface, &what, frames, ends[1]));
    }
    (void)close(ends[1]);
    if (child > 0) {
        received = receiver(bus, &what, frames, ends[0], &sent);
        (void)waitpid(child, NULL, 0);
    }
    (void)close(ends[0]);
    bus->close(bus);
    (void)printf("{\"sent\": %" PRIu64 ", \"received\": %" PRIu64 ", \"lost\": %" PRIu64
                 ", \"out_of_order\": %" PRIu64 ", \"damaged\": %" PRIu64
                 ", \"memory_kb_start\": %ld, \"memory_kb_end\": %ld, \"seconds\": %.3f, "
                 "\"frames_per_second\": %.0f, \"bytes\": %d, \"e2e_profile\": %d}\n",
                 sent.frames, received.frames, received.lost, received.out_of_order, received.damaged,
                 sent.memory_start + received.memory_start, sent.memory_end + received.memory_end,
                 received.seconds, received.seconds > 0.0 ? (double)received.frames / received.seconds : 0.0,
                 (int)what.data->length, (int)what.data->e2e.profile);
    const bool good = sent.frames == frames && received.frames == frames && received.lost == 0 &&
                      received.out_of_order == 0 && received.damaged == 0;
    return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

int main(int argc, char **argv)
{
    const char *interface = NULL;
    uint64_t frames = 1000000U;
    for (int k = 1; k < argc; k += 2) {
        char *end = NULL;
        if (k + 1 < argc && strcmp(argv[k], "--interface") == 0) {
            interface = argv[k + 1];
        } else if (k + 1 < argc && strcmp(argv[k], "--frames") == 0) {
            frames = strtoull(argv[k + 1], &end, 10);
            if (*end != '\0' || argv[k + 1][0] == '-' || frames == 0 || frames > 1000000000U) {
                (void)fprintf(stderr, "gust-soak: --frames must be 1 to 10^9\n");
                return EXIT_USAGE;
            }
        } else {
            interface = NULL;
            break;
        }
    }
    if (interface == NULL) {
        (void)fprintf(stderr, "usage: gust-soak --interface vcan0 [--frames N]\n");
        return EXIT_USAGE;
    }
    return soak(interface, frames);
}
