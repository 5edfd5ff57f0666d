#include "stats.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "text.h"

static const char MAGIC[8] = {'G', 'U', 'S', 'T', 'S', 'T', 'A', '1'};

/* -- life ----------------------------------------------------------------------------------------------- */

static bool good_edges(const gust_stats_channel *channel)
{
    for (int32_t k = 0; k < channel->n_edges; ++k) {
        if (!isfinite(channel->edges[k]) || (k > 0 && !(channel->edges[k] > channel->edges[k - 1]))) {
            return false;
        }
    }
    return channel->n_edges == 0 ||
           (channel->n_edges >= 2 && isfinite(channel->edges[channel->n_edges - 1] - channel->edges[0]));
}

static bool good_exponents(const gust_stats_channel *channel)
{
    for (int32_t k = 0; k < channel->n_exponents; ++k) {
        if (!(channel->exponents[k] > 0.0 && isfinite(channel->exponents[k]))) {
            return false;
        }
    }
    return true;
}

enum { SHORTEST_SEGMENT = 8, LONGEST_SEGMENT = 16777216, MOST_BINS = 16777216 };

static bool good_segment(int32_t segment)
{
    int32_t power = SHORTEST_SEGMENT;
    while (power < segment && power < LONGEST_SEGMENT) {
        power *= 2;
    }
    return segment == 0 || power == segment;
}

/* What is wrong with the settings of a channel, NULL if nothing. */
static const char *fault_of(const gust_stats_channel *channel, int32_t n_columns)
{
    if (channel->column < 0 || channel->column >= n_columns) {
        return "there is no such column in a row";
    }
    if (channel->n_edges < 0 || channel->n_edges > MOST_BINS ||
        (channel->n_edges > 0 && channel->edges == NULL) || !good_edges(channel)) {
        return "the edges of a histogram must be at least 2 numbers in ascending order";
    }
    if (!good_segment(channel->segment)) {
        return "the segment of a spectrum must be a power of two from 8 to 16777216 samples";
    }
    if (channel->n_exponents < 0 || channel->n_exponents > MOST_BINS ||
        (channel->n_exponents > 0 && channel->exponents == NULL) || !good_exponents(channel)) {
        return "the exponents of damage must be greater than 0";
    }
    if (channel->n_ranges < 0 || channel->n_ranges > MOST_BINS ||
        (channel->n_ranges > 0 && !(channel->range_width > 0.0 && isfinite(channel->range_width)))) {
        return "bins of ranges must have a width greater than 0";
    }
    return NULL;
}

/* Two statistics may exchange their states if this is the same. */
static uint64_t identity_of(const gust_stats_channel *channels, int32_t n_channels, int32_t n_columns,
                            double interval)
{
    uint64_t hash = gust_hash(GUST_HASH_START, &n_columns, sizeof n_columns);
    hash = gust_hash(hash, &n_channels, sizeof n_channels);
    hash = gust_hash(hash, &interval, sizeof interval);
    for (int32_t k = 0; k < n_channels; ++k) {
        const gust_stats_channel *c = &channels[k];
        const int32_t counts[] = {c->column, c->n_edges, c->segment, c->n_exponents, c->n_ranges};
        const double width = c->n_ranges > 0 ? c->range_width : 0.0;
        hash = gust_hash(hash, counts, sizeof counts);
        hash = gust_hash(hash, c->edges, (size_t)c->n_edges * sizeof(double));
        hash = gust_hash(hash, c->exponents, (size_t)c->n_exponents * sizeof(double));
        hash = gust_hash(hash, &width, sizeof width);
    }
    return hash;
}

/* The plan for a segment length, made if there is none; NULL: out of memory. */
static gust_welch_plan *plan_for(gust_stats *stats, int32_t segment)
{
    for (int32_t k = 0; k < stats->n_plans; ++k) {
        if (stats->plans[k].fft.n == segment) {
            return &stats->plans[k];
        }
    }
    gust_welch_plan *made = &stats->plans[stats->n_plans++];
    return gust_welch_plan_create(made, segment, stats->interval) &&
                   gust_welch_create(&stats->welch[stats->n_plans - 1], made)
               ? made
               : NULL;
}

static bool create_column(gust_stats *stats, int32_t k, const gust_stats_channel *wanted)
{
    gust_stats_column *column = &stats->channels[k];
    column->column = wanted->column;
    gust_moments_start(&column->moments);
    gust_welch_plan *plan = wanted->segment > 0 ? plan_for(stats, wanted->segment) : NULL;
    if (wanted->segment > 0 && plan == NULL) {
        return false;
    }
    column->block = gust_allocate(GUST_STATS_BLOCK, sizeof(double));
    return column->block != NULL && gust_histogram_create(&column->histogram, wanted->edges, wanted->n_edges) &&
           gust_welch_create(&column->welch, plan) &&
           gust_rainflow_create(&column->rainflow, wanted->exponents, wanted->n_exponents, wanted->range_width,
                                wanted->n_ranges) &&
           gust_rainflow_create(&stats->rainflow[k], wanted->exponents, wanted->n_exponents,
                                wanted->range_width, wanted->n_ranges);
}

static bool create_columns(gust_stats *stats, const gust_stats_channel *channels)
{
    const size_t n = (size_t)stats->n_channels;
    stats->time = gust_allocate(GUST_STATS_BLOCK, sizeof(double));
    stats->finite = gust_allocate(GUST_STATS_BLOCK, sizeof(double));
    stats->finite_time = gust_allocate(GUST_STATS_BLOCK, sizeof(double));
    stats->channels = gust_allocate(n, sizeof *stats->channels);
    stats->plans = gust_allocate(n, sizeof *stats->plans);
    stats->welch = gust_allocate(n, sizeof *stats->welch);
    stats->rainflow = gust_allocate(n, sizeof *stats->rainflow);
    if (stats->time == NULL || stats->finite == NULL || stats->finite_time == NULL || stats->channels == NULL ||
        stats->plans == NULL || stats->welch == NULL || stats->rainflow == NULL) {
        return false;
    }
    for (int32_t k = 0; k < stats->n_channels; ++k) {
        if (!create_column(stats, k, &channels[k])) {
            return false;
        }
    }
    return true;
}

gust_status gust_stats_create(const gust_stats_channel *channels, int32_t n_channels, int32_t n_columns,
                              double interval, gust_stats **stats, char *message, size_t size)
{
    gust_text(message, size, "%s", "");
    if (stats == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    *stats = NULL;
    if (channels == NULL || n_channels < 1 || n_columns < 1 || !(interval > 0.0 && isfinite(interval))) {
        gust_text(message, size,
                  "statistics need at least one channel and an interval greater than 0 s; got %d and %g s",
                  n_channels, interval);
        return GUST_BAD_ARGUMENT;
    }
    for (int32_t k = 0; k < n_channels; ++k) {
        const char *fault = fault_of(&channels[k], n_columns);
        if (fault != NULL) {
            gust_text(message, size, "statistics of column %d: %s", channels[k].column, fault);
            return GUST_BAD_ARGUMENT;
        }
    }
    gust_stats *made = gust_allocate(1, sizeof *made);
    if (made != NULL) {
        made->n_columns = n_columns;
        made->n_channels = n_channels;
        made->interval = interval;
        made->identity = identity_of(channels, n_channels, n_columns, interval);
    }
    if (made == NULL || !create_columns(made, channels)) {
        gust_stats_destroy(&made);
        gust_text(message, size, "out of memory for the statistics of %d channels", n_channels);
        return GUST_OUT_OF_MEMORY;
    }
    *stats = made;
    return GUST_OK;
}

void gust_stats_destroy(gust_stats **stats)
{
    if (stats == NULL || *stats == NULL) {
        return;
    }
    gust_stats *old = *stats;
    for (int32_t k = 0; old->channels != NULL && k < old->n_channels; ++k) {
        gust_release(old->channels[k].block);
        gust_histogram_free(&old->channels[k].histogram);
        gust_welch_free(&old->channels[k].welch);
        gust_rainflow_free(&old->channels[k].rainflow);
    }
    for (int32_t k = 0; old->rainflow != NULL && k < old->n_channels; ++k) {
        gust_rainflow_free(&old->rainflow[k]);
    }
    for (int32_t k = 0; k < old->n_plans; ++k) {
        gust_welch_free(&old->welch[k]);
        gust_welch_plan_free(&old->plans[k]);
    }
    void *const blocks[] = {old->time,  old->finite, old->finite_time, old->channels,
                            old->plans, old->welch,  old->rainflow};
    for (size_t k = 0; k < sizeof blocks / sizeof blocks[0]; ++k) {
        gust_release(blocks[k]);
    }
    gust_release(old);
    *stats = NULL;
}

double gust_stats_interval(const gust_stats *stats)
{
    return stats->interval;
}

int32_t gust_stats_n_columns(const gust_stats *stats)
{
    return stats->n_columns;
}

/* -- rows ----------------------------------------------------------------------------------------------- */

static bool all_finite(const double *x, int32_t n)
{
    /* 0 times a finite number is 0, anything else is not. */
    double lane[4] = {0.0, 0.0, 0.0, 0.0};
    int32_t i = 0;
    for (; i + 4 <= n; i += 4) {
        for (int k = 0; k < 4; ++k) {
            lane[k] += 0.0 * x[i + k];
        }
    }
    for (; i < n; ++i) {
        lane[0] += 0.0 * x[i];
    }
    return (lane[0] + lane[1]) + (lane[2] + lane[3]) == 0.0;
}

/* The finite samples of n, closed up, into finite[] and finite_time[]; how many. */
static int32_t close_up(gust_stats *stats, const double *x, const double *time, int32_t n)
{
    int32_t kept = 0;
    for (int32_t i = 0; i < n; ++i) {
        if (isfinite(x[i])) {
            stats->finite[kept] = x[i];
            stats->finite_time[kept++] = time[i];
        }
    }
    return kept;
}

/* Spectra do not close gaps. */
static void add_with_gaps(gust_welch *welch, const double *x, int32_t n)
{
    int32_t first = 0;
    for (int32_t i = 0; i <= n; ++i) {
        if (i == n || !isfinite(x[i])) {
            gust_welch_add(welch, x + first, i - first);
            first = i + 1;
        }
        if (i < n && !isfinite(x[i])) {
            gust_welch_break(welch);
        }
    }
}

/* Works off the block, which is full. */
static void work_off(gust_stats *stats)
{
    for (int32_t k = 0; k < stats->n_channels; ++k) {
        gust_stats_column *column = &stats->channels[k];
        const double *x = column->block;
        const double *time = stats->time;
        int32_t n = stats->filled;
        if (all_finite(x, n)) {
            if (column->welch.plan != NULL) {
                gust_welch_add(&column->welch, x, n);
            }
        } else {
            if (column->welch.plan != NULL) {
                add_with_gaps(&column->welch, x, n);
            }
            const int32_t kept = close_up(stats, x, time, n);
            column->not_finite += n - kept;
            x = stats->finite;
            time = stats->finite_time;
            n = kept;
        }
        gust_moments_add(&column->moments, x, time, n);
        if (column->histogram.n_edges > 0) {
            gust_histogram_add(&column->histogram, x, n);
        }
        if (column->rainflow.open != NULL) {
            gust_rainflow_add(&column->rainflow, x, n);
        }
    }
    stats->filled = 0;
}

gust_status gust_stats_add(gust_stats *stats, int64_t rows, const double *time, const double *values)
{
    if (stats == NULL || rows < 0 || (rows > 0 && (time == NULL || values == NULL))) {
        return GUST_BAD_ARGUMENT;
    }
    while (rows > 0) {
        const int64_t room = GUST_STATS_BLOCK - stats->filled;
        const int32_t taken = (int32_t)(rows < room ? rows : room);
        memcpy(stats->time + stats->filled, time, (size_t)taken * sizeof *time);
        for (int32_t k = 0; k < stats->n_channels; ++k) {
            const double *from = values + stats->channels[k].column;
            double *to = stats->channels[k].block + stats->filled;
            for (int32_t i = 0; i < taken; ++i) {
                to[i] = from[(int64_t)i * stats->n_columns];
            }
        }
        stats->filled += taken;
        stats->rows += taken;
        rows -= taken;
        time += taken;
        values += (int64_t)taken * stats->n_columns;
        if (stats->filled == GUST_STATS_BLOCK) {
            work_off(stats);
        }
    }
    return GUST_OK;
}

/* -- results -------------------------------------------------------------------------------------------- */

/* The rows of the unfinished block are counted in copies, so that asking changes nothing. */

static gust_stats_column *channel_of(gust_stats *stats, int32_t channel)
{
    return stats != NULL && channel >= 0 && channel < stats->n_channels ? &stats->channels[channel] : NULL;
}

gust_status gust_stats_moments(gust_stats *stats, int32_t channel, gust_stats_moments_result *result)
{
    const gust_stats_column *column = channel_of(stats, channel);
    if (column == NULL || result == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    gust_moments all = column->moments;
    const int32_t kept = close_up(stats, column->block, stats->time, stats->filled);
    gust_moments_add(&all, stats->finite, stats->finite_time, kept);
    const bool any = all.count > 0;
    *result = (gust_stats_moments_result){
        .count = all.count,
        .not_finite = column->not_finite + stats->filled - kept,
        .mean = any ? all.mean : NAN,
        .deviation = any ? sqrt(fmax(all.squares, 0.0) / (double)all.count) : NAN,
        .minimum = any ? all.minimum : NAN,
        .t_minimum = all.t_minimum,
        .maximum = any ? all.maximum : NAN,
        .t_maximum = all.t_maximum,
    };
    return GUST_OK;
}

gust_status gust_stats_histogram(gust_stats *stats, int32_t channel, int64_t *count, int64_t *below,
                                 int64_t *above)
{
    const gust_stats_column *column = channel_of(stats, channel);
    if (column == NULL || column->histogram.n_edges == 0) {
        return GUST_BAD_ARGUMENT;
    }
    const gust_histogram *histogram = &column->histogram;
    const int32_t n_bins = histogram->n_edges - 1;
    const int32_t kept = close_up(stats, column->block, stats->time, stats->filled);
    int64_t outside[2] = {histogram->count[0], histogram->count[n_bins + 1]};
    if (count != NULL) {
        memcpy(count, histogram->count + 1, (size_t)n_bins * sizeof *count);
    }
    for (int32_t i = 0; i < kept; ++i) {
        const int32_t bin = gust_histogram_bin(histogram, stats->finite[i]);
        if (bin == 0 || bin == n_bins + 1) {
            ++outside[bin == 0 ? 0 : 1];
        } else if (count != NULL) {
            ++count[bin - 1];
        }
    }
    if (below != NULL) {
        *below = outside[0];
    }
    if (above != NULL) {
        *above = outside[1];
    }
    return GUST_OK;
}

gust_status gust_stats_spectrum(gust_stats *stats, int32_t channel, double *density, int64_t *segments)
{
    const gust_stats_column *column = channel_of(stats, channel);
    if (column == NULL || column->welch.plan == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    const int32_t n = column->welch.plan->fft.n;
    gust_welch *all = &stats->welch[column->welch.plan - stats->plans];
    all->filled = column->welch.filled;
    all->segments = column->welch.segments;
    memcpy(all->buffer, column->welch.buffer, (size_t)n * sizeof(double));
    memcpy(all->sum, column->welch.sum, (size_t)(n / 2 + 1) * sizeof(double));
    add_with_gaps(all, column->block, stats->filled);
    for (int32_t k = 0; density != NULL && k <= n / 2; ++k) {
        density[k] = all->segments > 0 ? all->sum[k] / (double)all->segments : NAN;
    }
    if (segments != NULL) {
        *segments = all->segments;
    }
    return GUST_OK;
}

gust_status gust_stats_cycles(gust_stats *stats, int32_t channel, double *damage, double *cycles,
                              gust_stats_cycles_result *result)
{
    const gust_stats_column *column = channel_of(stats, channel);
    if (column == NULL || column->rainflow.open == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    gust_rainflow *all = &stats->rainflow[channel];
    gust_rainflow_copy(all, &column->rainflow);
    gust_rainflow_add(all, stats->finite, close_up(stats, column->block, stats->time, stats->filled));
    gust_rainflow_finish(all);
    const gust_rainflow_counts *counts = &all->counts;
    if (damage != NULL) {
        memcpy(damage, counts->damage, (size_t)all->n_exponents * sizeof *damage);
    }
    if (cycles != NULL) {
        memcpy(cycles, counts->cycles, (size_t)(all->n_ranges + 1) * sizeof *cycles);
    }
    if (result != NULL) {
        *result = (gust_stats_cycles_result){counts->full, counts->half, counts->forced, counts->largest};
    }
    return GUST_OK;
}

/* -- state ---------------------------------------------------------------------------------------------- */

void gust_stats_archive(gust_stats *stats, gust_archive *archive)
{
    gust_archive_same_identity(archive, "stats.identity", stats->identity);
    gust_archive_longs(archive, "stats.rows", &stats->rows, 1);
    gust_archive_small_index(archive, "stats.filled", &stats->filled, 0, GUST_STATS_BLOCK - 1);
    gust_archive_doubles(archive, "stats.time", stats->time, GUST_STATS_BLOCK);
    for (int32_t k = 0; k < stats->n_channels; ++k) {
        gust_stats_column *column = &stats->channels[k];
        gust_archive_longs(archive, "stats.not_finite", &column->not_finite, 1);
        gust_archive_doubles(archive, "stats.block", column->block, GUST_STATS_BLOCK);
        gust_moments_archive(&column->moments, archive);
        gust_histogram_archive(&column->histogram, archive);
        gust_welch_archive(&column->welch, archive);
        gust_rainflow_archive(&column->rainflow, archive);
    }
}

size_t gust_stats_size(gust_stats *stats)
{
    gust_archive archive = {.mode = GUST_ARCHIVE_MEASURE, .good = true};
    gust_stats_archive(stats, &archive);
    return gust_archive_total(&archive);
}

gust_status gust_stats_save(gust_stats *stats, void *bytes, size_t size, size_t *used)
{
    if (stats == NULL || bytes == NULL || size < GUST_ARCHIVE_HEADER) {
        return GUST_BAD_ARGUMENT;
    }
    gust_archive archive;
    gust_archive_begin(&archive, bytes, size);
    gust_stats_archive(stats, &archive);
    if (!archive.good) {
        return GUST_BAD_ARGUMENT;
    }
    gust_archive_seal(&archive, MAGIC, stats->identity);
    if (used != NULL) {
        *used = archive.at;
    }
    return GUST_OK;
}

gust_status gust_stats_restore(gust_stats *stats, const void *bytes, size_t size)
{
    if (stats == NULL || bytes == NULL) {
        return GUST_BAD_ARGUMENT;
    }
    gust_archive archive;
    const gust_archive_fault fault = gust_archive_open(&archive, bytes, size, MAGIC, stats->identity);
    if (fault != GUST_ARCHIVE_SOUND) {
        return fault == GUST_ARCHIVE_FOREIGN ? GUST_FOREIGN_CHECKPOINT : GUST_BAD_CHECKPOINT;
    }
    gust_stats_archive(stats, &archive);
    return archive.good && archive.at == size ? GUST_OK : GUST_BAD_CHECKPOINT;
}
