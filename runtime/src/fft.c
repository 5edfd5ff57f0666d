#include "fft.h"

#include <math.h>

#include "memory.h"

bool gust_fft_create(gust_fft *fft, int32_t n)
{
    const int32_t half = n / 2;
    *fft = (gust_fft){.n = n};
    fft->cosine = gust_allocate((size_t)half, sizeof(double));
    fft->sine = gust_allocate((size_t)half, sizeof(double));
    fft->reverse = gust_allocate((size_t)half, sizeof(int32_t));
    if (fft->cosine == NULL || fft->sine == NULL || fft->reverse == NULL) {
        return false;
    }
    for (int32_t k = 0; k < half; ++k) {
        const double angle = 6.283185307179586476925 * k / n;
        fft->cosine[k] = cos(angle);
        fft->sine[k] = sin(angle);
        fft->reverse[k] = (fft->reverse[k / 2] + (k % 2 != 0 ? half : 0)) / 2;
    }
    return true;
}

void gust_fft_free(gust_fft *fft)
{
    gust_release(fft->cosine);
    gust_release(fft->sine);
    gust_release(fft->reverse);
    *fft = (gust_fft){0};
}

/* Complex transform of `half` points that stand in reversed order. */
static void transform(const gust_fft *fft, double *restrict re, double *restrict im)
{
    const int32_t half = fft->n / 2;
    for (int32_t size = 2; size <= half; size *= 2) {
        const int32_t apart = size / 2;
        const int32_t stride = fft->n / size;
        for (int32_t first = 0; first < half; first += size) {
            for (int32_t k = 0; k < apart; ++k) {
                const double c = fft->cosine[(int64_t)k * stride];
                const double s = -fft->sine[(int64_t)k * stride];
                const int32_t a = first + k;
                const int32_t b = a + apart;
                const double turned_re = re[b] * c - im[b] * s;
                const double turned_im = re[b] * s + im[b] * c;
                re[b] = re[a] - turned_re;
                im[b] = im[a] - turned_im;
                re[a] += turned_re;
                im[a] += turned_im;
            }
        }
    }
}

void gust_fft_power(const gust_fft *fft, const double *x, double *re, double *im, double *power)
{
    const int32_t half = fft->n / 2;
    for (int32_t k = 0; k < half; ++k) {
        const double *pair = x + 2 * (int64_t)k;
        re[fft->reverse[k]] = pair[0];
        im[fft->reverse[k]] = pair[1];
    }
    transform(fft, re, im);
    power[0] = (re[0] + im[0]) * (re[0] + im[0]);
    power[half] = (re[0] - im[0]) * (re[0] - im[0]);
    for (int32_t k = 1; k < half; ++k) {
        /* Z_k of even + i odd samples: X_k = E_k + e^(-2 pi i k / n) O_k */
        const int32_t m = half - k;
        const double even_re = 0.5 * (re[k] + re[m]);
        const double even_im = 0.5 * (im[k] - im[m]);
        const double odd_re = 0.5 * (im[k] + im[m]);
        const double odd_im = -0.5 * (re[k] - re[m]);
        const double c = fft->cosine[k];
        const double s = fft->sine[k];
        const double x_re = even_re + odd_re * c + odd_im * s;
        const double x_im = even_im + odd_im * c - odd_re * s;
        power[k] = x_re * x_re + x_im * x_im;
    }
}
