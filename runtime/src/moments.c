#include "moments.h"

#include <math.h>

#include "lanes.h"

void gust_moments_start(gust_moments *moments)
{
    *moments = (gust_moments){.minimum = INFINITY, .maximum = -INFINITY, .t_minimum = NAN, .t_maximum = NAN};
}

/* Sum of the first n samples; whole lane blocks in lanes. */
static double sum_of(const double *x, int32_t n)
{
    const gust_lanes *lanes = gust_lanes_in(x);
    const int32_t whole = n - n % GUST_LANE_BLOCK;
    gust_lanes sum[GUST_BLOCK_LANES] = {{0.0}};
    for (int32_t i = 0; i < whole / GUST_LANES; i += GUST_BLOCK_LANES) {
        for (int k = 0; k < GUST_BLOCK_LANES; ++k) {
            sum[k] += lanes[i + k];
        }
    }
    double total = gust_lane_sum(sum);
    for (int32_t i = whole; i < n; ++i) {
        total += x[i];
    }
    return total;
}

/* Sum of (x - mean)^2; *drift that of x - mean, which is 0 but for rounding. */
static double squares_of(const double *x, int32_t n, double mean, double *drift)
{
    const gust_lanes *lanes = gust_lanes_in(x);
    const int32_t whole = n - n % GUST_LANE_BLOCK;
    gust_lanes sum[GUST_BLOCK_LANES] = {{0.0}};
    gust_lanes first[GUST_BLOCK_LANES] = {{0.0}};
    for (int32_t i = 0; i < whole / GUST_LANES; i += GUST_BLOCK_LANES) {
        for (int k = 0; k < GUST_BLOCK_LANES; ++k) {
            const gust_lanes off = lanes[i + k] - mean;
            first[k] += off;
            sum[k] += off * off;
        }
    }
    double total = gust_lane_sum(sum);
    *drift = gust_lane_sum(first);
    for (int32_t i = whole; i < n; ++i) {
        const double off = x[i] - mean;
        *drift += off;
        total += off * off;
    }
    return total;
}

/* Extremes in independent chains, so that one comparison need not wait for the one before. */
static void extremes_of(const double *x, int32_t n, double *minimum, double *maximum)
{
    double low[GUST_LANE_BLOCK];
    double high[GUST_LANE_BLOCK];
    for (int k = 0; k < GUST_LANE_BLOCK; ++k) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
    }
    const int32_t whole = n - n % GUST_LANE_BLOCK;
    for (int32_t i = 0; i < whole; i += GUST_LANE_BLOCK) {
        for (int k = 0; k < GUST_LANE_BLOCK; ++k) {
            low[k] = x[i + k] < low[k] ? x[i + k] : low[k];
            high[k] = x[i + k] > high[k] ? x[i + k] : high[k];
        }
    }
    for (int32_t i = whole; i < n; ++i) {
        low[0] = x[i] < low[0] ? x[i] : low[0];
        high[0] = x[i] > high[0] ? x[i] : high[0];
    }
    *minimum = low[0];
    *maximum = high[0];
    for (int k = 1; k < GUST_LANE_BLOCK; ++k) {
        *minimum = low[k] < *minimum ? low[k] : *minimum;
        *maximum = high[k] > *maximum ? high[k] : *maximum;
    }
}

static double time_of(const double *x, const double *time, double wanted)
{
    int32_t i = 0;
    while (x[i] != wanted) {
        ++i;
    }
    return time[i];
}

void gust_moments_add(gust_moments *moments, const double *x, const double *time, int32_t n)
{
    if (n <= 0) {
        return;
    }
    const double mean = sum_of(x, n) / n;
    double drift = 0.0;
    const double squares = squares_of(x, n, mean, &drift);
    const double exact_mean = mean + drift / n;
    const double exact_squares = squares - drift * drift / n;
    const double before = (double)moments->count;
    const double after = before + n;
    const double apart = exact_mean - moments->mean;
    moments->mean += apart * (n / after);
    moments->squares += exact_squares + apart * apart * (before * n / after);
    moments->count += n;
    double minimum = 0.0;
    double maximum = 0.0;
    extremes_of(x, n, &minimum, &maximum);
    if (minimum < moments->minimum) {
        moments->minimum = minimum;
        moments->t_minimum = time_of(x, time, minimum);
    }
    if (maximum > moments->maximum) {
        moments->maximum = maximum;
        moments->t_maximum = time_of(x, time, maximum);
    }
}

void gust_moments_archive(gust_moments *moments, gust_archive *archive)
{
    double *const numbers[] = {&moments->mean,    &moments->squares,   &moments->minimum,
                               &moments->maximum, &moments->t_minimum, &moments->t_maximum};
    gust_archive_longs(archive, "moments.count", &moments->count, 1);
    for (size_t k = 0; k < sizeof numbers / sizeof numbers[0]; ++k) {
        gust_archive_doubles(archive, "moments", numbers[k], 1);
    }
}
