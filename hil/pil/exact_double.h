/* Addition of doubles as bit patterns, see exact_double.c; the names are those that the linker's --wrap asks
 * for. */
#ifndef GUST_PIL_EXACT_DOUBLE_H
#define GUST_PIL_EXACT_DOUBLE_H

#include <stdint.h>

/* a + b, rounded to nearest even. */
uint64_t exact_add(uint64_t a, uint64_t b);

/* a + b, a - b and b - a in the place of the run-time ABI's. */
uint64_t __wrap___aeabi_dadd(uint64_t a, uint64_t b);
uint64_t __wrap___aeabi_dsub(uint64_t a, uint64_t b);
uint64_t __wrap___aeabi_drsub(uint64_t a, uint64_t b);

#endif
