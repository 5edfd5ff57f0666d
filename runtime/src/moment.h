/* Times that differ by rounding only are one moment. */
#ifndef GUSTFORM_MOMENT_H
#define GUSTFORM_MOMENT_H

#include <float.h>
#include <math.h>

/* The latest time that is still the same moment as t; the width is that within which the integrator
 * counts a stop time as reached. */
static inline double gust_moment_end(double t)
{
    return t + 100.0 * DBL_EPSILON * fabs(t);
}

#endif
