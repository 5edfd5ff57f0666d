/* Addition and subtraction of doubles in integers, rounded to nearest even, for cores without such hardware.
 *
 * GCC's own (libgcc, __aeabi_dadd) drops the bits that decide a tie when the operands are about 2^33 apart: the
 * last bit of one sum in some hundred of that kind is wrong. With these, linked by -Wl,--wrap=__aeabi_dadd and
 * so on, a Cortex-M4F gives the bits of IEEE 754. Arguments are bit patterns: the run-time ABI passes doubles
 * in core registers.
 */
#include "exact_double.h"

#define SIGN     (UINT64_C(1) << 63)
#define INFINITE (UINT64_C(0x7FF) << 52)
#define FRACTION ((UINT64_C(1) << 52) - 1U)
#define QUIET    (INFINITE | (UINT64_C(1) << 51))

/* The exponent of a finite number; that of the smallest normal one for all below it. */
static uint32_t exponent(uint64_t x)
{
    const uint32_t e = (uint32_t)((x & INFINITE) >> 52);
    return (e == 0U) ? 1U : e;
}

/* The significand with three more bits behind it: a guard, a second one, and whether anything follows. */
static uint64_t mantissa(uint64_t x)
{
    const uint64_t hidden = ((x & INFINITE) != 0U) ? (UINT64_C(1) << 52) : 0U;
    return ((x & FRACTION) | hidden) << 3;
}

static uint64_t shifted_right(uint64_t m, uint32_t by)
{
    if (by > 60U) {
        return (m != 0U) ? 1U : 0U;
    }
    const uint64_t lost = m & ((UINT64_C(1) << by) - 1U);
    return (m >> by) | ((lost != 0U) ? 1U : 0U);
}

/* Significand with its three bits, and exponent, to a number. */
static uint64_t rounded(uint64_t m, uint32_t e)
{
    const uint32_t rest = (uint32_t)(m & 7U);
    uint64_t whole = m >> 3;
    if (rest > 4U || (rest == 4U && (whole & 1U) != 0U)) {
        whole++;
    }
    /* A carry out of the significand, or into the first normal number, raises the exponent by itself. */
    const uint64_t result = ((uint64_t)(e - 1U) << 52) + whole;
    return (result >= INFINITE) ? INFINITE : result;
}

static uint64_t not_finite(uint64_t a, uint64_t b)
{
    const uint64_t p = a & ~SIGN;
    const uint64_t q = b & ~SIGN;
    if (p > INFINITE || q > INFINITE || (p == q && a != b)) {
        return QUIET;
    }
    return (p == INFINITE) ? a : b;
}

uint64_t exact_add(uint64_t a, uint64_t b)
{
    if ((a & ~SIGN) < (b & ~SIGN)) {
        const uint64_t larger = b;
        b = a;
        a = larger;
    }
    if ((a & ~SIGN) >= INFINITE) {
        return not_finite(a, b);
    }
    const uint64_t sign = a & SIGN;
    uint32_t e = exponent(a);
    const uint64_t p = mantissa(a);
    const uint64_t q = shifted_right(mantissa(b), e - exponent(b));
    if (sign == (b & SIGN)) {
        uint64_t sum = p + q;
        if ((sum >> 56) != 0U) {
            sum = shifted_right(sum, 1U);
            e++;
        }
        return sign | rounded(sum, e);
    }
    uint64_t difference = p - q;
    if (difference == 0U) {
        return 0U;
    }
    uint32_t up = (uint32_t)__builtin_clzll(difference) - 8U;
    if (up >= e) {
        up = e - 1U;
    }
    difference <<= up;
    return sign | rounded(difference, e - up);
}

uint64_t __wrap___aeabi_dadd(uint64_t a, uint64_t b)
{
    return exact_add(a, b);
}

uint64_t __wrap___aeabi_dsub(uint64_t a, uint64_t b)
{
    return exact_add(a, b ^ SIGN);
}

uint64_t __wrap___aeabi_drsub(uint64_t a, uint64_t b)
{
    return exact_add(a ^ SIGN, b);
}
