/* Power spectral density by P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70: segments of a power of
 * two samples that overlap by half, the mean of each taken off, Hann window, periodograms averaged. One-sided,
 * unit^2/Hz: scipy.signal.welch with nperseg = segment and its defaults. A last, incomplete segment does not
 * count. */
#ifndef GUSTFORM_WELCH_H
#define GUSTFORM_WELCH_H

#include <stdint.h>

#include "archive.h"
#include "fft.h"

/* What all spectra of one segment length share. */
typedef struct gust_welch_plan {
    gust_fft fft;
    double *window;   /* [segment] */
    double scale;     /* 2 / (sampling rate * sum of window^2) */
    double *windowed; /* scratch [segment] */
    double *re;       /* scratch [segment / 2] */
    double *im;
    double *power; /* scratch [segment / 2 + 1] */
} gust_welch_plan;

typedef struct gust_welch {
    gust_welch_plan *plan; /* NULL: none is kept; not owned */
    int32_t filled;
    int64_t segments;
    double *buffer; /* [segment] */
    double *sum;    /* [segment / 2 + 1] of the densities */
} gust_welch;

bool gust_welch_plan_create(gust_welch_plan *plan, int32_t segment, double interval);
void gust_welch_plan_free(gust_welch_plan *plan);

bool gust_welch_create(gust_welch *welch, gust_welch_plan *plan);
void gust_welch_free(gust_welch *welch);

void gust_welch_add(gust_welch *welch, const double *x, int32_t n);

/* Begins a new segment: samples are missing here. */
void gust_welch_break(gust_welch *welch);

void gust_welch_archive(gust_welch *welch, gust_archive *archive);

#endif
