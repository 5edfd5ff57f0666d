#include "solver.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "diagnose.h"
#include "text.h"
#include "vector.h"

/* -- what IDA calls ------------------------------------------------------------------------------------- */

/* F at a point of the iteration; whether it is finite shows later, see newton.h. */
static int iteration_residual(double t, N_Vector y, N_Vector yp, N_Vector r, void *user_data)
{
    gust_solver *solver = user_data;
    solver->last_t = t;
    solver->last_y = y;
    solver->last_yp = yp;
    return gust_system_residual(solver->system, t, gust_vector_data(y), gust_vector_data(yp),
                                gust_vector_data(r))
               ? 0
               : -1;
}

static bool finite(double t, N_Vector r, void *user_data)
{
    gust_solver *solver = user_data;
    const int32_t row = gust_system_not_finite(solver->system, gust_vector_data(r));
    if (row >= 0) {
        solver->bad_row = row;
        solver->bad_row_t = t;
    }
    return row < 0;
}

/* For what IDA itself evaluates. */
static int residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void *user_data)
{
    if (iteration_residual(t, y, yp, r, user_data) != 0) {
        return -1;
    }
    return finite(t, r, user_data) ? 0 : 1;
}

/* An iteration that did not converge casts doubt on the pivots: their growth is looked at with the next
 * factorisation, and if a second one follows in the same step, new ones are chosen. */
static void doubt_pivots(gust_solver *solver)
{
    long failures = 0;
    IDAGetNumNonlinSolvConvFails(solver->ida, &failures);
    if (failures == solver->failures_seen) {
        return;
    }
    solver->failures_seen = failures;
    long steps = 0;
    IDAGetNumSteps(solver->ida, &steps);
    if (steps == solver->doubtful_step) {
        solver->factors.fresh_pivots = true;
    }
    solver->doubtful_step = steps;
    solver->factors.since_check = solver->factors.growth_check;
}

static int jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector yp, N_Vector r, SUNMatrix matrix,
                    void *user_data, N_Vector scratch_1, N_Vector scratch_2, N_Vector scratch_3)
{
    (void)r;
    (void)scratch_1;
    (void)scratch_2;
    (void)scratch_3;
    gust_solver *solver = user_data;
    solver->last_cj = cj;
    doubt_pivots(solver);
    return gust_system_jacobian(solver->system, t, gust_vector_data(y), gust_vector_data(yp), cj,
                                gust_matrix_values(matrix))
               ? 0
               : -1;
}

static int roots(sunrealtype t, N_Vector y, N_Vector yp, sunrealtype *value, void *user_data)
{
    gust_solver *solver = user_data;
    return gust_events_roots(solver->events, solver->system, t, gust_vector_data(y), gust_vector_data(yp),
                             value)
               ? 0
               : -1;
}

/* 1 / (rtol |y| + atol). The padding of `weights` must stay 0, see vector.h. */
static int error_weights(N_Vector y, N_Vector weights, void *user_data)
{
    const gust_solver *solver = user_data;
    const double rtol = solver->options->rtol;
    const double *restrict yd = gust_vector_data(y);
    const double *restrict absolute = gust_vector_data(solver->absolute);
    double *restrict wd = gust_vector_data(weights);
    const int32_t n = solver->system->model->n_unknowns;
    for (int32_t i = 0; i < n; ++i) {
        wd[i] = 1.0 / (rtol * fabs(yd[i]) + absolute[i]);
    }
    return 0;
}

#if SUNDIALS_VERSION_MAJOR >= 7
static void keep_message(int line, const char *function, const char *file, const char *text, SUNErrCode code,
                         void *user_data, SUNContext context)
{
    (void)line;
    (void)file;
    (void)context;
    (void)code;
    gust_solver *solver = user_data;
    gust_text(solver->ida_message, sizeof solver->ida_message, "%s: %s", function, text);
}
#else
static void keep_message(int code, const char *module, const char *function, char *text, void *user_data)
{
    (void)module;
    gust_solver *solver = user_data;
    if (code != IDA_WARNING) {
        gust_text(solver->ida_message, sizeof solver->ida_message, "%s: %s", function, text);
    }
}
#endif

/* -- life ----------------------------------------------------------------------------------------------- */

static gust_status no_memory(char *message, size_t size)
{
    gust_text(message, size, "out of memory for the integrator");
    return GUST_OUT_OF_MEMORY;
}

static gust_status structurally_singular(const gust_solver *solver, char *message, size_t size)
{
    const gust_model *model = solver->system->model;
    gust_text(
        message, size,
        "only %d of %d unknowns can be matched with an equation each: some unknowns are not determined by the "
        "equations, whatever the values. Check the model (gustform check)",
        solver->common.structural_rank, model->n_unknowns);
    return GUST_SINGULAR;
}

gust_status gust_solver_create(gust_solver *solver, gust_system *system, gust_events *events,
                               const gust_options *options, char *message, size_t size)
{
    const gust_model *model = system->model;
    *solver = (gust_solver){
        .system = system, .events = events, .options = options, .bad_row = -1, .doubtful_step = -1};
    if (SUNContext_Create(GUST_NO_COMMUNICATOR, &solver->context) != 0) {
        return no_memory(message, size);
    }
    klu_defaults(&solver->common);
    if (!gust_factors_start(&solver->factors, model->n_unknowns, model->column_start, model->row_index, NULL,
                            &solver->common)) {
        return no_memory(message, size);
    }
    solver->symbolic = klu_analyze(model->n_unknowns, solver->factors.column_start, solver->factors.row_index,
                                   &solver->common);
    if (solver->symbolic == NULL) {
        return solver->common.status == KLU_SINGULAR ? structurally_singular(solver, message, size)
                                                     : no_memory(message, size);
    }
    if (solver->symbolic->structural_rank >= 0 && solver->symbolic->structural_rank < model->n_unknowns) {
        solver->common.structural_rank = solver->symbolic->structural_rank;
        return structurally_singular(solver, message, size);
    }
    solver->factors.symbolic = solver->symbolic;
    solver->y = gust_vector_new(model->n_unknowns, solver->context);
    if (solver->y == NULL) {
        return no_memory(message, size);
    }
    solver->yp = N_VClone(solver->y);
    solver->dense_y = N_VClone(solver->y);
    solver->dense_yp = N_VClone(solver->y);
    solver->mask = N_VClone(solver->y);
    solver->absolute = N_VClone(solver->y);
    solver->matrix = gust_matrix_new(model->n_nonzeros, solver->context);
    solver->linear = gust_klu_new(&solver->factors, solver->context);
    solver->ida = IDACreate(solver->context);
    solver->newton =
        (gust_newton){.factors = &solver->factors, .residual = iteration_residual, .finite = finite};
    solver->nonlinear = gust_newton_new(&solver->newton, solver->y, solver->context);
    if (solver->yp == NULL || solver->dense_y == NULL || solver->dense_yp == NULL || solver->mask == NULL ||
        solver->absolute == NULL || solver->matrix == NULL || solver->linear == NULL ||
        solver->nonlinear == NULL || solver->ida == NULL) {
        return no_memory(message, size);
    }
    return GUST_OK;
}

void gust_solver_free(gust_solver *solver)
{
    if (solver->ida != NULL) {
        IDAFree(&solver->ida);
    }
    if (solver->nonlinear != NULL) {
        SUNNonlinSolFree(solver->nonlinear);
    }
    if (solver->linear != NULL) {
        SUNLinSolFree(solver->linear);
    }
    if (solver->matrix != NULL) {
        SUNMatDestroy(solver->matrix);
    }
    N_Vector vectors[] = {solver->y,        solver->yp,   solver->dense_y,
                          solver->dense_yp, solver->mask, solver->absolute};
    for (size_t k = 0; k < sizeof vectors / sizeof vectors[0]; ++k) {
        if (vectors[k] != NULL) {
            N_VDestroy(vectors[k]);
        }
    }
    gust_factors_free(&solver->factors);
    if (solver->symbolic != NULL) {
        klu_free_symbolic(&solver->symbolic, &solver->common);
    }
    if (solver->context != NULL) {
        SUNContext_Free(&solver->context);
    }
    *solver = (gust_solver){0};
}

/* -- start ---------------------------------------------------------------------------------------------- */

static bool set_options(gust_solver *solver)
{
    const gust_options *options = solver->options;
    void *ida = solver->ida;
    bool good = IDASetUserData(ida, solver) == IDA_SUCCESS;
    good = good && IDAWFtolerances(ida, error_weights) == IDA_SUCCESS;
    good = good && IDASetId(ida, solver->mask) == IDA_SUCCESS;
    good =
        good && IDASetSuppressAlg(ida, options->suppress_algebraic > 0.0 ? SUNTRUE : SUNFALSE) == IDA_SUCCESS;
    good = good && IDASetMaxNumSteps(ida, -1) == IDA_SUCCESS;
    good = good && IDASetMaxOrd(ida, (int)options->max_order) == IDA_SUCCESS;
    good = good && IDASetMaxStep(ida, options->max_step) == IDA_SUCCESS;
    good = good && IDASetLinearSolver(ida, solver->linear, solver->matrix) == IDA_SUCCESS;
    good = good && IDASetJacFn(ida, jacobian) == IDA_SUCCESS;
    good = good && IDASetNonlinearSolver(ida, solver->nonlinear) == IDA_SUCCESS;
    good = good && IDASetNonlinConvCoef(ida, options->nonlinear_coefficient) == IDA_SUCCESS;
    good = good && IDASetMaxNonlinIters(ida, (int)options->nonlinear_iterations) == IDA_SUCCESS;
    good = good && IDASetDeltaCjLSetup(ida, options->cj_change) == IDA_SUCCESS;
    if (good && solver->events->n_watched > 0) {
        good = IDARootInit(ida, (int)solver->events->n_watched, roots) == IDA_SUCCESS &&
               IDASetRootDirection(ida, solver->events->direction) == IDA_SUCCESS &&
               IDASetNoInactiveRootWarn(ida) == IDA_SUCCESS;
    }
    return good;
}

static gust_status refused(const gust_solver *solver, char *message, size_t size)
{
    gust_text(message, size, "the integrator refused to start: %s", solver->ida_message);
    return GUST_SOLVER_FAILED;
}

/* Factors a Jacobian as the first step will have it: what the factors need is allocated here, and a matrix
 * that is singular for every step is found before the first. */
static gust_status choose_pivots(gust_solver *solver, double t, double first_step, char *message, size_t size)
{
    gust_system *system = solver->system;
    double *values = gust_matrix_values(solver->matrix);
    if (!gust_system_jacobian(system, t, gust_vector_data(solver->y), gust_vector_data(solver->yp),
                              1.0 / first_step, values)) {
        gust_text(message, size, "%s", system->series.message);
        return system->series.failure;
    }
    if (!gust_factors_set(&solver->factors, values)) {
        gust_text(message, size, "at t = %.9g s the Jacobian of the first step is singular", t);
        gust_diagnose_singular(system->model, values, solver->factors.singular_column, message, size);
        return GUST_SINGULAR;
    }
    return GUST_OK;
}

gust_status gust_solver_start(gust_solver *solver, double t, double first_step, char *message, size_t size)
{
    const gust_model *model = solver->system->model;
    const double atol = gust_options_absolute(solver->options);
    for (int32_t i = 0; i < model->n_unknowns; ++i) {
        gust_vector_data(solver->mask)[i] = model->differential[i] ? 1.0 : 0.0;
        gust_vector_data(solver->absolute)[i] = atol * model->nominal[i];
    }
    solver->factors.growth_check = (int64_t)solver->options->growth_check;
    solver->factors.growth_limit = solver->options->growth_limit;
#if SUNDIALS_VERSION_MAJOR >= 7
    const int handled = SUNContext_ClearErrHandlers(solver->context) == 0 &&
                        SUNContext_PushErrHandler(solver->context, keep_message, solver) == 0;
#else
    const int handled = IDASetErrHandlerFn(solver->ida, keep_message, solver) == IDA_SUCCESS;
#endif
    if (!handled || IDAInit(solver->ida, residual, t, solver->y, solver->yp) != IDA_SUCCESS ||
        !set_options(solver) || IDASetInitStep(solver->ida, first_step) != IDA_SUCCESS) {
        return refused(solver, message, size);
    }
    solver->t = t;
    solver->first_step = first_step;
    solver->stop = NAN;
    solver->stalled_steps = 0;
    return choose_pivots(solver, t, first_step, message, size);
}

/* Counters of IDA since its last (re)start. */
static void add_counters(const gust_solver *solver, int64_t *steps, int64_t *error_test_failures,
                         int64_t *nonlinear_iterations, int64_t *nonlinear_failures)
{
    long value = 0;
    if (IDAGetNumSteps(solver->ida, &value) == IDA_SUCCESS) {
        *steps += value;
    }
    if (IDAGetNumErrTestFails(solver->ida, &value) == IDA_SUCCESS) {
        *error_test_failures += value;
    }
    if (IDAGetNumNonlinSolvIters(solver->ida, &value) == IDA_SUCCESS) {
        *nonlinear_iterations += value;
    }
    if (IDAGetNumNonlinSolvConvFails(solver->ida, &value) == IDA_SUCCESS) {
        *nonlinear_failures += value;
    }
}

gust_status gust_solver_restart(gust_solver *solver, double t, double first_step, char *message, size_t size)
{
    add_counters(solver, &solver->steps, &solver->error_test_failures, &solver->nonlinear_iterations,
                 &solver->nonlinear_failures);
    solver->failures_seen = 0;
    solver->doubtful_step = -1;
    /* Nothing of the past may show: a run that goes on from a checkpoint has none. */
    solver->newton.contraction = 0.0;
    solver->newton.setup_cj = 0.0;
    solver->newton.last_cj = 0.0;
    ++solver->restarts;
    if (IDAReInit(solver->ida, t, solver->y, solver->yp) != IDA_SUCCESS ||
        IDASetInitStep(solver->ida, first_step) != IDA_SUCCESS) {
        return refused(solver, message, size);
    }
    solver->t = t;
    solver->first_step = first_step;
    solver->stop = NAN;
    solver->stalled_steps = 0;
    return GUST_OK;
}

double gust_solver_next_step(const gust_solver *solver)
{
    long steps = 0;
    double step = 0.0;
    const bool known = IDAGetNumSteps(solver->ida, &steps) == IDA_SUCCESS && steps > 0 &&
                       IDAGetCurrentStep(solver->ida, &step) == IDA_SUCCESS;
    return known ? step : solver->first_step;
}

double gust_solver_last_step(const gust_solver *solver)
{
    double step = 0.0;
    return IDAGetLastStep(solver->ida, &step) == IDA_SUCCESS ? step : 0.0;
}

enum { MAX_STALLED_STEPS = 100 };

/* -- steps ---------------------------------------------------------------------------------------------- */

static gust_status explain_error_test(gust_solver *solver, char *message, size_t size)
{
    const gust_model *model = solver->system->model;
    double *errors = gust_vector_data(solver->dense_y);
    double *weights = gust_vector_data(solver->dense_yp);
    gust_text(message, size,
              "at t = %.9g s the step became too small to meet the tolerance (rtol %g): an unknown jumps or "
              "grows without bound there; try a larger rtol, or look at what happens at that time",
              solver->t, solver->options->rtol);
    if (IDAGetEstLocalErrors(solver->ida, solver->dense_y) == IDA_SUCCESS &&
        IDAGetErrWeights(solver->ida, solver->dense_yp) == IDA_SUCCESS) {
        for (int32_t i = 0; i < model->n_unknowns; ++i) {
            const bool counts = solver->options->suppress_algebraic == 0.0 || model->differential[i];
            errors[i] = counts ? errors[i] * weights[i] : 0.0;
        }
        gust_diagnose_unknowns(model, errors, gust_vector_data(solver->y), "errors, in tolerances", message,
                               size);
    }
    return GUST_STEP_TOO_SMALL;
}

static gust_status explain_not_finite(const gust_solver *solver, char *message, size_t size)
{
    char name[240];
    gust_model_equation_name(solver->system->model, solver->bad_row, name, sizeof name);
    gust_text(message, size,
              "at t = %.9g s the equation %s gives no number: look for a division by zero or a root of a "
              "negative number",
              solver->bad_row_t, name);
    return GUST_NOT_FINITE_STEP;
}

static gust_status explain_convergence(gust_solver *solver, char *message, size_t size)
{
    gust_system *system = solver->system;
    const gust_model *model = system->model;
    if (solver->bad_row >= 0 && solver->bad_row_t >= solver->t) {
        return explain_not_finite(solver, message, size);
    }
    if (solver->factors.singular_column >= 0) {
        char name[240];
        gust_model_unknown_name(model, solver->factors.singular_column, name, sizeof name);
        gust_text(message, size,
                  "at t = %.9g s the Jacobian is singular: the equations do not determine %s there",
                  solver->last_t, name);
        return GUST_SINGULAR_STEP;
    }
    gust_text(message, size,
              "at t = %.9g s the equations could not be solved, not even for a very small step; try a smaller "
              "max_step, or look at what happens at that time",
              solver->t);
    double *left = gust_vector_data(solver->dense_y);
    if (solver->last_y != NULL && gust_system_residual(system, solver->last_t, gust_vector_data(solver->last_y),
                                                       gust_vector_data(solver->last_yp), left)) {
        gust_diagnose_rows(model, left, gust_matrix_values(solver->matrix), message, size);
    }
    return GUST_NO_CONVERGENCE;
}

static gust_status explain(gust_solver *solver, int flag, char *message, size_t size)
{
    if (solver->system->series.failure != GUST_OK) {
        gust_text(message, size, "at t = %.9g s: %s", solver->last_t, solver->system->series.message);
        return solver->system->series.failure;
    }
    switch (flag) {
    case IDA_ERR_FAIL:
    case IDA_TOO_MUCH_ACC:
        return explain_error_test(solver, message, size);
    case IDA_CONV_FAIL:
    case IDA_LSETUP_FAIL:
    case IDA_LSOLVE_FAIL:
    case IDA_NLS_SETUP_FAIL:
    case IDA_NLS_FAIL:
    case IDA_REP_RES_ERR:
    case IDA_FIRST_RES_FAIL:
        return explain_convergence(solver, message, size);
    default:
        gust_text(message, size, "at t = %.9g s the integrator gave up (%d): %s", solver->t, flag,
                  solver->ida_message);
        return GUST_SOLVER_FAILED;
    }
}

/* Whether the time has stopped moving: next to a pole the integrator goes on for ever with steps that are
 * lost in rounding. */
static bool stalled(gust_solver *solver, double before)
{
    if (solver->t - before > 4.0 * DBL_EPSILON * fabs(solver->t)) {
        solver->stalled_steps = 0;
        return false;
    }
    return ++solver->stalled_steps > MAX_STALLED_STEPS;
}

gust_step gust_solver_step(gust_solver *solver, double stop, gust_status *status, char *message, size_t size)
{
    if (stop != solver->stop) {
        solver->stop = stop;
        IDASetStopTime(solver->ida, isfinite(stop) ? stop : DBL_MAX);
    }
    /* In this mode the output time only says which way to go. */
    const double direction = solver->t + fmax(1.0, fabs(solver->t));
    const double before = solver->t;
    const int flag = IDASolve(solver->ida, direction, &solver->t, solver->y, solver->yp, IDA_ONE_STEP);
    if (flag >= 0 && stalled(solver, before)) {
        *status = explain_error_test(solver, message, size);
        return GUST_STEP_FAILED;
    }
    switch (flag) {
    case IDA_SUCCESS:
        return GUST_STEP_TAKEN;
    case IDA_TSTOP_RETURN:
        solver->stop = NAN; /* the integrator has forgotten it */
        return GUST_STEP_AT_STOP;
    case IDA_ROOT_RETURN:
        IDAGetRootInfo(solver->ida, solver->events->found);
        return GUST_STEP_AT_ROOT;
    default:
        *status = explain(solver, flag, message, size);
        return GUST_STEP_FAILED;
    }
}

bool gust_solver_dense(gust_solver *solver, double t, bool derivatives)
{
    return IDAGetDky(solver->ida, t, 0, solver->dense_y) == IDA_SUCCESS &&
           (!derivatives || IDAGetDky(solver->ida, t, 1, solver->dense_yp) == IDA_SUCCESS);
}

void gust_solver_archive(gust_solver *solver, gust_archive *archive)
{
    const int32_t n = solver->system->model->n_unknowns;
    gust_archive_doubles(archive, "solver.t", &solver->t, 1);
    gust_archive_doubles(archive, "solver.first_step", &solver->first_step, 1);
    gust_archive_doubles(archive, "solver.y", gust_vector_data(solver->y), n);
    gust_archive_doubles(archive, "solver.yp", gust_vector_data(solver->yp), n);
    gust_factors_archive(&solver->factors, archive);
}

void gust_solver_archive_counters(gust_solver *solver, gust_archive *archive)
{
    int64_t *const counters[] = {&solver->steps, &solver->error_test_failures, &solver->nonlinear_iterations,
                                 &solver->nonlinear_failures, &solver->restarts};
    for (size_t k = 0; k < sizeof counters / sizeof counters[0]; ++k) {
        gust_archive_longs(archive, "solver.counter", counters[k], 1);
    }
    gust_factors_archive_counters(&solver->factors, archive);
}

void gust_solver_statistics(const gust_solver *solver, gust_statistics *statistics)
{
    statistics->steps = solver->steps;
    statistics->error_test_failures = solver->error_test_failures;
    statistics->nonlinear_iterations = solver->nonlinear_iterations;
    statistics->nonlinear_failures = solver->nonlinear_failures;
    statistics->restarts = solver->restarts;
    statistics->factorisations = solver->factors.factorisations;
    statistics->refactorisations = solver->factors.refactorisations;
    if (solver->ida == NULL) {
        return;
    }
    add_counters(solver, &statistics->steps, &statistics->error_test_failures,
                 &statistics->nonlinear_iterations, &statistics->nonlinear_failures);
    int order = 0;
    double step = 0.0;
    if (IDAGetLastOrder(solver->ida, &order) == IDA_SUCCESS) {
        statistics->last_order = order;
    }
    if (IDAGetLastStep(solver->ida, &step) == IDA_SUCCESS) {
        statistics->last_step = step;
    }
}
