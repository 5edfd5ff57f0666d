/* Counts of samples between given edges: [e0, e1), [e1, e2), ..., the last interval closed, as numpy.histogram.
 */
#ifndef GUSTFORM_HISTOGRAM_H
#define GUSTFORM_HISTOGRAM_H

#include <stdint.h>

#include "archive.h"

typedef struct gust_histogram {
    int32_t n_edges;  /* 0: none is kept */
    double *edges;    /* [n_edges] */
    double per_width; /* 1 / mean distance of the edges: where to look first */
    int64_t *count;   /* [n_edges + 1]: below the edges, the intervals, above the edges */
} gust_histogram;

/* Copies the edges (n_edges >= 2, ascending). false: out of memory. Free with gust_histogram_free. */
bool gust_histogram_create(gust_histogram *histogram, const double *edges, int32_t n_edges);
void gust_histogram_free(gust_histogram *histogram);

/* Where x counts in `count`: 0 below the edges, 1 ... n_edges - 1 the intervals, n_edges above. */
int32_t gust_histogram_bin(const gust_histogram *histogram, double x);

void gust_histogram_add(gust_histogram *histogram, const double *x, int32_t n);

void gust_histogram_archive(gust_histogram *histogram, gust_archive *archive);

#endif
