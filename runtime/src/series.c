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

static bool check_window(gust_series_set *set, const gust_series *series)
{
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

/* Sample in the window at or before t; moves the window if need be. t before the first or after the last
 * sample gives the first or last. */
static bool locate_stamped(gust_series_set *set, gust_series *series, double t)
{
    while (t < series->time[0] && series->first > 0) {
        if (!load_window(set, series, series->first - series->capacity / 2)) {
            return false;
        }
    }
    while (t > series->time[series->count - 1] && series->first + series->count < series->n_total) {
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
    if (sample < series->first && !load_window(set, series, sample - series->capacity / 4)) {
        return false;
    }
    while (sample + 1 >= series->first + series->count && series->first + series->count < series->n_total) {
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

static bool linear_value(gust_series_set *set, gust_series *series, double t, double *value)
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
    *value = series->cursor + 1 < series->count ? sample[0] + fraction * (sample[1] - sample[0]) : sample[0];
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
        series->step_inverse = series->what->uniform ? 1.0 / series->what->dt : 0.0;
        series->end = series->what->t_end;
        series->next = INFINITY;
        if (series->what->source == GUST_SERIES_INLINE) {
            series->time = series->what->time;
            series->value = series->what->value;
            series->count = series->what->n_samples;
            series->n_total = series->count;
            series->end = last_time(series, sample_time(series, series->count - 1));
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
        if (!(held ? held_value(set, series, t, &value) : linear_value(set, series, t, &value))) {
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
        if (series->what->interpolation != GUST_SERIES_LINEAR) {
            continue;
        }
        double value = 0.0;
        if (!linear_value(set, series, t, &value)) {
            set->evaluated_at = NAN;
            return false;
        }
        for (int64_t i = 0; i < series->what->n_slots; ++i) {
            inputs[series->what->slots[i]] = value;
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
