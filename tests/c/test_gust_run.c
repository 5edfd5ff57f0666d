/* The program gust-run: exit codes, CSV, messages, and what an interrupt leaves behind. */
#define _POSIX_C_SOURCE 200809L

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "support.h"

static const char *const MODEL = GUSTFORM_TEST_KERNELS "/run.gust";
static const char *const CSV = GUSTFORM_TEST_KERNELS "/run.csv";
static const char *const WORDS = GUSTFORM_TEST_KERNELS "/run.txt";
static const char *const BUSY = GUSTFORM_TEST_KERNELS "/busy.gust";
static const char *const WHOLE = GUSTFORM_TEST_KERNELS "/whole.csv";
static const char *const SAVED = GUSTFORM_TEST_KERNELS "/run.gustck";

static int write_bytes(model_writer *writer, const char *path)
{
    size_t size = 0;
    unsigned char *bytes = writer_bytes(writer, &size);
    writer_clear(writer);
    FILE *file = fopen(path, "wb");
    const int failed = file == NULL || fwrite(bytes, 1, size, file) != size || fclose(file) != 0;
    free(bytes);
    return failed;
}

/* A circuit on an endless gusty PCHIP series and a bouncing ball: never at rest. */
static int write_busy_model(void)
{
    static system_builder builder;
    static double value[101];
    memset(&builder, 0, sizeof builder);
    builder.n_types = 2;
    builder.types[0] = (built_type){.kernel = "rc",
                                    .n_instances = 1,
                                    .instances = {{.name = "circuit", .parameters = {2.0, 0.25}}},
                                    .differential = {1, 0}};
    builder.types[1] =
        (built_type){.kernel = "ball",
                     .n_instances = 1,
                     .instances = {{.name = "ball", .parameters = {9.81, 1.0}, .start = {1.0, 0.0}}},
                     .differential = {1, 1},
                     .root_kind = {1},
                     .when_root = {0},
                     .when_period = {-1}};
    builder.n_inputs = 1;
    builder.n_channels = 2;
    const int32_t channel[] = {0, 0, 0, 0, 2, 0};
    memcpy(builder.channel, channel, sizeof channel);
    for (int k = 0; k < 101; ++k) {
        value[k] = sin(0.37 * k) + 0.3 * sin(1.9 * k);
    }
    builder_inline_series(&builder, 2, 2, 0, 0.0, 0.1, 10.0, NULL, value, 101);
    builder_link(&builder);
    return write_bytes(&builder.writer, BUSY);
}

/* An RC circuit; one channel has a name that CSV must quote. */
static int write_model(void **state)
{
    (void)state;
    static system_builder builder;
    memset(&builder, 0, sizeof builder);
    builder.n_types = 1;
    builder.types[0] = (built_type){.kernel = "rc",
                                    .n_instances = 1,
                                    .instances = {{.name = "circuit", .parameters = {2.0, 0.25}}},
                                    .differential = {1, 0}};
    builder.n_inputs = 1;
    builder.inputs[0] = 10.0;
    builder.n_channels = 2;
    const int32_t channel[] = {0, 0, 0, 1, 0, 2};
    memcpy(builder.channel, channel, sizeof channel);
    builder_link(&builder);
    const char *const names[] = {"v \"of\" C, quoted", "energy"};
    const char *const units[] = {"V", "J"};
    writer_texts(&builder.writer, "channel_names", names, 2);
    writer_texts(&builder.writer, "channel_units", units, 2);
    return write_bytes(&builder.writer, MODEL) != 0 || write_busy_model() != 0;
}

static int remove_files(void **state)
{
    (void)state;
    unlink(MODEL);
    unlink(CSV);
    unlink(WORDS);
    unlink(BUSY);
    unlink(WHOLE);
    unlink(SAVED);
    return 0;
}

/* Starts gust-run with up to 20 arguments; stdout and stderr go to WORDS. */
static pid_t start(const char *const arguments[])
{
    char *argv[24] = {(char[]){"gust-run"}};
    int count = 1;
    for (; arguments[count - 1] != NULL; ++count) {
        argv[count] = strdup(arguments[count - 1]);
    }
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        const int words = open(WORDS, O_WRONLY | O_CREAT | O_TRUNC, 0600);
        if (words < 0 || dup2(words, STDOUT_FILENO) < 0 || dup2(words, STDERR_FILENO) < 0) {
            _exit(99);
        }
        execv(GUSTFORM_TEST_GUST_RUN, argv);
        _exit(98);
    }
    for (int k = 1; k < count; ++k) {
        free(argv[k]);
    }
    return child;
}

static int finish(pid_t child)
{
    int state = 0;
    while (waitpid(child, &state, 0) < 0) {
        assert_int_equal(errno, EINTR);
    }
    assert_true(WIFEXITED(state));
    return WEXITSTATUS(state);
}

static int run(const char *const arguments[])
{
    return finish(start(arguments));
}

static const char *content(const char *path)
{
    static char text[200000];
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    const size_t size = fread(text, 1, sizeof text - 1, file);
    fclose(file);
    text[size] = '\0';
    return text;
}

static void writes_csv(void **state)
{
    (void)state;
    const char *const arguments[] = {MODEL,   "--until", "1",      "--every", "0.25",
                                     "--out", CSV,       "--rtol", "1e-8",    NULL};
    assert_int_equal(run(arguments), 0);
    assert_says(content(WORDS), "reached t = 1 s");
    const char *text = content(CSV);
    const char *header = "\"time [s]\",\"v \"\"of\"\" C, quoted [V]\",\"energy [J]\"\n";
    assert_int_equal(strncmp(text, header, strlen(header)), 0);
    const char *line = text + strlen(header);
    for (int k = 0; k <= 4; ++k) {
        double t = NAN, v = NAN, energy = NAN;
        assert_int_equal(sscanf(line, "%lf,%lf,%lf\n", &t, &v, &energy), 3);
        const double expected = 10.0 * (1.0 - exp(-t / 0.5));
        assert_close(t, 0.25 * k, 1e-12, "time");
        assert_close(v, expected, 1e-5, "voltage");
        assert_close(energy, 0.125 * expected * expected, 2e-5, "energy");
        line = strchr(line, '\n') + 1;
    }
    assert_true(*line == '\0');
}

static void refuses(void **state)
{
    (void)state;
    assert_int_equal(run((const char *const[]){"--help", NULL}), 0);
    assert_says(content(WORDS), "--until");
    assert_int_equal(run((const char *const[]){NULL}), 2);
    assert_int_equal(run((const char *const[]){MODEL, NULL}), 2);
    assert_int_equal(run((const char *const[]){MODEL, "--until", "soon", NULL}), 2);
    assert_says(content(WORDS), "soon");
    assert_int_equal(run((const char *const[]){MODEL, "--until", NULL}), 2);
    assert_int_equal(run((const char *const[]){MODEL, "--until", "-1", NULL}), 2);
    assert_int_equal(run((const char *const[]){MODEL, MODEL, "--until", "1", NULL}), 2);
    assert_int_equal(run((const char *const[]){MODEL, "--until", "1", "--every", "0", NULL}), 2);
    assert_int_equal(run((const char *const[]){MODEL, "--until", "1", "--rtoll", "1", NULL}), 2);
    assert_says(content(WORDS), "rtoll");
    assert_int_equal(run((const char *const[]){MODEL, "--until", "1", "--rtol", "-1", NULL}), 2);
    assert_int_equal(run((const char *const[]){"/nonexistent.gust", "--until", "1", NULL}), 1);
    assert_says(content(WORDS), "/nonexistent.gust");
    assert_int_equal(run((const char *const[]){CSV, "--until", "1", NULL}), 1);
    assert_int_equal(run((const char *const[]){MODEL, "--until", "1", "--out", "/nonexistent/run.csv", NULL}),
                     1);
    assert_says(content(WORDS), "/nonexistent/run.csv");
    assert_int_equal(run((const char *const[]){MODEL, "--until", "1", "--out", "/dev/full", NULL}), 1);
    assert_says(content(WORDS), "SINK_FAILED");
}

/* Ctrl-C: exit code 130, and every row up to then in the file. */
static void interrupted(void **state)
{
    (void)state;
    const char *const arguments[] = {MODEL,   "--until", "1e9",        "--every", "1",
                                     "--out", CSV,       "--max_step", "1e-3",    NULL};
    unlink(CSV);
    const pid_t child = start(arguments);
    struct stat facts;
    /* wait for the first block on the disk */
    for (int k = 0; k < 10000 && (stat(CSV, &facts) != 0 || facts.st_size < 2000); ++k) {
        const struct timespec moment = {0, 2000000};
        nanosleep(&moment, NULL);
    }
    assert_int_equal(kill(child, SIGINT), 0);
    assert_int_equal(finish(child), 130);
    assert_says(content(WORDS), "STOP_REQUESTED");
    double reached = NAN;
    assert_int_equal(sscanf(strstr(content(WORDS), "reached t = "), "reached t = %lf s", &reached), 1);
    const char *text = content(CSV);
    const size_t size = strlen(text);
    assert_true(size > 0 && text[size - 1] == '\n');
    if (size < 190000) {
        const char *last = text + size - 2;
        while (*last != '\n') {
            --last;
        }
        assert_true(floor(reached) == strtod(last + 1, NULL));
    }
}

static void same_files(const char *one, const char *other)
{
    FILE *a = fopen(one, "rb");
    FILE *b = fopen(other, "rb");
    assert_non_null(a);
    assert_non_null(b);
    long at = 0;
    for (int c = 0; c != EOF; ++at) {
        c = fgetc(a);
        if (c != fgetc(b)) {
            fail_msg("%s and %s differ at byte %ld", one, other, at);
        }
    }
    fclose(a);
    fclose(b);
}

#define BUSY_ARGUMENTS(OUT)                                                                                    \
    BUSY, "--until", "200", "--every", "0.02", "--checkpoint", SAVED, "--checkpoint-every", "1.7", "--out", OUT

/* Killed at random moments, as often as it takes, and started again: the rows are those of a run that was left
 * alone, to the last byte. */
static void killed(void **state)
{
    (void)state;
    unlink(SAVED);
    assert_int_equal(run((const char *const[]){BUSY_ARGUMENTS(WHOLE), NULL}), 0);
    unlink(SAVED);
    unlink(CSV);
    srand(3);
    int kills = 0;
    int resumed = 0;
    for (;;) {
        const bool again = access(SAVED, R_OK) == 0;
        const char *const first[] = {BUSY_ARGUMENTS(CSV), NULL};
        const char *const next[] = {BUSY_ARGUMENTS(CSV), "--resume", SAVED, NULL};
        const pid_t child = start(again ? next : first);
        resumed += again ? 1 : 0;
        /* the later the longer, so that it comes to an end on any machine */
        const struct timespec moment = {0, rand() % 60000000 + 1000000L * kills};
        nanosleep(&moment, NULL);
        int result = 0;
        kill(child, SIGKILL);
        while (waitpid(child, &result, 0) < 0) {
            assert_int_equal(errno, EINTR);
        }
        if (WIFEXITED(result)) {
            if (WEXITSTATUS(result) != 0) {
                fail_msg("%s", content(WORDS));
            }
            break;
        }
        ++kills;
    }
    assert_true(kills > 2 && resumed > 2);
    same_files(CSV, WHOLE);
    /* at the end there is nothing left to do, and nothing is lost by asking */
    assert_int_equal(run((const char *const[]){BUSY_ARGUMENTS(CSV), "--resume", SAVED, NULL}), 0);
    same_files(CSV, WHOLE);
}

static void cannot_resume(void **state)
{
    (void)state;
    assert_int_equal(run((const char *const[]){BUSY_ARGUMENTS(CSV), NULL}), 0);
    assert_int_equal(run((const char *const[]){BUSY_ARGUMENTS(CSV), "--resume", "/nonexistent", NULL}), 1);
    assert_says(content(WORDS), "CHECKPOINT_UNREADABLE");
    assert_int_equal(run((const char *const[]){BUSY_ARGUMENTS(CSV), "--resume", BUSY, NULL}), 1);
    assert_says(content(WORDS), "BAD_CHECKPOINT");
    assert_int_equal(run((const char *const[]){BUSY_ARGUMENTS(CSV), "--rtol", "1e-5", "--resume", SAVED, NULL}),
                     1);
    assert_says(content(WORDS), "rtol");
    assert_int_equal(run((const char *const[]){MODEL, "--until", "200", "--every", "0.02", "--out", CSV,
                                               "--resume", SAVED, NULL}),
                     1);
    assert_says(content(WORDS), "another model");
    assert_int_equal(truncate(CSV, 500), 0);
    assert_int_equal(run((const char *const[]){BUSY_ARGUMENTS(CSV), "--resume", SAVED, NULL}), 1);
    assert_says(content(WORDS), "before the checkpoint");
    assert_int_equal(run((const char *const[]){BUSY, "--until", "1", "--checkpoint", SAVED, NULL}), 2);
    assert_int_equal(run((const char *const[]){BUSY, "--until", "1", "--checkpoint-every", "0", NULL}), 2);
    assert_int_equal(run((const char *const[]){BUSY, "--until", "1", "--resume", NULL}), 2);
    assert_int_equal(run((const char *const[]){BUSY, "--until", "3", "--checkpoint", "/nonexistent/x",
                                               "--checkpoint-every", "1", NULL}),
                     1);
    assert_says(content(WORDS), "CHECKPOINT_FAILED");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(writes_csv), cmocka_unit_test(refuses),
                                       cmocka_unit_test(interrupted), cmocka_unit_test(killed),
                                       cmocka_unit_test(cannot_resume)};
    return cmocka_run_group_tests(tests, write_model, remove_files);
}
