/* Statistics under the sanitizers: what they say of known samples, portions, and states that are not sound. The
 * agreement with numpy, SciPy and rainflow is tested from Python. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "archive.h"
#include "gustform/gust_stats.h"
#include "support.h"

static const double EDGES[] = {-2.0, -1.0, 0.0, 0.5, 1.0};
static const double EXPONENTS[] = {3.0, 4.5};

enum { ROWS = 5000, SEGMENT = 64 };

static double wave(int64_t k)
{
    return sin(0.1 * (double)k) + 0.3 * cos(1.7 * (double)k);
}

static gust_stats *new_stats(void)
{
    const gust_stats_channel channels[] = {{.column = 2,
                                            .n_edges = 5,
                                            .edges = EDGES,
                                            .segment = SEGMENT,
                                            .n_exponents = 2,
                                            .exponents = EXPONENTS,
                                            .n_ranges = 4,
                                            .range_width = 0.5},
                                           {.column = 0, .segment = SEGMENT},
                                           {.column = 1}};
    gust_stats *stats = NULL;
    char message[200];
    if (gust_stats_create(channels, 3, 3, 0.1, &stats, message, sizeof message) != GUST_OK) {
        fail_msg("%s", message);
    }
    return stats;
}

static void add_rows(gust_stats *stats, int64_t first, int64_t count)
{
    for (int64_t k = first; k < first + count; ++k) {
        const double time = 0.1 * (double)k;
        const double row[] = {wave(k), k % 1000 == 7 ? NAN : 1.0, wave(2 * k)};
        assert_int_equal(gust_stats_add(stats, 1, &time, row), GUST_OK);
    }
}

static void known(void **state)
{
    (void)state;
    gust_stats *stats = new_stats();
    add_rows(stats, 0, ROWS);
    gust_stats_moments_result moments;
    assert_int_equal(gust_stats_moments(stats, 2, &moments), GUST_OK);
    assert_int_equal(moments.count, ROWS - 5);
    assert_int_equal(moments.not_finite, 5);
    assert_true(moments.mean == 1.0 && moments.deviation == 0.0);
    assert_true(moments.minimum == 1.0 && moments.t_minimum == 0.0);
    int64_t count[4], below = 0, above = 0;
    assert_int_equal(gust_stats_histogram(stats, 0, count, &below, &above), GUST_OK);
    assert_int_equal(count[0] + count[1] + count[2] + count[3] + below + above, ROWS);
    double density[SEGMENT / 2 + 1];
    int64_t segments = 0;
    assert_int_equal(gust_stats_spectrum(stats, 1, density, &segments), GUST_OK);
    assert_int_equal(segments, (ROWS - SEGMENT / 2) / (SEGMENT / 2));
    /* Parseval: the density's integral is the mean square off the segments' means, 1/2 + 0.045 */
    double power = 0.0;
    for (int k = 0; k <= SEGMENT / 2; ++k) {
        power += density[k] / (SEGMENT * 0.1);
    }
    assert_close(power, 0.545, 0.05, "power");
    double damage[2], cycles[5];
    gust_stats_cycles_result result;
    assert_int_equal(gust_stats_cycles(stats, 0, damage, cycles, &result), GUST_OK);
    assert_true(result.full > 0 && result.half > 0 && result.forced == 0);
    double all = 0.0;
    for (int k = 0; k < 5; ++k) {
        all += cycles[k];
    }
    assert_true(all == (double)result.full + 0.5 * (double)result.half);
    assert_int_equal(gust_stats_histogram(stats, 1, count, NULL, NULL), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_stats_spectrum(stats, 2, density, NULL), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_stats_cycles(stats, 1, NULL, NULL, NULL), GUST_BAD_ARGUMENT);
    assert_int_equal(gust_stats_cycles(stats, 3, NULL, NULL, NULL), GUST_BAD_ARGUMENT);
    gust_stats_destroy(&stats);
    gust_stats_destroy(&stats);
    assert_null(stats);
}

static void state_goes_on(void **state)
{
    (void)state;
    gust_stats *whole = new_stats();
    add_rows(whole, 0, ROWS);
    const size_t size = gust_stats_size(whole);
    unsigned char *bytes[2] = {malloc(size), malloc(size)};
    size_t used[2] = {0, 0};
    for (int64_t cut = 1; cut < ROWS; cut += 613) {
        gust_stats *first = new_stats();
        gust_stats *second = new_stats();
        add_rows(first, 0, cut);
        assert_int_equal(gust_stats_save(first, bytes[0], size, &used[0]), GUST_OK);
        assert_int_equal(gust_stats_restore(second, bytes[0], used[0]), GUST_OK);
        add_rows(second, cut, ROWS - cut);
        assert_int_equal(gust_stats_save(whole, bytes[0], size, &used[0]), GUST_OK);
        assert_int_equal(gust_stats_save(second, bytes[1], size, &used[1]), GUST_OK);
        assert_int_equal(used[0], used[1]);
        assert_memory_equal(bytes[0], bytes[1], used[0]);
        gust_stats_destroy(&first);
        gust_stats_destroy(&second);
    }
    assert_int_equal(gust_stats_save(whole, bytes[0], used[0] - 1, NULL), GUST_BAD_ARGUMENT);
    gust_stats_destroy(&whole);
    free(bytes[0]);
    free(bytes[1]);
}

/* A state that someone has written by hand, checksum and all, may give nonsense but harms nothing. */
static void forged(void **state)
{
    (void)state;
    gust_stats *stats = new_stats();
    add_rows(stats, 0, 1111);
    const size_t size = gust_stats_size(stats);
    unsigned char *sound = malloc(size);
    unsigned char *bytes = malloc(size);
    size_t used = 0;
    assert_int_equal(gust_stats_save(stats, sound, size, &used), GUST_OK);
    uint64_t identity = 0;
    memcpy(&identity, sound + 24, sizeof identity);
    srand(5);
    for (int k = 0; k < 3000; ++k) {
        memcpy(bytes, sound, used);
        for (int i = 0; i <= k % 4; ++i) {
            bytes[GUST_ARCHIVE_HEADER + (size_t)rand() % (used - GUST_ARCHIVE_HEADER)] = (unsigned char)rand();
        }
        gust_archive archive = {.bytes = bytes, .at = used};
        gust_archive_seal(&archive, "GUSTSTA1", identity);
        gust_stats *victim = new_stats();
        gust_stats_restore(victim, bytes, used);
        add_rows(victim, 0, 600);
        gust_stats_cycles_result cycles;
        gust_stats_cycles(victim, 0, NULL, NULL, &cycles);
        gust_stats_spectrum(victim, 0, NULL, NULL);
        gust_stats_destroy(&victim);
    }
    free(sound);
    free(bytes);
    gust_stats_destroy(&stats);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(known), cmocka_unit_test(state_goes_on),
                                       cmocka_unit_test(forged)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
