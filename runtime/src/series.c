#define _POSIX_C_SOURCE 200809L

#include "series.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "memory.h"
#include "moment.h"
#include "text.h"

static bool fail(gust_series_set *set, gust_status status)
{
    set->failure = status;
    return false;
}

/* -- reading -------------------------------------------------------------------------------------------- */

static bool unreadable(gust_series_set *set, const gust_series *series)
{
    gust_text(set->message, sizeof set->message, "series \"%s\": file \"%s\" cannot be read: %s",
              series->what->name, series->what->path, strerror(errno));
    return fail(set, GUST_SERIES_UNREADABLE);
}

/* Reads `size` bytes at `offset` of the series' file, fewer only at its end; the count read, or -1. The
 * file is opened each time, so that a thousand series do not need a thousand file handles. */
static ssize_t read_bytes(const gust_series *series, int64_t offset, void *buffer, size_t size)
{
    const int file = open(series->what->path, O_RDONLY | O_CLOEXEC);
    if (file < 0) {
        return -1;
    }
    size_t done = 0;
    while (done < size) {
        const ssize_t got = pread(file, (char *)buffer + done, size - done, (off_t)(offset + (int64_t)done));
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got < 0) {
            const int reason = errno;
            close(file);
            errno = reason;
            return -1;
        }
        if (got == 0) {
            break;
        }
        done += (size_t)got;
    }
    close(file);
    return (ssize_t)done;
}

static int64_t read_file(gust_series_set *set, gust_series *series, int64_t first, int64_t count)
{
    const int64_t width = series->what->uniform ? 1 : 2;
    /* Pairs (t, v) are read behind each other into the value buffer, which has room for both. */
    const ssize_t got = read_bytes(series, first * width * (int64_t)sizeof(double), series->value_buffer,
                                   (size_t)(count * width) * sizeof(double));
    if (got < 0) {
        unreadable(set, series);
        return -1;
    }
    const int64_t samples = (int64_t)((size_t)got / sizeof(double)) / width;
    if (width == 2) {
        for (int64_t i = 0; i < samples; ++i) {
            series->time_buffer[i] = series->value_buffer[2 * i];
            series->value_buffer[i] = series->value_buffer[2 * i + 1];
        }
    }
    return samples;
}

static int64_t read_callback(gust_series_set *set, gust_series *series, int64_t first, int64_t count)
{
    const int got = series->reader(series->context, first, count,
                                   series->what->uniform ? NULL : series->time_buffer, series->value_buffer);
    if (got < 0 || got > count) {
        gust_text(set->message, sizeof set->message,
                  "series \"%s\": its reader failed (%d) at sample %lld: look at the source of the data",
                  series->what->name, got, (long long)first);
        fail(set, GUST_SERIES_UNREADABLE);
        return -1;
    }
    return got;
}

static double sample_time(const gust_series *series, int64_t in_window)
{
    return series->what->uniform ? series->what->t0 + (double)(series->first + in_window) * series->what->dt
                                 : series->time[in_window];
}

static bool check_window(gust_series_set *set, gust_series *series)
{
    series->size = 0.0;
    for (int64_t i = 0; i < series->count; ++i) {
        const long long number = series->first + i;
        const bool finite = isfinite(series->value[i]) && (series->what->uniform || isfinite(series->time[i]));
        if (!finite) {
            gust_text(set->message, sizeof set->message,
                      "series \"%s\": sample %lld (t = %g s, value %g) is not a number: clean the data first",
                      series->what->name, number, sample_time(series, i), series->value[i]);
            return fail(set, GUST_BAD_SERIES);
        }
        if (!series->what->uniform && i > 0 && !(series->time[i] > series->time[i - 1])) {
            gust_text(set->message, sizeof set->message,
                      "series \"%s\": the time of sample %lld (%g s) is not after that of the one before (%g "
                      "s): sort the data first",
                      series->what->name, number, series->time[i], series->time[i - 1]);
            return fail(set, GUST_BAD_SERIES);
        }
        series->size = fmax(series->size, fabs(series->value[i]));
    }
    return true;
}

static void find_end(gust_series_set *set)
{
    set->end = INFINITY;
    for (int32_t k = 0; k < set->n_series; ++k) {
        if (set->series[k].what->on_end == GUST_SERIES_END_ERROR && set->series[k].end < set->end) {
            set->end = set->series[k].end;
            set->ending = k;
        }
    }
}

/* Last time for which the samples give a value. */
static double last_time(const gust_series *series, double last_sample)
{
    const bool held = series->what->interpolation == GUST_SERIES_HOLD && isfinite(series->what->t_end);
    return held ? series->what->t_end : fmin(series->what->t_end, last_sample);
}

/* The window ends with the last sample there is. */
static void note_end(gust_series_set *set, gust_series *series)
{
    series->end = fmin(series->end, last_time(series, sample_time(series, series->count - 1)));
    find_end(set);
}

/* Moves the window so that it begins with sample `first`. */
static bool load_window(gust_series_set *set, gust_series *series, int64_t first)
{
    first = first < 0 ? 0 : first;
    const bool in_file = series->what->source == GUST_SERIES_FILE;
    const int64_t got = in_file ? read_file(set, series, first, series->capacity)
                                : read_callback(set, series, first, series->capacity);
    if (got < 0) {
        return false;
    }
    if (got == 0 && series->count > 0) {
        /* Asked beyond the end: nothing was written, the window stays as it is. */
        const int64_t known = series->first + series->count;
        series->n_total = first < known ? known : first;
        if (first <= known) {
            note_end(set, series);
        }
        return true;
    }
    if (got == 0) {
        gust_text(set->message, sizeof set->message, "series \"%s\" is empty: it needs at least one sample",
                  series->what->name);
        return fail(set, GUST_BAD_SERIES);
    }
    series->first = first;
    series->count = got;
    series->cursor = 0;
    if (!check_window(set, series)) {
        return false;
    }
    if (got < series->capacity && series->n_total > first + got) {
        series->n_total = first + got;
        note_end(set, series);
    }
    return true;
}

/* -- look-up -------------------------------------------------------------------------------------------- */

/* Samples before and after that at or before t which a value at t may need; the window is kept so that it
 * holds them unless they do not exist. */
static int64_t needed_before(const gust_series *series)
{
    return series->what->interpolation == GUST_SERIES_PCHIP ? 1 : 0;
}

static int64_t needed_after(const gust_series *series)
{
    return series->what->interpolation == GUST_SERIES_PCHIP ? 2 : 1;
}

/* Sample in the window at or before t; moves the window if need be. t before the first or after the last
 * sample gives the first or last. */
static bool locate_stamped(gust_series_set *set, gust_series *series, double t)
{
    while (series->first > 0 &&
           (series->count <= needed_before(series) || t < series->time[needed_before(series)])) {
        if (!load_window(set, series, series->first - series->capacity / 2)) {
            return false;
        }
    }
    while (series->first + series->count < series->n_total &&
           (series->count < needed_after(series) || t >= series->time[series->count - needed_after(series)])) {
        const int64_t first = series->first;
        /* A few samples are kept, since the integrator may come back by part of a step. */
        if (!load_window(set, series, first + series->count - series->capacity / 4)) {
            return false;
        }
        if (series->first <= first) {
            break;
        }
    }
    const double *time = series->time;
    int64_t low = 0;
    int64_t high = series->count - 1;
    const int64_t cursor = series->cursor <= high ? series->cursor : high;
    if (time[cursor] <= t) {
        low = cursor;
        high = cursor + 2 <= high && t < time[cursor + 2] ? cursor + 2 : high;
    } else {
        high = cursor;
    }
    while (high - low > 1) {
        const int64_t middle = low + (high - low) / 2;
        if (time[middle] <= t) {
            low = middle;
        } else {
            high = middle;
        }
    }
    series->cursor = high > low && time[high] <= t ? high : low;
    return true;
}

/* The same for uniform samples; *fraction is the way to the next sample, 0 ... 1. */
static bool locate_uniform(gust_series_set *set, gust_series *series, double t, double *fraction)
{
    double s = (t - series->what->t0) * series->step_inverse;
    s = s > 0.0 ? s : 0.0;
    /* 2^62 samples will not be reached, but a time of 1e300 s may be asked for. */
    int64_t sample = s < 4.0e18 ? (int64_t)s : INT64_MAX / 2;
    *fraction = s - (double)sample;
    if (series->first > 0 && sample - needed_before(series) < series->first &&
        !load_window(set, series, sample - series->capacity / 4)) {
        return false;
    }
    while (sample + needed_after(series) >= series->first + series->count &&
           series->first + series->count < series->n_total) {
        const int64_t known = series->first + series->count;
        if (!load_window(set, series, sample - series->capacity / 4)) {
            return false;
        }
        /* Asked far beyond the end: go on from what is known, block by block. */
        if (series->first + series->count == known && known < series->n_total &&
            !load_window(set, series, known - series->capacity / 4)) {
            return false;
        }
    }
    sample -= series->first;
    if (sample > series->count - 1) {
        sample = series->count - 1;
        *fraction = 0.0;
    }
    series->cursor = sample;
    return true;
}

/* Time from sample `k` of the window to the next, s. */
static double spacing(const gust_series *series, int64_t k)
{
    return series->what->uniform ? series->what->dt : series->time[k + 1] - series->time[k];
}

static bool same_sign(double a, double b)
{
    return (a > 0.0 && b > 0.0) || (a < 0.0 && b < 0.0);
}

/* Slope of PCHIP at a sample between an interval of length h0 and slope m0 and one of h1 and m1: their weighted
 * harmonic mean. */
static double inner_slope(double h0, double h1, double m0, double m1)
{
    const double w0 = 2.0 * h1 + h0;
    const double w1 = h1 + 2.0 * h0;
    return same_sign(m0, m1) ? 1.0 / ((w0 / m0 + w1 / m1) / (w0 + w1)) : 0.0;
}

/* The same at the first or last sample; h0 and m0 are of the outermost interval. */
static double end_slope(double h0, double h1, double m0, double m1)
{
    const double slope = ((2.0 * h0 + h1) * m0 - h0 * m1) / (h0 + h1);
    if (!same_sign(slope, m0)) {
        return 0.0;
    }
    return !same_sign(m0, m1) && fabs(slope) > 3.0 * fabs(m0) ? 3.0 * m0 : slope;
}

/* The cubic between samples k and k + 1 of the window. */
static void fit_cubic(gust_series *series, int64_t k)
{
    const double *value = series->value + k;
    const bool before = k > 0;
    const bool after = k + 2 < series->count;
    const double h = spacing(series, k);
    const double m = (value[1] - value[0]) / h;
    const double h_before = before ? spacing(series, k - 1) : h;
    const double m_before = before ? (value[0] - value[-1]) / h_before : m;
    const double h_after = after ? spacing(series, k + 1) : h;
    const double m_after = after ? (value[2] - value[1]) / h_after : m;
    double left = m; /* two samples only: a straight line */
    double right = m;
    if (before || after) {
        left = before ? inner_slope(h_before, h, m_before, m) : end_slope(h, h_after, m, m_after);
        right = after ? inner_slope(h, h_after, m, m_after) : end_slope(h, h_before, m, m_before);
    }
    series->cubic[0] = value[0];
    series->cubic[1] = left;
    series->cubic[2] = (3.0 * m - 2.0 * left - right) / h;
    series->cubic[3] = (left + right - 2.0 * m) / (h * h);
    series->cubic_of = series->first + k;
}

/* Value of a linear or PCHIP series. */
static bool interpolated_value(gust_series_set *set, gust_series *series, double t, double *value)
{
    const double at = t - series->shift;
    double fraction = 0.0;
    if (series->what->uniform) {
        if (!locate_uniform(set, series, at, &fraction)) {
            return false;
        }
    } else {
        if (!locate_stamped(set, series, at)) {
            return false;
        }
        const double *time = series->time + series->cursor;
        if (series->cursor + 1 < series->count && at > time[0]) {
            fraction = (at - time[0]) / (time[1] - time[0]);
        }
    }
    const double *sample = series->value + series->cursor;
    if (series->cursor + 1 >= series->count) {
        *value = sample[0];
    } else if (series->what->interpolation == GUST_SERIES_LINEAR) {
        *value = sample[0] + fraction * (sample[1] - sample[0]);
    } else {
        if (series->cubic_of != series->first + series->cursor) {
            fit_cubic(series, series->cursor);
        }
        const double x = fraction * spacing(series, series->cursor);
        const double *c = series->cubic;
        *value = c[0] + x * (c[1] + x * (c[2] + x * c[3]));
    }
    return true;
}

static bool held_value(gust_series_set *set, gust_series *series, double t, double *value)
{
    const double at = gust_moment_end(t - series->shift);
    double fraction = 0.0;
    if (series->what->uniform ? !locate_uniform(set, series, at, &fraction)
                              : !locate_stamped(set, series, at)) {
        return false;
    }
    int64_t sample = series->cursor;
    *value = series->value[sample];
    while (sample + 1 < series->count && series->value[sample + 1] == *value) {
        ++sample;
    }
    series->next = INFINITY;
    if (sample + 1 < series->count) {
        series->next = sample_time(series, sample + 1) + series->shift;
    } else if (series->first + series->count < series->n_total) {
        /* Nothing changes as far as the window reaches: look again there. */
        series->next = sample_time(series, sample) + series->shift;
        if (series->next <= t) {
            series->next = sample_time(series, sample) + series->shift;
            if (!load_window(set, series, series->first + series->count - 1)) {
                return false;
            }
            return held_value(set, series, t, value);
        }
    }
    return true;
}

/* -- interface ------------------------------------------------------------------------------------------ */

gust_status gust_series_create(gust_series_set *set, const gust_model *model)
{
    *set = (gust_series_set){.n_series = model->n_series, .end = INFINITY, .evaluated_at = NAN};
    set->series = gust_allocate((size_t)model->n_series, sizeof *set->series);
    if (set->series == NULL) {
        return GUST_OUT_OF_MEMORY;
    }
    for (int32_t k = 0; k < set->n_series; ++k) {
        gust_series *series = &set->series[k];
        series->what = &model->series[k];
        series->n_total = INT64_MAX;
        series->cubic_of = -1;
        series->step_inverse = series->what->uniform ? 1.0 / series->what->dt : 0.0;
        series->end = series->what->t_end;
        series->next = INFINITY;
        if (series->what->source == GUST_SERIES_INLINE) {
            series->time = series->what->time;
            series->value = series->what->value;
            series->count = series->what->n_samples;
            series->n_total = series->count;
            series->end = last_time(series, sample_time(series, series->count - 1));
            for (int64_t i = 0; i < series->count; ++i) {
                series->size = fmax(series->size, fabs(series->value[i]));
            }
        }
    }
    find_end(set);
    return GUST_OK;
}

void gust_series_free(gust_series_set *set)
{
    for (int32_t k = 0; set->series != NULL && k < set->n_series; ++k) {
        gust_release(set->series[k].time_buffer);
        gust_release(set->series[k].value_buffer);
    }
    gust_release(set->series);
    *set = (gust_series_set){0};
}

/* How long the file of a series is, so that its end is known before the run. */
static bool measure_file(gust_series_set *set, gust_series *series)
{
    struct stat facts;
    if (stat(series->what->path, &facts) != 0) {
        return unreadable(set, series);
    }
    const int64_t width = series->what->uniform ? 8 : 16;
    if (facts.st_size % width != 0) {
        gust_text(set->message, sizeof set->message,
                  "series \"%s\": file \"%s\" has %lld bytes, not a multiple of %lld: it is incomplete",
                  series->what->name, series->what->path, (long long)facts.st_size, (long long)width);
        return fail(set, GUST_BAD_SERIES);
    }
    series->n_total = (int64_t)facts.st_size / width;
    if (series->n_total == 0) {
        gust_text(set->message, sizeof set->message, "series \"%s\": file \"%s\" is empty", series->what->name,
                  series->what->path);
        return fail(set, GUST_BAD_SERIES);
    }
    double last = series->what->t0 + (double)(series->n_total - 1) * series->what->dt;
    if (!series->what->uniform &&
        read_bytes(series, (series->n_total - 1) * width, &last, sizeof last) != (ssize_t)sizeof last) {
        return unreadable(set, series);
    }
    series->end = last_time(series, last);
    return true;
}

static bool open_window(gust_series_set *set, gust_series *series, int64_t block)
{
    if (series->what->source == GUST_SERIES_INLINE) {
        return true;
    }
    if (series->what->source == GUST_SERIES_READER && series->reader == NULL) {
        gust_text(set->message, sizeof set->message, "series \"%s\" has no reader: set one before initialise",
                  series->what->name);
        return fail(set, GUST_SERIES_UNREADABLE);
    }
    if (series->what->source == GUST_SERIES_FILE && !measure_file(set, series)) {
        return false;
    }
    const size_t width = series->what->uniform ? 1 : 2;
    series->capacity = block;
    series->value_buffer = gust_allocate((size_t)block * width, sizeof(double));
    series->time_buffer = series->what->uniform ? NULL : gust_allocate((size_t)block, sizeof(double));
    if (series->value_buffer == NULL || (!series->what->uniform && series->time_buffer == NULL)) {
        gust_text(set->message, sizeof set->message, "out of memory for a window of %lld samples",
                  (long long)block);
        return fail(set, GUST_OUT_OF_MEMORY);
    }
    series->value = series->value_buffer;
    series->time = series->time_buffer;
    return load_window(set, series, 0);
}

gust_status gust_series_open(gust_series_set *set, int64_t block, double t, double *inputs)
{
    for (int32_t k = 0; k < set->n_series; ++k) {
        gust_series *series = &set->series[k];
        if (!open_window(set, series, block)) {
            return set->failure;
        }
        const double first = series->what->uniform ? series->what->t0 : series->time[0];
        if (gust_moment_end(t) < first) {
            gust_text(set->message, sizeof set->message,
                      "series \"%s\" begins at %g s, after the start of the simulation at %g s: start later "
                      "or extend the series",
                      series->what->name, first, t);
            set->failure = GUST_SERIES_NOT_COVERING;
            return set->failure;
        }
        if (series->what->on_end == GUST_SERIES_END_REPEAT) {
            const double period = series->what->t_end - series->what->t0;
            series->shift = floor((t - series->what->t0) / period) * period;
        }
    }
    find_end(set);
    bool changed = false;
    set->evaluated_at = NAN;
    set->opened = true;
    set->failure = GUST_OK;
    if (!gust_series_update(set, t, inputs, &changed) || !gust_series_evaluate(set, t, inputs)) {
        return set->failure;
    }
    return GUST_OK;
}

/* Before gust_series_open: only what needs no window can be looked at. */
static bool evaluate_unopened(gust_series_set *set, double t, double *inputs)
{
    for (int32_t k = 0; k < set->n_series; ++k) {
        gust_series *series = &set->series[k];
        double value = 0.0;
        if (series->value == NULL) {
            gust_text(set->message, sizeof set->message, "series \"%s\" can be read after initialise only",
                      series->what->name);
            return fail(set, GUST_BAD_ORDER);
        }
        const bool held = series->what->interpolation == GUST_SERIES_HOLD;
        if (!(held ? held_value(set, series, t, &value) : interpolated_value(set, series, t, &value))) {
            return false;
        }
        for (int64_t i = 0; i < series->what->n_slots; ++i) {
            inputs[series->what->slots[i]] = value;
        }
    }
    return true;
}

bool gust_series_evaluate(gust_series_set *set, double t, double *inputs)
{
    if (t == set->evaluated_at) {
        return true;
    }
    if (!set->opened) {
        return evaluate_unopened(set, t, inputs);
    }
    for (int32_t k = 0; k < set->n_series; ++k) {
        gust_series *series = &set->series[k];
        if (series->what->interpolation == GUST_SERIES_HOLD) {
            continue;
        }
        if (!interpolated_value(set, series, t, &series->latest)) {
            set->evaluated_at = NAN;
            return false;
        }
        for (int64_t i = 0; i < series->what->n_slots; ++i) {
            inputs[series->what->slots[i]] = series->latest;
        }
    }
    set->evaluated_at = t;
    return true;
}

bool gust_series_update(gust_series_set *set, double t, double *inputs, bool *changed)
{
    for (int32_t k = 0; k < set->n_series; ++k) {
        gust_series *series = &set->series[k];
        double wrap = INFINITY;
        if (series->what->on_end == GUST_SERIES_END_REPEAT) {
            const double period = series->what->t_end - series->what->t0;
            while (gust_moment_end(t) - series->shift >= series->what->t_end) {
                series->shift += period;
                set->evaluated_at = NAN;
                *changed = true;
            }
            wrap = series->what->t_end + series->shift;
        }
        if (series->what->interpolation == GUST_SERIES_HOLD) {
            double value = 0.0;
            if (!held_value(set, series, t, &value)) {
                return false;
            }
            for (int64_t i = 0; i < series->what->n_slots; ++i) {
                *changed = *changed || inputs[series->what->slots[i]] != value;
                inputs[series->what->slots[i]] = value;
            }
            series->next = fmin(series->next, wrap);
        } else {
            series->next = wrap;
        }
    }
    return true;
}

double gust_series_next(const gust_series_set *set)
{
    double next = INFINITY;
    for (int32_t k = 0; k < set->n_series; ++k) {
        next = set->series[k].next < next ? set->series[k].next : next;
    }
    return next;
}

/* -- checkpoints ---------------------------------------------------------------------------------------- */

void gust_series_archive(gust_series_set *set, gust_archive *archive)
{
    for (int32_t k = 0; k < set->n_series; ++k) {
        gust_series *series = &set->series[k];
        const bool in_model = series->what->source == GUST_SERIES_INLINE;
        series->saved_first = archive->mode == GUST_ARCHIVE_LOAD ? series->saved_first : series->first;
        /* The bound leaves room to multiply and add without overflow. */
        gust_archive_index(archive, "series.first", &series->saved_first, 0, in_model ? 0 : INT64_MAX / 64);
        gust_archive_index(archive, "series.n_total", &series->n_total, in_model ? series->n_total : 1,
                           INT64_MAX);
        gust_archive_doubles(archive, "series.end", &series->end, 1);
        gust_archive_doubles(archive, "series.shift", &series->shift, 1);
        gust_archive_doubles(archive, "series.next", &series->next, 1);
    }
}

bool gust_series_reopen(gust_series_set *set)
{
    for (int32_t k = 0; k < set->n_series; ++k) {
        gust_series *series = &set->series[k];
        const int64_t n_total = series->n_total;
        const double end = series->end;
        if (series->what->source != GUST_SERIES_INLINE && !load_window(set, series, series->saved_first)) {
            return false;
        }
        series->n_total = n_total;
        series->end = end;
        series->cubic_of = -1;
    }
    find_end(set);
    set->evaluated_at = NAN;
    return true;
}

/* -- looking ahead -------------------------------------------------------------------------------------- */

/* The window holds the samples from that at or before t on; moved forward if it ends before `until` and there
 * is more to be had. A quarter is kept for the way back. */
static bool look_ahead_to(gust_series_set *set, gust_series *series, double t, double until)
{
    double fraction = 0.0;
    if (series->what->uniform ? !locate_uniform(set, series, t, &fraction) : !locate_stamped(set, series, t)) {
        return false;
    }
    const bool more = series->first + series->count < series->n_total;
    if (!more || sample_time(series, series->count - 1) >= until || series->cursor < series->capacity / 2) {
        return true;
    }
    return load_window(set, series, series->first + series->cursor - series->capacity / 4) &&
           (series->what->uniform ? locate_uniform(set, series, t, &fraction) : locate_stamped(set, series, t));
}

/* gust_series_limit for one series, in its own time: the "swinging door". The slopes of lines from (t, value)
 * that pass within `width` of all samples so far are an interval; it can only narrow. */
static double limit_of(const gust_series *series, double t, double value, double until, double width)
{
    double lowest = -INFINITY;
    double highest = INFINITY;
    double limit = t;
    double before = t;
    double last = value;
    int64_t k = series->cursor;
    while (k < series->count && sample_time(series, k) <= gust_moment_end(t)) {
        ++k;
    }
    for (; k < series->count && sample_time(series, k) < until; ++k) {
        const double time = sample_time(series, k);
        const double per_time = 1.0 / (time - t);
        const double rise = series->value[k] - value;
        if (rise * per_time >= lowest && rise * per_time <= highest) {
            limit = time;
        }
        lowest = fmax(lowest, (rise - width) * per_time);
        highest = fmin(highest, (rise + width) * per_time);
        if (lowest > highest) {
            return limit;
        }
        before = time;
        last = series->value[k];
    }
    if (k == series->count && series->first + series->count < series->n_total) {
        return limit; /* more than the window can hold: as far as it reaches */
    }
    /* Between samples as on a straight line, after the last as it is. */
    const double end = k == series->count ? last
                                          : last + (series->value[k] - last) * (until - before) /
                                                       (sample_time(series, k) - before);
    const double slope = (end - value) / (until - t);
    return slope >= lowest && slope <= highest ? INFINITY : limit;
}

/* No sample lies within the step: nothing to look at. The commonest case, so told without finding the place. */
static bool within_interval(const gust_series *series, double t, double step)
{
    const double from = (t - series->what->t0) * series->step_inverse;
    return series->what->uniform && from + step * series->step_inverse < floor(from) + 1.0;
}

bool gust_series_limit(gust_series_set *set, double t, double step, double tolerance, double *limit)
{
    *limit = INFINITY;
    for (int32_t k = 0; k < set->n_series; ++k) {
        gust_series *series = &set->series[k];
        const double at = t - series->shift;
        if (series->what->interpolation == GUST_SERIES_HOLD || within_interval(series, at, step)) {
            continue;
        }
        double value = series->latest;
        if (!look_ahead_to(set, series, at, at + step) ||
            (t != set->evaluated_at && !interpolated_value(set, series, t, &value))) {
            return false;
        }
        const double own = limit_of(series, at, value, at + step, tolerance * series->size);
        if (own > at && own + series->shift < *limit) {
            *limit = own + series->shift;
        }
    }
    return true;
}
