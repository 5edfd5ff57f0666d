/* Statistics of rows as they come, in constant memory: a year need not be stored to be judged.
 *
 *     gust_stats *stats;
 *     gust_stats_create(channels, n_channels, n_columns, 0.05, &stats, message, sizeof message);
 *     gust_stats_add(stats, rows, time, values);       // by hand, or
 *     gust_sim_set_statistics(sim, stats, 60.0);       // every row of a simulation from 60 s on
 *     gust_stats_moments(stats, 0, &moments);          // at any time; adding may go on afterwards
 *     gust_stats_destroy(&stats);
 *
 * After gust_stats_create nothing allocates. The same rows give the same bits, in whatever portions they were
 * added. A sample that is not finite is left out and counted; a spectrum begins a new segment there. */
#ifndef GUSTFORM_GUST_STATS_H
#define GUSTFORM_GUST_STATS_H

#include <stddef.h>
#include <stdint.h>

#include "gust_export.h"
#include "gust_status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct gust_stats gust_stats;

/* What is kept of one column; count, mean, deviation and extremes always are. The arrays are copied. */
typedef struct gust_stats_channel {
    int32_t column;  /* of a row, from 0 */
    int32_t n_edges; /* histogram: edges, ascending, at least 2; 0: none */
    const double *edges;
    int32_t segment;     /* spectrum: samples in a segment, a power of two from 8; 0: none */
    int32_t n_exponents; /* rainflow: exponents m of sums of n_i R_i^m, each greater than 0; 0: none */
    const double *exponents;
    int32_t n_ranges;   /* rainflow: bins of the histogram of ranges; 0: none */
    double range_width; /* their width, > 0 if there are any */
} gust_stats_channel;

typedef struct gust_stats_moments_result {
    int64_t count;      /* finite samples */
    int64_t not_finite; /* samples left out */
    double mean;        /* NaN if there are no samples, as all that follow */
    double deviation;   /* standard deviation of the samples: root of the mean square off the mean */
    double minimum;
    double t_minimum; /* time of the first such sample, s */
    double maximum;
    double t_maximum;
} gust_stats_moments_result;

typedef struct gust_stats_cycles_result {
    int64_t full;   /* cycles */
    int64_t half;   /* half cycles */
    int64_t forced; /* of the full ones, counted before they had closed for want of room: see rainflow.h */
    double largest; /* range */
} gust_stats_cycles_result;

/* Statistics of n_channels columns of rows of n_columns values each, `interval` (s) apart. On success *stats is
 * the caller's, to be given back by gust_stats_destroy; on an error it is NULL and message[size] says why. */
GUST_API gust_status gust_stats_create(const gust_stats_channel *channels, int32_t n_channels,
                                       int32_t n_columns, double interval, gust_stats **stats, char *message,
                                       size_t size);

/* Frees the statistics and sets *stats to NULL. Does nothing if it is NULL already. */
GUST_API void gust_stats_destroy(gust_stats **stats);

/* Adds rows: time[rows] (s), values[rows * n_columns], one row after the other. */
GUST_API gust_status gust_stats_add(gust_stats *stats, int64_t rows, const double *time, const double *values);

GUST_API double gust_stats_interval(const gust_stats *stats);
GUST_API int32_t gust_stats_n_columns(const gust_stats *stats);

/* Results for channel number `channel` (its place in `channels`), of all rows so far. BAD_ARGUMENT where there
 * is no such channel or it does not keep what is asked for. Arrays are the caller's; each may be NULL. */
GUST_API gust_status gust_stats_moments(gust_stats *stats, int32_t channel, gust_stats_moments_result *result);

/* count[n_edges - 1]; how many were below and above the edges. */
GUST_API gust_status gust_stats_histogram(gust_stats *stats, int32_t channel, int64_t *count, int64_t *below,
                                          int64_t *above);

/* density[segment / 2 + 1] in unit^2/Hz at k / (segment * interval) Hz, and how many segments it is the mean
 * of; NaN if none is complete. */
GUST_API gust_status gust_stats_spectrum(gust_stats *stats, int32_t channel, double *density,
                                         int64_t *segments);

/* damage[n_exponents]: sums of n_i R_i^m over cycles n_i (1 or 1/2) of range R_i; cycles[n_ranges + 1]: how
 * many in each bin of ranges and above them. Algorithm: ASTM E1049-85 5.4.4, see rainflow.h. */
GUST_API gust_status gust_stats_cycles(gust_stats *stats, int32_t channel, double *damage, double *cycles,
                                       gust_stats_cycles_result *result);

/* The whole state as bytes[gust_stats_size()], and back into statistics of the same settings (BAD_CHECKPOINT,
 * FOREIGN_CHECKPOINT if they are not). *used is how many bytes were written. */
GUST_API size_t gust_stats_size(gust_stats *stats);
GUST_API gust_status gust_stats_save(gust_stats *stats, void *bytes, size_t size, size_t *used);
GUST_API gust_status gust_stats_restore(gust_stats *stats, const void *bytes, size_t size);

#ifdef __cplusplus
}
#endif

#endif
