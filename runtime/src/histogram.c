#include "histogram.h"

#include <string.h>

#include "memory.h"

bool gust_histogram_create(gust_histogram *histogram, const double *edges, int32_t n_edges)
{
    *histogram = (gust_histogram){.n_edges = n_edges};
    if (n_edges == 0) {
        return true;
    }
    histogram->edges = gust_allocate((size_t)n_edges, sizeof(double));
    histogram->count = gust_allocate((size_t)n_edges + 1, sizeof(int64_t));
    if (histogram->edges == NULL || histogram->count == NULL) {
        return false;
    }
    memcpy(histogram->edges, edges, (size_t)n_edges * sizeof(double));
    histogram->per_width = (n_edges - 1) / (edges[n_edges - 1] - edges[0]);
    return true;
}

void gust_histogram_free(gust_histogram *histogram)
{
    gust_release(histogram->edges);
    gust_release(histogram->count);
    *histogram = (gust_histogram){0};
}

/* Interval that holds x, which lies within the edges. */
static inline int32_t interval_of(const gust_histogram *histogram, double x)
{
    const double *edges = histogram->edges;
    const int32_t last = histogram->n_edges - 1;
    /* Right at once where edges are even, but for rounding. */
    int32_t guess = (int32_t)((x - edges[0]) * histogram->per_width);
    guess = guess >= last ? last - 1 : guess;
    if (x >= edges[guess] && (x < edges[guess + 1] || guess == last - 1)) {
        return guess;
    }
    int32_t low = 0;
    int32_t high = last;
    while (high - low > 1) {
        const int32_t middle = low + (high - low) / 2;
        if (x >= edges[middle]) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

int32_t gust_histogram_bin(const gust_histogram *histogram, double x)
{
    const int32_t last = histogram->n_edges - 1;
    if (x < histogram->edges[0]) {
        return 0;
    }
    return x > histogram->edges[last] ? last + 1 : interval_of(histogram, x) + 1;
}

void gust_histogram_add(gust_histogram *histogram, const double *x, int32_t n)
{
    for (int32_t i = 0; i < n; ++i) {
        ++histogram->count[gust_histogram_bin(histogram, x[i])];
    }
}

void gust_histogram_archive(gust_histogram *histogram, gust_archive *archive)
{
    if (histogram->n_edges > 0) {
        gust_archive_longs(archive, "histogram", histogram->count, histogram->n_edges + 1);
    }
}
