#include "linear.h"

#include <string.h>

#include "memory.h"
#include "vector.h"

/* -- factors -------------------------------------------------------------------------------------------- */

/* KLU's arguments are not const although it only reads them. */
static int32_t *writable(const int32_t *array)
{
    int32_t *same;
    memcpy(&same, &array, sizeof same);
    return same;
}

void gust_factors_start(gust_factors *factors, int32_t n, const int32_t *column_start, const int32_t *row_index,
                        klu_symbolic *symbolic, const klu_common *common)
{
    *factors = (gust_factors){.n = n,
                              .column_start = writable(column_start),
                              .row_index = writable(row_index),
                              .symbolic = symbolic,
                              .common = *common,
                              .growth_limit = 1e-8,
                              .singular_column = -1};
}

void gust_factors_free(gust_factors *factors)
{
    if (factors->numeric != NULL) {
        klu_free_numeric(&factors->numeric, &factors->common);
    }
}

static bool factor(gust_factors *factors, double *values)
{
    if (factors->numeric != NULL) {
        klu_free_numeric(&factors->numeric, &factors->common);
    }
    ++factors->factorisations;
    factors->since_check = 0;
    factors->fresh_pivots = false;
    factors->numeric =
        klu_factor(factors->column_start, factors->row_index, values, factors->symbolic, &factors->common);
    factors->singular_column = -1;
    if (factors->numeric == NULL || factors->common.status != KLU_OK) {
        factors->fresh_pivots = true;
        factors->singular_column = factors->common.status == KLU_SINGULAR ? factors->common.singular_col : -1;
        return false;
    }
    return true;
}

static bool grown(gust_factors *factors, double *values)
{
    if (factors->growth_check == 0 || ++factors->since_check < factors->growth_check) {
        return false;
    }
    factors->since_check = 0;
    return klu_rgrowth(factors->column_start, factors->row_index, values, factors->symbolic, factors->numeric,
                       &factors->common) != 1 ||
           factors->common.rgrowth < factors->growth_limit;
}

bool gust_factors_set(gust_factors *factors, double *values)
{
    if (factors->numeric == NULL || factors->fresh_pivots) {
        return factor(factors, values);
    }
    ++factors->refactorisations;
    const int done = klu_refactor(factors->column_start, factors->row_index, values, factors->symbolic,
                                  factors->numeric, &factors->common);
    if (done != 1 || factors->common.status != KLU_OK || grown(factors, values)) {
        return factor(factors, values);
    }
    return true;
}

bool gust_factors_solve(gust_factors *factors, double *right)
{
    return factors->numeric != NULL &&
           klu_solve(factors->symbolic, factors->numeric, factors->n, 1, right, &factors->common) == 1;
}

bool gust_factors_solve_transposed(gust_factors *factors, double *right)
{
    return factors->numeric != NULL &&
           klu_tsolve(factors->symbolic, factors->numeric, factors->n, 1, right, &factors->common) == 1;
}

/* -- SUNMatrix ------------------------------------------------------------------------------------------ */

typedef struct matrix_content {
    double *values; /* first, see gust_matrix_values */
    int64_t n_nonzeros;
} matrix_content;

static SUNMatrix_ID matrix_id(SUNMatrix matrix)
{
    (void)matrix;
    return SUNMATRIX_CUSTOM;
}

static void matrix_destroy(SUNMatrix matrix)
{
    if (matrix == NULL) {
        return;
    }
    matrix_content *content = matrix->content;
    if (content != NULL) {
        gust_release(content->values);
        gust_release(content);
    }
    matrix->content = NULL;
    SUNMatFreeEmpty(matrix);
}

static SUNMatrix matrix_clone(SUNMatrix matrix)
{
    return gust_matrix_new(((matrix_content *)matrix->content)->n_nonzeros, matrix->sunctx);
}

static int matrix_zero(SUNMatrix matrix)
{
    matrix_content *content = matrix->content;
    memset(content->values, 0, (size_t)content->n_nonzeros * sizeof *content->values);
    return 0;
}

static int matrix_copy(SUNMatrix from, SUNMatrix to)
{
    const matrix_content *source = from->content;
    matrix_content *target = to->content;
    memcpy(target->values, source->values, (size_t)source->n_nonzeros * sizeof *source->values);
    return 0;
}

SUNMatrix gust_matrix_new(int64_t n_nonzeros, SUNContext context)
{
    SUNMatrix made = SUNMatNewEmpty(context);
    if (made == NULL) {
        return NULL;
    }
    made->ops->getid = matrix_id;
    made->ops->clone = matrix_clone;
    made->ops->destroy = matrix_destroy;
    made->ops->zero = matrix_zero;
    made->ops->copy = matrix_copy;
    matrix_content *content = gust_allocate(1, sizeof *content);
    if (content == NULL) {
        SUNMatFreeEmpty(made);
        return NULL;
    }
    made->content = content;
    content->n_nonzeros = n_nonzeros;
    content->values = gust_allocate((size_t)n_nonzeros, sizeof *content->values);
    if (content->values == NULL) {
        matrix_destroy(made);
        return NULL;
    }
    return made;
}

/* -- SUNLinearSolver ------------------------------------------------------------------------------------ */

static SUNLinearSolver_Type solver_type(SUNLinearSolver solver)
{
    (void)solver;
    return SUNLINEARSOLVER_DIRECT;
}

static SUNLinearSolver_ID solver_id(SUNLinearSolver solver)
{
    (void)solver;
    return SUNLINEARSOLVER_CUSTOM;
}

static int solver_initialize(SUNLinearSolver solver)
{
    (void)solver;
    return 0;
}

/* A singular matrix is reported as recoverable: the integrator tries a smaller step, whose Jacobian leans
 * more on dF/dy'. */
static int solver_setup(SUNLinearSolver solver, SUNMatrix matrix)
{
    gust_factors *factors = solver->content;
    if (gust_factors_set(factors, gust_matrix_values(matrix))) {
        return 0;
    }
    return factors->common.status == KLU_OUT_OF_MEMORY ? GUST_LINEAR_SOLVER_LOST : SUNLS_LUFACT_FAIL;
}

static int solver_solve(SUNLinearSolver solver, SUNMatrix matrix, N_Vector x, N_Vector b, sunrealtype tolerance)
{
    (void)matrix;
    (void)tolerance;
    double *solution = gust_vector_data(x);
    const double *right = gust_vector_data(b);
    if (solution != right) {
        memcpy(solution, right, (size_t)gust_vector_padded(x) * sizeof *solution);
    }
    return gust_factors_solve(solver->content, solution) ? 0 : SUNLS_PACKAGE_FAIL_REC;
}

static int solver_free(SUNLinearSolver solver)
{
    if (solver != NULL) {
        solver->content = NULL;
        SUNLinSolFreeEmpty(solver);
    }
    return 0;
}

SUNLinearSolver gust_klu_new(gust_factors *factors, SUNContext context)
{
    SUNLinearSolver made = SUNLinSolNewEmpty(context);
    if (made == NULL) {
        return NULL;
    }
    made->ops->gettype = solver_type;
    made->ops->getid = solver_id;
    made->ops->initialize = solver_initialize;
    made->ops->setup = solver_setup;
    made->ops->solve = solver_solve;
    made->ops->free = solver_free;
    made->content = factors;
    return made;
}
