/* What statistics consist of; the promises are in gust_stats.h. */
#ifndef GUSTFORM_STATS_H
#define GUSTFORM_STATS_H

#include "archive.h"
#include "gustform/gust_stats.h"
#include "histogram.h"
#include "moments.h"
#include "rainflow.h"
#include "welch.h"

/* Rows are worked off in blocks of this many, channel by channel: short loops over one column are several
 * times as fast as long ones over rows, and the sums round in the same way however rows arrive. */
enum { GUST_STATS_BLOCK = 256 };

typedef struct gust_stats_column {
    int32_t column;
    int64_t not_finite;
    gust_moments moments;
    gust_histogram histogram;
    gust_welch welch;
    gust_rainflow rainflow;
    double *block; /* [GUST_STATS_BLOCK] */
} gust_stats_column;

struct gust_stats {
    int32_t n_columns;
    int32_t n_channels;
    double interval;
    uint64_t identity; /* hash of the settings */
    int64_t rows;
    int32_t filled;
    double *time; /* [GUST_STATS_BLOCK] */
    gust_stats_column *channels;
    gust_welch_plan *plans; /* [n_channels], n_plans in use, one a segment length */
    int32_t n_plans;
    /* for results: the state with the rows of the unfinished block */
    double *finite; /* [GUST_STATS_BLOCK] */
    double *finite_time;
    gust_welch *welch;       /* [n_plans] */
    gust_rainflow *rainflow; /* [n_channels] */
};

/* The state, not the settings; their identity is part of it. */
void gust_stats_archive(gust_stats *stats, gust_archive *archive);

#endif
