/* Count, mean, standard deviation and extremes of a stream, block by block.
 *
 * The mean and the squares of a block are summed about the block's own mean and merged into the whole
 * (T. F. Chan, G. H. Golub, R. J. LeVeque, The American Statistician 37 (1983) 242): the error grows with the
 * number of blocks, not of samples, and nothing is cancelled where the mean is large. */
#ifndef GUSTFORM_MOMENTS_H
#define GUSTFORM_MOMENTS_H

#include <stdint.h>

#include "archive.h"

typedef struct gust_moments {
    int64_t count;
    double mean;
    double squares; /* sum of (x - mean)^2 */
    double minimum;
    double maximum;
    double t_minimum; /* time of the first sample that small, s */
    double t_maximum;
} gust_moments;

void gust_moments_start(gust_moments *moments);

/* n finite samples with their times; x must start on a cache line. */
void gust_moments_add(gust_moments *moments, const double *x, const double *time, int32_t n);

void gust_moments_archive(gust_moments *moments, gust_archive *archive);

#endif
