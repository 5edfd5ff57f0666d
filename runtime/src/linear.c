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

static double *writable_values(const double *array)
{
    double *same;
    memcpy(&same, &array, sizeof same);
    return same;
}

bool gust_factors_start(gust_factors *factors, int32_t n, const int32_t *column_start, const int32_t *row_index,
                        klu_symbolic *symbolic, const klu_common *common)
{
    *factors = (gust_factors){.n = n,
                              .column_start = writable(column_start),
                              .row_index = writable(row_index),
                              .symbolic = symbolic,
                              .common = *common,
                              .growth_limit = 1e-8,
                              .singular_column = -1};
    factors->chosen_for = gust_allocate((size_t)column_start[n], sizeof *factors->chosen_for);
    return factors->chosen_for != NULL;
}

void gust_factors_free(gust_factors *factors)
{
    gust_lu_free(&factors->lu);
    gust_release(factors->chosen_for);
    factors->chosen_for = NULL;
    factors->planned = false;
}

/* With pivots chosen for these values. */
static bool factor(gust_factors *factors, const double *values)
{
    klu_common *common = &factors->common;
    ++factors->factorisations;
    factors->since_check = 0;
    factors->fresh_pivots = false;
    factors->planned = false;
    factors->singular_column = -1;
    if (values != factors->chosen_for) {
        memcpy(factors->chosen_for, values, (size_t)factors->column_start[factors->n] * sizeof *values);
    }
    klu_numeric *numeric = klu_factor(factors->column_start, factors->row_index, writable_values(values),
                                      factors->symbolic, common);
    const bool regular = numeric != NULL && common->status == KLU_OK;
    if (!regular) {
        factors->singular_column = common->status == KLU_SINGULAR ? common->singular_col : -1;
    }
    const bool planned = regular && gust_lu_plan(&factors->lu, factors->column_start, factors->row_index,
                                                 values, factors->symbolic, numeric, common);
    if (regular && !planned) {
        common->status = KLU_OUT_OF_MEMORY;
    }
    if (numeric != NULL) {
        klu_free_numeric(&numeric, common);
    }
    if (!planned) {
        return false;
    }
    if (!gust_lu_factor(&factors->lu, values)) {
        factors->singular_column = factors->lu.column_of[factors->lu.singular_pivot];
        return false;
    }
    factors->planned = true;
    return true;
}

/* The pivots have become bad. */
static bool grown(gust_factors *factors, const double *values)
{
    if (factors->growth_check == 0 || ++factors->since_check < factors->growth_check) {
        return false;
    }
    factors->since_check = 0;
    return gust_lu_growth(&factors->lu, values) < factors->growth_limit;
}

bool gust_factors_set(gust_factors *factors, const double *values)
{
    if (!factors->planned || factors->fresh_pivots) {
        return factor(factors, values);
    }
    ++factors->refactorisations;
    return (gust_lu_factor(&factors->lu, values) && !grown(factors, values)) || factor(factors, values);
}

void gust_factors_solve(gust_factors *factors, const double *right, double *solution)
{
    gust_lu_solve(&factors->lu, right, solution);
}

void gust_factors_archive(gust_factors *factors, gust_archive *archive)
{
    gust_archive_flag(archive, "factors.planned", &factors->planned);
    gust_archive_doubles(archive, "factors.chosen_for", factors->chosen_for, factors->column_start[factors->n]);
}

bool gust_factors_choose_again(gust_factors *factors)
{
    return !factors->planned || factor(factors, factors->chosen_for);
}

void gust_factors_archive_counters(gust_factors *factors, gust_archive *archive)
{
    gust_archive_flag(archive, "factors.fresh_pivots", &factors->fresh_pivots);
    gust_archive_longs(archive, "factors.since_check", &factors->since_check, 1);
    gust_archive_longs(archive, "factors.first", &factors->factorisations, 1);
    gust_archive_longs(archive, "factors.again", &factors->refactorisations, 1);
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
    gust_factors_solve(solver->content, gust_vector_data(b), gust_vector_data(x));
    return 0;
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
