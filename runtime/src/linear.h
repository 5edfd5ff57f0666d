/* SUNMatrix in compressed columns with a fixed pattern, and a SUNLinearSolver over KLU for it.
 *
 * The pattern is analysed once. A new Jacobian is factored with the pivots of the one before (lu.h); where the
 * pivot growth shows that they have become bad, or the integrator did not converge, KLU chooses new ones. */
#ifndef GUSTFORM_LINEAR_H
#define GUSTFORM_LINEAR_H

#include <klu.h>
#include <stdbool.h>
#include <stdint.h>

#include "archive.h"
#include "lu.h"
#include "sundials_compat.h"

/* One factorisation of matrices of one pattern. */
typedef struct gust_factors {
    int32_t n;
    int32_t *column_start; /* belong to the model; KLU does not write to them */
    int32_t *row_index;
    klu_symbolic *symbolic; /* shared by all factors of a simulation; not owned */
    gust_lu lu;
    bool planned;       /* lu has pivots */
    double *chosen_for; /* [n_nonzeros] the values for which they were chosen */
    klu_common common;
    double growth_limit;  /* reciprocal pivot growth under which pivots are chosen anew */
    int64_t growth_check; /* refactorisations between two checks; 0: never */
    int64_t since_check;
    bool fresh_pivots;       /* the next one chooses pivots anew */
    int32_t singular_column; /* of the last factorisation that failed, -1 if none did */
    int64_t factorisations;
    int64_t refactorisations;
} gust_factors;

/* Prepares factors for an analysed pattern; nothing is factored yet. false: out of memory. Free with
 * gust_factors_free, also then. */
bool gust_factors_start(gust_factors *factors, int32_t n, const int32_t *column_start, const int32_t *row_index,
                        klu_symbolic *symbolic, const klu_common *common);
void gust_factors_free(gust_factors *factors);

/* Factors the matrix with these values. false: singular, or out of memory. */
bool gust_factors_set(gust_factors *factors, const double *values);

/* solution = matrix^-1 right, which may be one array. After gust_factors_set has been true. */
void gust_factors_solve(gust_factors *factors, const double *right, double *solution);

/* For checkpoints: which pivots are used, by the values they were chosen for, and when they are looked at
 * again. After loading, gust_factors_choose_again makes that choice (and allocates); false: it cannot be made.
 */
void gust_factors_archive(gust_factors *factors, gust_archive *archive);
bool gust_factors_choose_again(gust_factors *factors);
void gust_factors_archive_counters(gust_factors *factors, gust_archive *archive);

/* The matrix of the integrator: values[nnz] in the column order of the pattern. Free with SUNMatDestroy. */
SUNMatrix gust_matrix_new(int64_t n_nonzeros, SUNContext context);

static inline double *gust_matrix_values(SUNMatrix matrix)
{
    return *(double **)matrix->content;
}

/* The solver of the integrator, over `factors`, which must outlive it. Free with SUNLinSolFree. */
SUNLinearSolver gust_klu_new(gust_factors *factors, SUNContext context);

#endif
