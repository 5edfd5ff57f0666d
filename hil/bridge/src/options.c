#include "gustform_bridge/options.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NS_PER_MS UINT64_C(1000000)
#define PATIENCE  (UINT64_C(1000) * NS_PER_MS)
#define LONGEST   3600000.0 /* ms, of a time on the command line */

const char gust_usage[] =
    "usage: gust-bridge --interface NAME [options]\n"
    "  --interface NAME      CAN interface, can0 or vcan0\n"
    "  --clock monotonic     periods by this computer's clock (default)\n"
    "  --clock sync          one period per Sync frame\n"
    "  --role controller     the controller is here, the converter on the bus (default)\n"
    "  --role plant          the converter is simulated here, the controller on the bus\n"
    "  --model FILE          model of the plant (.gust)\n"
    "  --status              a line of statistics each second\n"
    "  --tune                parameters may be written while running\n"
    "  --no-real-time        no SCHED_FIFO, no locked memory\n"
    "  --watchdog MS         limit of the watchdog: default 4 periods, at least 2; with --clock sync 1000, at least 100\n"
    "  --patience MS         --clock sync: longest wait for a Sync, default 1000\n"
    "  --missing N           periods in a row without a fresh sample that are tolerated, default 2\n"
    "  --deadlines N         periods that may be missed at a time, default 2\n"
    "  --quiet N             periods without a fault before INIT or SAFE may be left, default 20\n"
    "  --heartbeat N         periods without a heartbeat, default 3 cycles of the database\n"
    "  --set-points N        periods without set-points, default 0: for ever\n"
    "  --rate QUANTITY=RATE  largest change per second; default v_dc=500, omega_r=5; 'inf' allows any\n"
    "  --help                this text\n"
    "States and statistics are JSON lines. Ends on SIGTERM or SIGINT. Exit codes: 0 ended, 1 failed, 2 usage.\n";

static bool number(const char *name, const char *text, double low, double high, double *value,
                   gust_error *error)
{
    char *end = NULL;
    errno = 0;
    *value = strtod(text, &end);
    if (end == text || *end != '\0' || !(*value >= low && *value <= high)) {
        return gust_fail(error, "GF8055: %s is '%.32s', allowed: %g ... %g. See gust-bridge --help", name, text,
                         low, high);
    }
    return true;
}

static bool count(const char *name, const char *text, uint32_t *value, gust_error *error)
{
    double read = 0.0;
    if (!number(name, text, 0.0, 1e6, &read, error)) {
        return false;
    }
    if (read != floor(read)) {
        return gust_fail(error, "GF8055: %s is '%.32s', a whole number is needed. See gust-bridge --help", name,
                         text);
    }
    *value = (uint32_t)read;
    return true;
}

static bool duration(const char *name, const char *text, uint64_t *ns, gust_error *error)
{
    double ms = 0.0;
    if (!number(name, text, 1e-3, LONGEST, &ms, error)) {
        return false;
    }
    *ns = (uint64_t)(ms * (double)NS_PER_MS);
    return true;
}

static bool choice(const char *name, const char *text, const char *no, const char *yes, bool *chosen,
                   gust_error *error)
{
    *chosen = strcmp(text, yes) == 0;
    if (!*chosen && strcmp(text, no) != 0) {
        return gust_fail(error, "GF8055: %s is '%.32s', allowed: %s, %s. See gust-bridge --help", name, text,
                         no, yes);
    }
    return true;
}

static bool rate(gust_options *options, char *text, gust_error *error)
{
    char *equals = strchr(text, '=');
    if (equals == NULL || equals == text || options->n_rates >= GUST_RATES) {
        return gust_fail(
            error, "GF8055: --rate '%.32s' is not QUANTITY=RATE, or one too many. Try --rate v_dc=500", text);
    }
    *equals = '\0';
    gust_rate *added = &options->rates[options->n_rates];
    added->quantity = text;
    ++options->n_rates;
    return number("--rate", equals + 1, 0.0, (double)INFINITY, &added->rate, error);
}

/* An option with a value. */
static bool valued(gust_options *options, const char *name, char *text, gust_error *error)
{
    if (strcmp(name, "--interface") == 0) {
        options->interface = text;
        return true;
    }
    if (strcmp(name, "--model") == 0) {
        options->model = text;
        return true;
    }
    if (strcmp(name, "--clock") == 0) {
        return choice(name, text, "monotonic", "sync", &options->synchronous, error);
    }
    if (strcmp(name, "--role") == 0) {
        return choice(name, text, "controller", "plant", &options->plant, error);
    }
    if (strcmp(name, "--watchdog") == 0) {
        return duration(name, text, &options->watchdog, error);
    }
    if (strcmp(name, "--patience") == 0) {
        return duration(name, text, &options->patience, error);
    }
    if (strcmp(name, "--missing") == 0) {
        return count(name, text, &options->limits.missing, error);
    }
    if (strcmp(name, "--deadlines") == 0) {
        return count(name, text, &options->limits.deadlines, error);
    }
    if (strcmp(name, "--quiet") == 0) {
        return count(name, text, &options->limits.quiet, error);
    }
    if (strcmp(name, "--heartbeat") == 0) {
        return count(name, text, &options->limits.heartbeat, error);
    }
    if (strcmp(name, "--set-points") == 0) {
        return count(name, text, &options->limits.set_points, error);
    }
    if (strcmp(name, "--rate") == 0) {
        return rate(options, text, error);
    }
    return gust_fail(error, "GF8055: there is no option '%.32s'. See gust-bridge --help", name);
}

static bool flag(gust_options *options, const char *name)
{
    if (strcmp(name, "--status") == 0) {
        options->status = true;
    } else if (strcmp(name, "--tune") == 0) {
        options->tune = true;
    } else if (strcmp(name, "--no-real-time") == 0) {
        options->real_time = false;
    } else if (strcmp(name, "--help") == 0) {
        options->help = true;
    } else {
        return false;
    }
    return true;
}

bool gust_options_read(gust_options *options, int n, char **arguments, gust_error *error)
{
    memset(options, 0, sizeof *options);
    gust_limits_default(&options->limits);
    options->limits.heartbeat = 0; /* as the database says */
    options->real_time = true;
    options->patience = PATIENCE;
    for (uint32_t k = 0; k < gust_n_default_rates; ++k) {
        options->rates[options->n_rates++] = gust_default_rates[k];
    }
    for (int k = 1; k < n; ++k) {
        if (flag(options, arguments[k])) {
            continue;
        }
        if (k + 1 == n) {
            return gust_fail(error, "GF8055: '%.32s' is no option, or lacks its value. See gust-bridge --help",
                             arguments[k]);
        }
        if (!valued(options, arguments[k], arguments[k + 1], error)) {
            return false;
        }
        ++k;
    }
    if (options->interface == NULL && !options->help) {
        return gust_fail(error, "GF8055: --interface is missing. Try: gust-bridge --interface vcan0");
    }
    return true;
}
