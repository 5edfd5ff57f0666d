/* Doubles that one vector instruction takes, for the loops the speed of the integrator hangs on.
 *
 * The compiler's own vectoriser peels and finishes loops of unknown length, which for some 30 elements costs
 * more than the loop; these say what is meant: whole registers over arrays that are padded to
 * GUST_LANE_BLOCK elements and start on a cache line. The width is that of the machine compiled for, since
 * a wider vector than it has goes through memory (measured with GCC 12, AVX2: 7 times as many instructions
 * in the dense product of lu.c). */
#ifndef GUSTFORM_LANES_H
#define GUSTFORM_LANES_H

#include <stdint.h>

#if defined(__AVX512F__)
#define GUST_LANES 8
#elif defined(__AVX__)
#define GUST_LANES 4
#else
#define GUST_LANES 2
#endif

enum {
    GUST_LANE_BLOCK = 8, /* what lengths are rounded up to, on every machine */
    GUST_BLOCK_LANES = GUST_LANE_BLOCK / GUST_LANES
};

typedef double gust_lanes __attribute__((vector_size(GUST_LANES * sizeof(double)), may_alias));

/* `length` rounded up to whole blocks. */
static inline int64_t gust_lane_padded(int64_t length)
{
    return (length + GUST_LANE_BLOCK - 1) / GUST_LANE_BLOCK * GUST_LANE_BLOCK;
}

/* The same doubles as lanes; they must start on a cache line. */
static inline gust_lanes *gust_lanes_of(double *data)
{
    return (gust_lanes *)__builtin_assume_aligned(data, 64);
}

static inline const gust_lanes *gust_lanes_in(const double *data)
{
    return (const gust_lanes *)__builtin_assume_aligned(data, 64);
}

/* Sum of a block of partial sums, in one order on every machine. */
static inline double gust_lane_sum(const gust_lanes block[GUST_BLOCK_LANES])
{
    double lane[GUST_LANE_BLOCK];
    for (int v = 0; v < GUST_BLOCK_LANES; ++v) {
        for (int k = 0; k < GUST_LANES; ++k) {
            lane[v * GUST_LANES + k] = block[v][k];
        }
    }
    return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

#endif
