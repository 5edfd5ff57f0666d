#include "welch.h"

#include <math.h>
#include <string.h>

#include "memory.h"

bool gust_welch_plan_create(gust_welch_plan *plan, int32_t segment, double interval)
{
    const size_t n = (size_t)segment;
    const bool planned = gust_fft_create(&plan->fft, segment);
    plan->window = gust_allocate(n, sizeof(double));
    plan->windowed = gust_allocate(n, sizeof(double));
    plan->re = gust_allocate(n / 2, sizeof(double));
    plan->im = gust_allocate(n / 2, sizeof(double));
    plan->power = gust_allocate(n / 2 + 1, sizeof(double));
    if (!planned || plan->window == NULL || plan->windowed == NULL || plan->re == NULL || plan->im == NULL ||
        plan->power == NULL) {
        return false;
    }
    double squares = 0.0;
    for (int32_t k = 0; k < segment; ++k) {
        plan->window[k] = 0.5 - 0.5 * cos(6.283185307179586476925 * k / segment);
        squares += plan->window[k] * plan->window[k];
    }
    plan->scale = 2.0 * interval / squares;
    return true;
}

void gust_welch_plan_free(gust_welch_plan *plan)
{
    gust_fft_free(&plan->fft);
    gust_release(plan->window);
    gust_release(plan->windowed);
    gust_release(plan->re);
    gust_release(plan->im);
    gust_release(plan->power);
    *plan = (gust_welch_plan){0};
}

bool gust_welch_create(gust_welch *welch, gust_welch_plan *plan)
{
    *welch = (gust_welch){.plan = plan};
    if (plan == NULL) {
        return true;
    }
    const size_t n = (size_t)plan->fft.n;
    welch->buffer = gust_allocate(n, sizeof(double));
    welch->sum = gust_allocate(n / 2 + 1, sizeof(double));
    return welch->buffer != NULL && welch->sum != NULL;
}

void gust_welch_free(gust_welch *welch)
{
    gust_release(welch->buffer);
    gust_release(welch->sum);
    *welch = (gust_welch){0};
}

static void add_segment(gust_welch *welch)
{
    const gust_welch_plan *plan = welch->plan;
    const int32_t n = plan->fft.n;
    double lane[4] = {0.0, 0.0, 0.0, 0.0};
    for (int32_t k = 0; k < n; k += 4) {
        for (int i = 0; i < 4; ++i) {
            lane[i] += welch->buffer[k + i];
        }
    }
    const double mean = ((lane[0] + lane[1]) + (lane[2] + lane[3])) / n;
    for (int32_t k = 0; k < n; ++k) {
        plan->windowed[k] = (welch->buffer[k] - mean) * plan->window[k];
    }
    gust_fft_power(&plan->fft, plan->windowed, plan->re, plan->im, plan->power);
    /* The outermost frequencies have no mirror image to be counted with. */
    plan->power[0] *= 0.5;
    plan->power[n / 2] *= 0.5;
    for (int32_t k = 0; k <= n / 2; ++k) {
        welch->sum[k] += plan->scale * plan->power[k];
    }
    ++welch->segments;
}

void gust_welch_add(gust_welch *welch, const double *x, int32_t n)
{
    const int32_t segment = welch->plan->fft.n;
    while (n > 0) {
        const int32_t room = segment - welch->filled;
        const int32_t taken = n < room ? n : room;
        memcpy(welch->buffer + welch->filled, x, (size_t)taken * sizeof *x);
        welch->filled += taken;
        x += taken;
        n -= taken;
        if (welch->filled == segment) {
            add_segment(welch);
            welch->filled = segment / 2;
            memcpy(welch->buffer, welch->buffer + segment / 2, (size_t)(segment / 2) * sizeof *x);
        }
    }
}

void gust_welch_break(gust_welch *welch)
{
    welch->filled = 0;
}

void gust_welch_archive(gust_welch *welch, gust_archive *archive)
{
    if (welch->plan == NULL) {
        return;
    }
    const int32_t n = welch->plan->fft.n;
    gust_archive_small_index(archive, "welch.filled", &welch->filled, 0, n - 1);
    gust_archive_longs(archive, "welch.segments", &welch->segments, 1);
    gust_archive_doubles(archive, "welch.buffer", welch->buffer, n);
    gust_archive_doubles(archive, "welch.sum", welch->sum, n / 2 + 1);
}
