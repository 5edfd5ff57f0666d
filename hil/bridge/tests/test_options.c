/* The command line, and what the bridge reports. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gustform_bridge/options.h"
#include "gustform_bridge/report.h"
#include "stand.h"

static gust_options o;
static gust_error e;

/* Arguments separated by spaces. */
static bool read(const char *line)
{
    static char text[512];
    char *arguments[32] = {"gust-bridge"};
    int n = 1;
    (void)strncpy(text, line, sizeof text - 1U);
    char *rest = NULL;
    for (char *word = strtok_r(text, " ", &rest); word != NULL; word = strtok_r(NULL, " ", &rest)) {
        arguments[n++] = word;
    }
    e.text[0] = '\0';
    return gust_options_read(&o, n, arguments, &e);
}

static void defaults(void **unused)
{
    (void)unused;
    assert_true(read("--interface vcan0"));
    assert_string_equal(o.interface, "vcan0");
    assert_false(o.synchronous || o.plant || o.status || o.tune || o.help);
    assert_true(o.real_time);
    assert_int_equal(o.limits.missing, 2);
    assert_int_equal(o.limits.heartbeat, 0); /* three cycles of the database */
    assert_int_equal(o.patience, 1000000000);
    assert_int_equal(o.n_rates, gust_n_default_rates);
}

static void all(void **unused)
{
    (void)unused;
    assert_true(
        read("--clock sync --role plant --interface can1 --status --tune --no-real-time --watchdog 2.5 "
             "--patience 30 --missing 3 --deadlines 4 --quiet 5 --heartbeat 6 --set-points 7 --rate v_dc=inf "
             "--model m.gust"));
    assert_true(o.synchronous && o.plant && o.status && o.tune && !o.real_time);
    assert_int_equal(o.watchdog, 2500000);
    assert_int_equal(o.patience, 30000000);
    assert_int_equal(o.limits.missing, 3);
    assert_int_equal(o.limits.deadlines, 4);
    assert_int_equal(o.limits.quiet, 5);
    assert_int_equal(o.limits.heartbeat, 6);
    assert_int_equal(o.limits.set_points, 7);
    assert_int_equal(o.n_rates, gust_n_default_rates + 1U);
    assert_string_equal(o.rates[gust_n_default_rates].quantity, "v_dc"); /* the last one of a quantity counts */
    assert_true(isinf(o.rates[gust_n_default_rates].rate));
    assert_string_equal(o.model, "m.gust");
    assert_true(read("--help"));
    assert_true(o.help);
}

static void wrong(void **unused)
{
    (void)unused;
    static const char *const LINES[] = {"",
                                        "--interface",
                                        "vcan0",
                                        "--interface vcan0 --no-such 1",
                                        "--interface vcan0 --clock wall",
                                        "--interface vcan0 --role both",
                                        "--interface vcan0 --missing -1",
                                        "--interface vcan0 --missing 1.5",
                                        "--interface vcan0 --missing 2x",
                                        "--interface vcan0 --missing nan",
                                        "--interface vcan0 --watchdog 0",
                                        "--interface vcan0 --watchdog inf",
                                        "--interface vcan0 --patience 1e99",
                                        "--interface vcan0 --rate v_dc",
                                        "--interface vcan0 --rate =5",
                                        "--interface vcan0 --rate v_dc=",
                                        "--interface vcan0 --rate v_dc=-1"};
    for (size_t k = 0; k < sizeof LINES / sizeof LINES[0]; ++k) {
        if (read(LINES[k])) {
            fail_msg("accepted: %s", LINES[k]);
        }
        assert_int_equal(strncmp(e.text, "GF8055: ", 8), 0);
    }
    char many[1024] = "--interface vcan0";
    for (int k = 0; k < 4; ++k) {
        (void)strcat(many, " --rate v_dc=1");
    }
    assert_true(read(many)); /* and no more than there is room for: */
    o.n_rates = 0;
}

static char written[4096];

static const char *capture(void (*write)(FILE *file))
{
    FILE *file = fmemopen(written, sizeof written, "w");
    assert_non_null(file);
    write(file);
    (void)fclose(file);
    return written;
}

static void write_event(FILE *file)
{
    const gust_event event = {.time = 5678,
                              .state = GUST_STATE_SAFE,
                              .faults = (uint32_t)GUST_FAULT_TIMEOUT | (uint32_t)GUST_FAULT_HEARTBEAT,
                              .sample = 1234};
    gust_report_event(file, &event);
}

static stand s;
static gust_loop loop;

static void write_statistics(FILE *file)
{
    gust_report_statistics(file, "end", &loop);
}

static void reports(void **unused)
{
    (void)unused;
    assert_string_equal(capture(write_event),
                        "{\"event\": \"state\", \"state\": \"SAFE\", \"faults\": [\"TIMEOUT\", \"HEARTBEAT\"], "
                        "\"sample\": 1234, \"time_ns\": 5678}\n");
    stand_begin(&s, &test_database, true);
    stand_run(&s);
    loop.bridge = &s.bridge;
    for (int k = 0; k < 99; ++k) {
        gust_times_add(&loop.response, 7999);
    }
    gust_times_add(&loop.response, 99000000); /* longer than there are buckets */
    assert_int_equal(gust_times_quantile(&loop.response, 0.5), 7);
    assert_int_equal(gust_times_quantile(&loop.response, 0.99), 7);
    assert_int_equal(gust_times_quantile(&loop.response, 1.0), GUST_TIMES_BUCKETS - 1U);
    capture(write_statistics);
    assert_non_null(strstr(written, "{\"event\": \"end\", \"state\": \"RUN\", \"faults\": [], \"sample\": "));
    assert_non_null(strstr(written, "\"response_us\": {\"median\": 7, \"p99\": 7, \"max\": 99000}"));
    assert_non_null(strstr(written, "\"bad_crc\": 0"));
    assert_non_null(strstr(written, "}}\n")); /* whole, not cut */
    assert_string_equal(gust_state_name((gust_state)9), "?");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(defaults), cmocka_unit_test(all),
                                       cmocka_unit_test(wrong), cmocka_unit_test(reports)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
