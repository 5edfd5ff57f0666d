/* LU factors with a fixed pattern and fixed pivots, in flat arrays.
 *
 * KLU chooses the pivots; from then on new values are factored and systems solved here, P A Q = L D U with unit
 * diagonals of L and U. For some 30 unknowns that takes half to two thirds of the time of klu_refactor and
 * klu_solve, whose general storage, divisions and scaling cost more than the arithmetic. With fixed pivots
 * the rounding errors do not depend on the scaling of rows, so none is done. Columns are eliminated one
 * after the other, each by those before it ("left-looking").
 *
 * A triangular solve by columns is one long chain of dependent operations. Where n is small and the factors
 * serve many solves (a step needs little more than one, a Jacobian holds for dozens of steps), the inverse is
 * worked out once and applied as a dense product, several times as fast. Its error is of the size of that of
 * the triangular solves (N. J. Higham, Accuracy and Stability of Numerical Algorithms, SIAM 2002, ch. 14), and
 * it serves Newton corrections only. Where n is larger, the entries are used level by level: those of a level
 * do not depend on each other, so that the processor can work on several turbines at a time.
 * Source: T. A. Davis, E. Palamadai Natarajan, Algorithm 907: KLU, ACM TOMS 37 (2010). */
#ifndef GUSTFORM_LU_H
#define GUSTFORM_LU_H

#include <klu.h>
#include <stdbool.h>
#include <stdint.h>

enum {
    GUST_LU_DENSE = 64,  /* largest system of which the inverse is used */
    GUST_LU_PATIENCE = 1 /* solves before the inverse is worked out: a Newton step alone does without */
};

typedef struct gust_lu {
    int32_t n;
    int32_t *row_of;    /* [n] row of A that pivot k comes from */
    int32_t *column_of; /* [n] column of A that pivot k belongs to */
    /* entries of A by pivot column k: a_start[k] ... a_start[k + 1] - 1 */
    int32_t *a_start;  /* [n + 1] */
    int32_t *a_source; /* where in the values of A */
    int32_t *a_row;    /* pivot number of the row */
    /* L below the diagonal, by column */
    int32_t *l_start; /* [n + 1] */
    int32_t *l_row;
    int32_t *l_column;
    double *l_value;
    /* U above the diagonal, by column in descending order (the order in which a solve uses it): column k is
     * u_start[k + 1] ... u_start[k] - 1, its rows descending */
    int32_t *u_start; /* [n + 1] */
    int32_t *u_row;
    int32_t *u_column;
    double *u_value;
    /* larger systems: the entries of L and U again, in an order in which neighbours do not wait for each other
     */
    int32_t *lower_source; /* where in l_value; NULL if the system is small */
    int32_t *lower_row;
    int32_t *lower_column;
    double *lower_value;
    int32_t *upper_source;
    int32_t *upper_row;
    int32_t *upper_column;
    double *upper_value;
    double *pivot;          /* [n] D */
    double *pivot_inverse;  /* [n] */
    double *row_scale;      /* [n] 1 / largest entry of the row when the pivots were chosen */
    double *work;           /* [n], zero between calls of gust_lu_factor */
    int32_t singular_pivot; /* pivot number at which the last factorisation failed */
    /* small systems: A^-1 by columns, [n] columns of `padded` elements */
    int32_t padded;
    int32_t solves;  /* with the present factors */
    bool inverted;   /* inverse holds for the present factors */
    double *inverse; /* NULL if the system is not small */
} gust_lu;

/* Takes the pivots from KLU's factors of A and works out the pattern; the values are still to be set.
 * Allocates; false: no memory. What was there before is freed. Free with gust_lu_free. */
bool gust_lu_plan(gust_lu *lu, const int32_t *column_start, const int32_t *row_index, const double *values,
                  klu_symbolic *symbolic, klu_numeric *numeric, klu_common *common);
void gust_lu_free(gust_lu *lu);

/* Factors A with these values. false: a pivot is zero or not finite, see singular_pivot. */
bool gust_lu_factor(gust_lu *lu, const double *values);

/* Reciprocal pivot growth, as klu_rgrowth: the smallest over the columns of (largest entry of A) / (largest
 * entry of U), rows scaled. 1 is perfect, 1e-16 leaves no correct digit. */
double gust_lu_growth(const gust_lu *lu, const double *values);

/* solution = A^-1 right; both [gust_lane_padded(n)], or shorter only if n is larger than
 * GUST_LU_DENSE; the two may be one array. Elements beyond n of the solution are set to 0. */
void gust_lu_solve(gust_lu *lu, const double *right, double *solution);

#endif
