/* gust-run: runs a built model without Python; result rows as CSV, statistics on stderr. */
#define _POSIX_C_SOURCE 200809L

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "gustform/gust_sim.h"

enum { EXIT_RUN = 1, EXIT_USAGE = 2, EXIT_INTERRUPTED = 130, BLOCK_ROWS = 256 };

typedef struct arguments {
    const char *model;
    const char *out; /* NULL: standard output */
    double start;
    double until;
    double every;
    const char *checkpoint; /* file to write, NULL: none */
    double checkpoint_every;
    const char *resume; /* checkpoint to go on from, NULL: none */
    bool has_until;
    bool quiet;
} arguments;

typedef struct csv {
    FILE *file;
    int32_t n_channels;
} csv;

/* The simulation that an interrupt stops; set before the handler is installed. */
static gust_sim *running;

static void on_interrupt(int number)
{
    (void)number;
    gust_sim_request_stop(running);
}

static void print_usage(FILE *to)
{
    fputs(
        "usage: gust-run MODEL.gust --until SECONDS [--every SECONDS] [--start SECONDS] [--out FILE.csv]\n"
        "                [--checkpoint FILE --checkpoint-every SECONDS] [--resume FILE]\n"
        "                [--quiet] [--OPTION VALUE ...]\n"
        "Runs a built model and writes its channels as CSV, to standard output unless --out names a file.\n"
        "  --until   simulated time at which to stop, s\n"
        "  --every   interval of result rows, s (default: a thousandth of the run)\n"
        "  --start   simulated time at which to start, s (default 0)\n"
        "  --quiet   no statistics on standard error\n"
        "  --checkpoint FILE --checkpoint-every SECONDS\n"
        "            keep the state in FILE, replaced whenever so much simulated time has passed\n"
        "  --resume FILE\n"
        "            go on from such a file after a crash, with all other arguments as they were: rows in --out\n"
        "            that are newer are cut off, and the result is that of an uninterrupted run, bit for bit\n"
        "Options of the integrator:\n",
        to);
    for (int i = 0; gust_option_list(i) != NULL; ++i) {
        const gust_option_info *option = gust_option_list(i);
        fprintf(to, "  --%-22s %s (default %g)\n", option->name, option->sentence, option->initial);
    }
    fputs("Exit codes: 0 done, 1 model or run error, 2 usage, 130 interrupted (rows so far are written).\n",
          to);
}

static bool read_number(const char *name, const char *text, double *value)
{
    char *end = NULL;
    errno = 0;
    *value = text != NULL ? strtod(text, &end) : 0.0;
    if (text == NULL || end == text || *end != '\0' || errno == ERANGE || !isfinite(*value)) {
        fprintf(stderr, "gust-run: %s needs a number; got %s\n", name, text != NULL ? text : "nothing");
        return false;
    }
    return true;
}

static bool read_name(const char *name, const char *text, const char **value)
{
    *value = text;
    if (text == NULL) {
        fprintf(stderr, "gust-run: %s needs a file name\n", name);
    }
    return text != NULL;
}

/* The arguments that are not options of the integrator; those follow in apply_options. */
static bool read_arguments(int argc, char **argv, arguments *given)
{
    for (int i = 1; i < argc; ++i) {
        const char *name = argv[i];
        const char *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (strncmp(name, "--", 2) != 0) {
            if (given->model != NULL) {
                fprintf(stderr, "gust-run: one model at a time; got %s and %s\n", given->model, name);
                return false;
            }
            given->model = name;
            continue;
        }
        if (strcmp(name, "--quiet") == 0) {
            given->quiet = true;
            continue;
        }
        ++i;
        bool good = true;
        double ignored = 0.0;
        if (strcmp(name, "--until") == 0) {
            good = read_number(name, value, &given->until);
            given->has_until = true;
        } else if (strcmp(name, "--every") == 0) {
            good = read_number(name, value, &given->every);
            if (good && !(given->every > 0.0)) {
                fprintf(stderr, "gust-run: --every must be greater than 0 s; got %s\n", value);
                good = false;
            }
        } else if (strcmp(name, "--start") == 0) {
            good = read_number(name, value, &given->start);
        } else if (strcmp(name, "--checkpoint-every") == 0) {
            good = read_number(name, value, &given->checkpoint_every);
            if (good && !(given->checkpoint_every > 0.0)) {
                fprintf(stderr, "gust-run: --checkpoint-every must be greater than 0 s; got %s\n", value);
                good = false;
            }
        } else if (strcmp(name, "--out") == 0) {
            good = read_name(name, value, &given->out);
        } else if (strcmp(name, "--checkpoint") == 0) {
            good = read_name(name, value, &given->checkpoint);
        } else if (strcmp(name, "--resume") == 0) {
            good = read_name(name, value, &given->resume);
        } else {
            good = read_number(name, value, &ignored);
        }
        if (!good) {
            return false;
        }
    }
    if (given->model == NULL || !given->has_until) {
        fputs("gust-run: a model file and --until are needed\n", stderr);
        return false;
    }
    if ((given->checkpoint != NULL) != (given->checkpoint_every > 0.0)) {
        fputs("gust-run: --checkpoint and --checkpoint-every need each other\n", stderr);
        return false;
    }
    if (!(given->until > given->start)) {
        fprintf(stderr, "gust-run: --until (%g s) must be after --start (%g s)\n", given->until, given->start);
        return false;
    }
    return true;
}

static bool is_own(const char *name)
{
    static const char *const OWN[] = {
        "--until", "--every", "--start", "--out", "--checkpoint", "--checkpoint-every", "--resume"};
    for (size_t k = 0; k < sizeof OWN / sizeof OWN[0]; ++k) {
        if (strcmp(name, OWN[k]) == 0) {
            return true;
        }
    }
    return false;
}

static bool apply_options(int argc, char **argv, gust_sim *sim)
{
    for (int i = 1; i < argc; ++i) {
        if (strncmp(argv[i], "--", 2) != 0 || strcmp(argv[i], "--quiet") == 0) {
            continue;
        }
        const char *name = argv[i++];
        double value = 0.0;
        if (is_own(name)) {
            continue;
        }
        if (!read_number(name, argv[i], &value) || gust_sim_set_option(sim, name + 2, value) != GUST_OK) {
            fprintf(stderr, "gust-run: %s\n", gust_sim_message(sim));
            return false;
        }
    }
    return true;
}

/* A field in double quotes, with quotes inside it doubled. */
static void write_quoted(FILE *file, const char *name, const char *unit)
{
    fputc('"', file);
    for (const char *c = name; *c != '\0'; ++c) {
        if (*c == '"') {
            fputc('"', file);
        }
        fputc(*c, file);
    }
    fprintf(file, " [%s]\"", unit);
}

static int write_rows(void *context, int64_t rows, const double *time, const float *values)
{
    csv *to = context;
    for (int64_t r = 0; r < rows; ++r) {
        fprintf(to->file, "%.9g", time[r]);
        for (int32_t k = 0; k < to->n_channels; ++k) {
            fprintf(to->file, ",%.7g", (double)values[r * to->n_channels + k]);
        }
        fputc('\n', to->file);
    }
    return fflush(to->file) == 0 && !ferror(to->file) ? 0 : -1;
}

static void print_statistics(const gust_sim *sim, double seconds)
{
    gust_statistics s;
    gust_sim_statistics(sim, &s);
    fprintf(
        stderr,
        "reached t = %.9g s in %.3f s: %lld steps, %lld residuals, %lld Jacobians, %lld + %lld factorisations, "
        "%lld error test failures, %lld convergence failures, %lld events, %lld restarts, %lld rows\n",
        gust_sim_time(sim), seconds, (long long)s.steps, (long long)s.residual_evaluations,
        (long long)s.jacobian_evaluations, (long long)s.factorisations, (long long)s.refactorisations,
        (long long)s.error_test_failures, (long long)s.nonlinear_failures, (long long)s.events,
        (long long)s.restarts, (long long)s.rows);
}

/* Sampled controllers that raised their error signal. */
static void print_errors(const gust_model *model, gust_sim *sim)
{
    for (int32_t k = 0; k < gust_model_n_sampled(model); ++k) {
        gust_sampled_statistics s;
        if (gust_sim_sampled_statistics(sim, k, &s) == GUST_OK && s.bad_samples > 0) {
            fprintf(
                stderr,
                "the sampled controller of %s raised its error signal in %lld of %lld samples, first at %.9g s\n",
                gust_model_sampled_block(model, k)->name, (long long)s.bad_samples, (long long)s.samples,
                s.first_error);
        }
    }
}

static double seconds_between(const struct timespec *from, const struct timespec *to)
{
    return (double)(to->tv_sec - from->tv_sec) + 1e-9 * (double)(to->tv_nsec - from->tv_nsec);
}

static void write_header(const gust_model *model, csv *to)
{
    fputs("\"time [s]\"", to->file);
    for (int32_t k = 0; k < to->n_channels; ++k) {
        fputc(',', to->file);
        write_quoted(to->file, gust_model_channel_name(model, k), gust_model_channel_unit(model, k));
    }
    fputc('\n', to->file);
}

/* Cuts the file behind its header and so many rows, where the run goes on. */
static bool cut_behind(FILE *file, int64_t rows)
{
    int64_t lines = 0;
    for (int c = 0; lines <= rows && c != EOF;) {
        c = fgetc(file);
        lines += c == '\n' ? 1 : 0;
    }
    if (lines <= rows) {
        fprintf(stderr, "gust-run: the file of rows ends after %lld lines, before the checkpoint: start anew\n",
                (long long)lines);
        return false;
    }
    const long end = ftell(file);
    if (end < 0 || fflush(file) != 0 || ftruncate(fileno(file), end) != 0 || fseek(file, end, SEEK_SET) != 0) {
        fprintf(stderr, "gust-run: the file of rows cannot be cut: %s\n", strerror(errno));
        return false;
    }
    return true;
}

/* To the state of the checkpoint, and the file of rows to where it was then. */
static bool resume(const arguments *given, gust_sim *sim, csv *to)
{
    const gust_status status = gust_sim_restore(sim, given->resume);
    if (status != GUST_OK) {
        fprintf(stderr, "gust-run: %s: %s\n", gust_status_name(status), gust_sim_message(sim));
        return false;
    }
    gust_statistics statistics;
    gust_sim_statistics(sim, &statistics);
    return given->out == NULL || cut_behind(to->file, statistics.rows);
}

/* Advances to the end, from checkpoint to checkpoint. What has been written reaches the disk before the
 * checkpoint that follows it. */
static gust_status advance(const arguments *given, gust_sim *sim, const csv *to)
{
    if (given->checkpoint == NULL) {
        return gust_sim_advance(sim, given->until, NULL);
    }
    const double every = given->checkpoint_every;
    double number = floor((gust_sim_time(sim) - given->start) / every + 0.5);
    for (;;) {
        number += 1.0;
        const double next = given->start + number * every;
        gust_status status = gust_sim_advance(sim, fmin(next, given->until), NULL);
        if (status != GUST_OK || next >= given->until) {
            return status;
        }
        /* Pipes and terminals cannot be synchronised, and need not be. */
        if (fflush(to->file) != 0 || (fsync(fileno(to->file)) != 0 && errno != EINVAL && errno != EROFS)) {
            return GUST_SINK_FAILED;
        }
        status = gust_sim_checkpoint(sim, given->checkpoint);
        if (status != GUST_OK) {
            return status;
        }
    }
}

static int run(const arguments *given, const gust_model *model, gust_sim *sim, csv *to)
{
    if (given->resume == NULL) {
        write_header(model, to);
    }
    const double every = given->every > 0.0 ? given->every : (given->until - given->start) / 1000.0;
    gust_status status = gust_sim_set_sink(sim, every, BLOCK_ROWS, write_rows, to);
    struct timespec begin;
    struct timespec end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    if (status == GUST_OK) {
        status = gust_sim_initialise(sim, given->start);
    }
    if (status == GUST_OK && given->resume != NULL && !resume(given, sim, to)) {
        return EXIT_RUN;
    }
    running = sim;
    struct sigaction action = {.sa_handler = on_interrupt};
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    if (status == GUST_OK) {
        status = advance(given, sim, to);
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    if (!given->quiet) {
        print_statistics(sim, seconds_between(&begin, &end));
        print_errors(model, sim);
    }
    if (status == GUST_OK) {
        return EXIT_SUCCESS;
    }
    const char *message = gust_sim_message(sim);
    fprintf(stderr, "gust-run: %s: %s\n", gust_status_name(status),
            message[0] != '\0' ? message : gust_status_text(status));
    return status == GUST_STOP_REQUESTED ? EXIT_INTERRUPTED : EXIT_RUN;
}

int main(int argc, char **argv)
{
    if (argc > 1 && (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0)) {
        print_usage(stdout);
        return EXIT_SUCCESS;
    }
    arguments given = {0};
    if (!read_arguments(argc, argv, &given)) {
        print_usage(stderr);
        return EXIT_USAGE;
    }
    char message[2048];
    gust_model *model = NULL;
    if (gust_model_load(given.model, &model, message, sizeof message) != GUST_OK) {
        fprintf(stderr, "gust-run: %s: %s\n", given.model, message);
        return EXIT_RUN;
    }
    int code = EXIT_RUN;
    gust_sim *sim = NULL;
    csv to = {stdout, gust_model_n_channels(model)};
    if (gust_sim_create(model, &sim) != GUST_OK) {
        fputs("gust-run: out of memory\n", stderr);
    } else if (!apply_options(argc, argv, sim)) {
        code = EXIT_USAGE;
    } else {
        const char *mode = given.resume != NULL ? "r+" : "w";
        to.file = given.out != NULL ? fopen(given.out, mode) : stdout;
        if (to.file == NULL) {
            fprintf(stderr, "gust-run: %s cannot be written: %s\n", given.out, strerror(errno));
        } else {
            code = run(&given, model, sim, &to);
        }
    }
    if (given.out != NULL && to.file != NULL && to.file != stdout && fclose(to.file) != 0) {
        fprintf(stderr, "gust-run: %s could not be written: %s\n", given.out, strerror(errno));
        code = EXIT_RUN;
    }
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
    return code;
}
