#include "gustform_bridge/report.h"

#include <inttypes.h>
#include <stdarg.h>

#include "gustform_bridge/clock.h"

#define SHARE_MEDIAN 0.5
#define SHARE_P99    0.99
#define NS_PER_US    UINT64_C(1000)

typedef struct line {
    char text[GUST_REPORT];
    size_t length;
} line;

__attribute__((format(printf, 2, 3))) static void add(line *l, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int n = vsnprintf(l->text + l->length, sizeof l->text - l->length, format, arguments);
    va_end(arguments);
    const size_t room = sizeof l->text - l->length - 1U;
    l->length += n < 0 ? 0 : ((size_t)n < room ? (size_t)n : room);
}

const char *gust_state_name(gust_state state)
{
    static const char *const NAMES[] = {"INIT", "READY", "RUN", "SAFE"};
    return (unsigned)state < sizeof NAMES / sizeof NAMES[0] ? NAMES[state] : "?";
}

static void add_state(line *l, const char *event, gust_state state, uint32_t faults)
{
    static const struct {
        uint32_t bit;
        const char *name;
    } FAULTS[] = {
#define FAULT(number, identifier, sentence) {UINT32_C(1) << number##U, #identifier},
        GUST_FAULT_LIST(FAULT)
#undef FAULT
    };
    add(l, "{\"event\": \"%s\", \"state\": \"%s\", \"faults\": [", event, gust_state_name(state));
    const char *comma = "";
    for (size_t k = 0; k < sizeof FAULTS / sizeof FAULTS[0]; ++k) {
        if ((faults & FAULTS[k].bit) != 0) {
            add(l, "%s\"%s\"", comma, FAULTS[k].name);
            comma = ", ";
        }
    }
    add(l, "]");
}

static void finish(line *l, FILE *file)
{
    add(l, "}");
    (void)fprintf(file, "%s\n", l->text);
    (void)fflush(file);
}

void gust_report_event(FILE *file, const gust_event *event)
{
    line l = {.length = 0};
    add_state(&l, "state", event->state, event->faults);
    add(&l, ", \"sample\": %" PRIu32 ", \"time_ns\": %" PRIu64, event->sample, event->time);
    finish(&l, file);
}

static void add_counts(line *l, const gust_counts *counts)
{
    const struct {
        const char *name;
        uint64_t value;
    } entries[] = {{"received", counts->received},
                   {"sent", counts->sent},
                   {"echoed", counts->echoed},
                   {"unknown", counts->unknown},
                   {"wrong_length", counts->wrong_length},
                   {"bad_crc", counts->bad_crc},
                   {"unknown_multiplexer", counts->unknown_multiplexer},
                   {"not_finite", counts->not_finite},
                   {"out_of_range", counts->out_of_range},
                   {"repeated", counts->repeated},
                   {"lost", counts->lost},
                   {"not_sent", counts->not_sent},
                   {"cut", counts->cut},
                   {"error_frames", counts->errors}};
    add(l, ", \"frames\": {");
    for (size_t k = 0; k < sizeof entries / sizeof entries[0]; ++k) {
        add(l, "%s\"%s\": %" PRIu64, k > 0 ? ", " : "", entries[k].name, entries[k].value);
    }
    add(l, "}");
}

static void add_times(line *l, const char *name, const gust_times *times)
{
    add(l, ", \"%s_us\": {\"median\": %" PRIu32 ", \"p99\": %" PRIu32 ", \"max\": %" PRIu64 "}", name,
        gust_times_quantile(times, SHARE_MEDIAN), gust_times_quantile(times, SHARE_P99),
        times->longest / NS_PER_US);
}

void gust_report_statistics(FILE *file, const char *event, const gust_loop *loop)
{
    const gust_bridge *bridge = loop->bridge;
    line l = {.length = 0};
    add_state(&l, event, bridge->supervision.state, bridge->supervision.faults);
    add(&l, ", \"sample\": %" PRIu32 ", \"time_ns\": %" PRIu64, atomic_load(&bridge->sample), gust_clock_now());
    add(&l, ", \"periods\": %" PRIu64 ", \"missed\": %" PRIu64 ", \"latest_ns\": %" PRIu64, loop->periods,
        loop->missed, loop->latest);
    add(&l, ", \"steps\": %" PRIu64 ", \"held\": %" PRIu64, bridge->steps, bridge->held);
    add_times(&l, "lateness", &loop->lateness);
    add_times(&l, "response", &loop->response);
    if (loop->watchdog != NULL) {
        add(&l, ", \"watchdog\": {\"fired\": %" PRIu64 ", \"sent\": %" PRIu64 "}",
            atomic_load(&loop->watchdog->fired), atomic_load(&loop->watchdog->sent));
    }
    add_counts(&l, &bridge->link.counts);
    finish(&l, file);
}
