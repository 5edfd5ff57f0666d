#include "rainflow.h"

#include <math.h>
#include <string.h>

#include "memory.h"

bool gust_rainflow_create(gust_rainflow *rainflow, const double *exponents, int32_t n_exponents, double width,
                          int32_t n_ranges)
{
    *rainflow = (gust_rainflow){.n_exponents = n_exponents, .n_ranges = n_ranges, .width = width};
    if (n_exponents == 0 && n_ranges == 0) {
        return true;
    }
    rainflow->exponents = gust_allocate((size_t)n_exponents, sizeof(double));
    rainflow->counts.damage = gust_allocate((size_t)n_exponents, sizeof(double));
    rainflow->counts.cycles = gust_allocate((size_t)n_ranges + 1, sizeof(double));
    rainflow->open = gust_allocate(GUST_RAINFLOW_OPEN, sizeof(double));
    if (rainflow->exponents == NULL || rainflow->counts.damage == NULL || rainflow->counts.cycles == NULL ||
        rainflow->open == NULL) {
        return false;
    }
    if (n_exponents > 0) {
        memcpy(rainflow->exponents, exponents, (size_t)n_exponents * sizeof(double));
    }
    return true;
}

void gust_rainflow_free(gust_rainflow *rainflow)
{
    gust_release(rainflow->exponents);
    gust_release(rainflow->counts.damage);
    gust_release(rainflow->counts.cycles);
    gust_release(rainflow->open);
    *rainflow = (gust_rainflow){0};
}

void gust_rainflow_copy(gust_rainflow *to, const gust_rainflow *from)
{
    const gust_rainflow own = *to;
    *to = *from;
    to->exponents = own.exponents;
    to->counts.damage = own.counts.damage;
    to->counts.cycles = own.counts.cycles;
    to->open = own.open;
    memcpy(to->exponents, from->exponents, (size_t)from->n_exponents * sizeof(double));
    memcpy(to->counts.damage, from->counts.damage, (size_t)from->n_exponents * sizeof(double));
    memcpy(to->counts.cycles, from->counts.cycles, (size_t)(from->n_ranges + 1) * sizeof(double));
    memcpy(to->open, from->open, (size_t)from->n_open * sizeof(double));
}

/* R^m; by multiplication where m is a small whole number, as it usually is. */
static double power_of(double range, double exponent)
{
    const int whole = (int)exponent;
    if (whole < 1 || whole > 20 || (double)whole != exponent) {
        return pow(range, exponent);
    }
    double result = 1.0;
    double factor = range;
    for (int left = whole; left > 0; left /= 2) {
        result = left % 2 != 0 ? result * factor : result;
        factor *= factor;
    }
    return result;
}

static void count(gust_rainflow *rainflow, double range, double cycles)
{
    gust_rainflow_counts *counts = &rainflow->counts;
    counts->largest = fmax(counts->largest, range);
    for (int32_t k = 0; k < rainflow->n_exponents; ++k) {
        counts->damage[k] += cycles * power_of(range, rainflow->exponents[k]);
    }
    if (rainflow->n_ranges > 0) {
        const double bin = range / rainflow->width;
        counts->cycles[bin < rainflow->n_ranges ? (int32_t)bin : rainflow->n_ranges] += cycles;
    }
    if (cycles < 1.0) {
        ++counts->half;
    } else {
        ++counts->full;
    }
}

static void reverse(gust_rainflow *rainflow, double x)
{
    double *open = rainflow->open;
    int32_t n = rainflow->n_open;
    if (n == GUST_RAINFLOW_OPEN) {
        count(rainflow, fabs(open[n - 1] - open[n - 2]), 1.0);
        ++rainflow->counts.forced;
        n -= 2;
    }
    open[n++] = x;
    while (n >= 3) {
        const double last = fabs(open[n - 1] - open[n - 2]);
        const double before = fabs(open[n - 2] - open[n - 3]);
        if (last < before) {
            break;
        }
        if (n == 3) {
            /* It contains the start: a half cycle. */
            count(rainflow, before, 0.5);
            open[0] = open[1];
            open[1] = open[2];
            n = 2;
        } else {
            count(rainflow, before, 1.0);
            open[n - 3] = open[n - 1];
            n -= 2;
        }
    }
    rainflow->n_open = n;
}

void gust_rainflow_add(gust_rainflow *rainflow, const double *x, int32_t n)
{
    int32_t i = 0;
    for (; i < n && rainflow->seen < 2; ++i, ++rainflow->seen) {
        if (rainflow->seen == 1) {
            reverse(rainflow, rainflow->x);
            rainflow->d = x[i] - rainflow->x;
        }
        rainflow->x = x[i];
    }
    if (i == n) {
        return;
    }
    rainflow->seen = 3;
    double before = rainflow->x;
    double d_before = rainflow->d;
    for (; i < n; ++i) {
        const double d = x[i] - before;
        if (d == 0.0) {
            continue;
        }
        if (d_before * d < 0.0) {
            reverse(rainflow, before);
        }
        before = x[i];
        d_before = d;
    }
    rainflow->x = before;
    rainflow->d = d_before;
}

void gust_rainflow_finish(gust_rainflow *rainflow)
{
    if (rainflow->seen >= 3) {
        reverse(rainflow, rainflow->x);
    }
    for (int32_t k = 0; k + 1 < rainflow->n_open; ++k) {
        count(rainflow, fabs(rainflow->open[k + 1] - rainflow->open[k]), 0.5);
    }
    rainflow->n_open = 0;
}

void gust_rainflow_archive(gust_rainflow *rainflow, gust_archive *archive)
{
    if (rainflow->open == NULL) {
        return;
    }
    gust_rainflow_counts *counts = &rainflow->counts;
    gust_archive_longs(archive, "rainflow.full", &counts->full, 1);
    gust_archive_longs(archive, "rainflow.half", &counts->half, 1);
    gust_archive_longs(archive, "rainflow.forced", &counts->forced, 1);
    gust_archive_doubles(archive, "rainflow.largest", &counts->largest, 1);
    gust_archive_doubles(archive, "rainflow.damage", counts->damage, rainflow->n_exponents);
    gust_archive_doubles(archive, "rainflow.cycles", counts->cycles, rainflow->n_ranges + 1);
    gust_archive_index(archive, "rainflow.seen", &rainflow->seen, 0, 3);
    gust_archive_doubles(archive, "rainflow.x", &rainflow->x, 1);
    gust_archive_doubles(archive, "rainflow.d", &rainflow->d, 1);
    gust_archive_small_index(archive, "rainflow.n_open", &rainflow->n_open, 0, GUST_RAINFLOW_OPEN);
    const int64_t most = archive->mode == GUST_ARCHIVE_MEASURE ? GUST_RAINFLOW_OPEN : rainflow->n_open;
    gust_archive_doubles(archive, "rainflow.open", rainflow->open, most);
}
