/* Discrete Fourier transform of real data, length a power of two from 4: as one complex transform of half the
 * length (W. H. Press et al., Numerical Recipes, Cambridge 2007, 12.3), radix 2, in place. */
#ifndef GUSTFORM_FFT_H
#define GUSTFORM_FFT_H

#include <stdbool.h>
#include <stdint.h>

typedef struct gust_fft {
    int32_t n;        /* real samples */
    double *cosine;   /* [n / 2] cos(2 pi k / n) */
    double *sine;     /* [n / 2] sin(2 pi k / n) */
    int32_t *reverse; /* [n / 2] bits of k reversed */
} gust_fft;

/* false: out of memory. Free with gust_fft_free, also then. */
bool gust_fft_create(gust_fft *fft, int32_t n);
void gust_fft_free(gust_fft *fft);

/* |X_k|^2 of x[n] into power[n / 2 + 1]; re and im are scratch [n / 2]. */
void gust_fft_power(const gust_fft *fft, const double *x, double *re, double *im, double *power);

#endif
