/* Result rows at a fixed interval: collected into blocks for a receiver, or given to statistics one by one. */
#ifndef GUSTFORM_SINK_H
#define GUSTFORM_SINK_H

#include <stdint.h>

#include "stats.h"
#include "system.h"

/* The recorded outputs of one instance: entries first .. first + count - 1 of the plan. */
typedef struct gust_sink_group {
    const gust_block *block;
    int32_t instance;
    int32_t first;
    int32_t count;
} gust_sink_group;

typedef struct gust_sink {
    const gust_model *model;
    gust_row_sink receive; /* NULL, and no statistics: nobody wants rows */
    void *context;
    gust_stats *stats; /* the caller's */
    double interval;
    int32_t block_rows;
    double start;     /* time of row 0, s */
    int64_t next_row; /* number of the next row */
    double next_time; /* its time, s; infinite if nobody wants rows */
    int32_t filled;   /* rows in the block */
    double *time;     /* [block_rows] */
    float *values;    /* [block_rows * n_channels] */
    double *row;      /* [n_channels] */
    int32_t *copied;  /* channels that are unknowns of the system */
    int32_t n_copied;
    gust_sink_group *groups;
    int32_t n_groups;
    int32_t *output;  /* plan: output number ... */
    int32_t *channel; /* ... and the channel it fills */
    bool derivatives; /* some output is recorded, so y' is needed */
} gust_sink;

/* Works out which unknowns and which outputs of which instances are wanted: those of all channels, or of the
 * channels that `stats` (may be NULL) looks at. Free with gust_sink_free. */
gust_status gust_sink_create(gust_sink *sink, const gust_system *system, gust_stats *stats);
void gust_sink_free(gust_sink *sink);

/* Allocates the block, if there is a receiver; the first row is due at `start`. */
gust_status gust_sink_open(gust_sink *sink, double start);

/* All channels that are wanted for (t, y, y') into row[n_channels]. false if a time series failed. */
bool gust_sink_evaluate(gust_sink *sink, gust_system *system, double t, const double *y, const double *yp,
                        double *row);

/* Adds the row that is due, for its time sink->next_time; hands the block over when it is full. */
gust_status gust_sink_add(gust_sink *sink, gust_system *system, const double *y, const double *yp);

/* For checkpoints, after a flush: what kind of rows, which must be the same when loading; and the place in the
 * grid. */
void gust_sink_archive_kind(gust_sink *sink, gust_archive *archive);
void gust_sink_archive(gust_sink *sink, gust_archive *archive);

/* Hands over what has been collected. */
gust_status gust_sink_flush(gust_sink *sink);

#endif
