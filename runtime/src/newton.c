#include "newton.h"

#include <float.h>
#include <math.h>

#include "lanes.h"
#include "vector.h"

/* As in IDA: convergence slower than this is none; what a new Jacobian, and one whose cj has changed, is
 * trusted with before there is a rate; and the part of the tolerance that needs no rate at all. */
static const double SLOWEST_RATE = 0.9;
static const double FRESH_CONTRACTION = 20.0;
static const double STALE_CONTRACTION = 100.0;
static const double NEGLIGIBLE = 1e-8;

/* The step to be solved, from IDA: y = y_predicted + correction, y' = y'_predicted + cj correction. */
typedef struct step_data {
    double t;
    double cj;
    N_Vector y_predicted;
    N_Vector yp_predicted;
    N_Vector y;
    N_Vector yp;
    N_Vector residual;
} step_data;

static void apply(const step_data *step, N_Vector correction)
{
    const int64_t n = gust_vector_padded(correction) / GUST_LANES;
    const gust_lanes *change = gust_lanes_in(gust_vector_data(correction));
    const gust_lanes *y_predicted = gust_lanes_in(gust_vector_data(step->y_predicted));
    const gust_lanes *yp_predicted = gust_lanes_in(gust_vector_data(step->yp_predicted));
    gust_lanes *y = gust_lanes_of(gust_vector_data(step->y));
    gust_lanes *yp = gust_lanes_of(gust_vector_data(step->yp));
    for (int64_t i = 0; i < n; ++i) {
        y[i] = y_predicted[i] + change[i];
        yp[i] = yp_predicted[i] + step->cj * change[i];
    }
}

/* Adds factor * delta to the correction, which counts as 0 if `first`, and measures it. */
static double correct(N_Vector correction, N_Vector delta, double factor, bool first, N_Vector weights)
{
    const int64_t n = gust_vector_padded(correction) / GUST_LANES;
    const gust_lanes *d = gust_lanes_in(gust_vector_data(delta));
    const gust_lanes *w = gust_lanes_in(gust_vector_data(weights));
    gust_lanes *sum = gust_lanes_of(gust_vector_data(correction));
    /* Not a product of the sum with 0: a number lost in an earlier attempt must not come back. */
    const gust_lanes nothing = {0.0};
    gust_lanes square[GUST_BLOCK_LANES] = {{0.0}};
    for (int64_t i = 0; i < n; i += GUST_BLOCK_LANES) {
        for (int k = 0; k < GUST_BLOCK_LANES; ++k) {
            const gust_lanes change = factor * d[i + k];
            const gust_lanes term = change * w[i + k];
            square[k] += term * term;
            sum[i + k] = change + (first ? nothing : sum[i + k]);
        }
    }
    return sqrt(gust_lane_sum(square) / (double)gust_vector_length(correction));
}

/* One attempt with the factors as they are. The residual at the prediction has been evaluated. */
static int iterate(gust_newton *newton, const step_data *step, N_Vector correction, N_Vector weights,
                   double tolerance, void *user_data)
{
    /* A Jacobian of another cj is made up for by half, see the IDA user guide on stale matrices. */
    const double factor = -2.0 / (1.0 + step->cj / newton->setup_cj);
    double norm_before = 0.0;
    for (int iteration = 0;; ++iteration) {
        ++newton->iterations;
        gust_factors_solve(newton->factors, gust_vector_data(step->residual), gust_vector_data(newton->delta));
        const double norm = correct(correction, newton->delta, factor, iteration == 0, weights);
        if (!(norm <= DBL_MAX)) { /* also NaN */
            newton->finite(step->t, step->residual, user_data);
            return SUN_NLS_CONV_RECVR;
        }
        if (iteration == 0) {
            norm_before = norm;
            if (norm <= NEGLIGIBLE * tolerance) {
                return GUST_NONLINEAR_SOLVED;
            }
        } else {
            const double ratio = norm / norm_before;
            const double rate = iteration == 1 ? ratio : pow(ratio, 1.0 / iteration);
            if (rate > SLOWEST_RATE) {
                return SUN_NLS_CONV_RECVR;
            }
            newton->contraction = rate / (1.0 - rate);
        }
        if (newton->contraction * norm <= tolerance) {
            return GUST_NONLINEAR_SOLVED;
        }
        if (iteration + 1 >= newton->most_iterations) {
            return SUN_NLS_CONV_RECVR;
        }
        apply(step, correction);
        if (newton->residual(step->t, step->y, step->yp, step->residual, user_data) != 0) {
            return IDA_RES_FAIL;
        }
    }
}

/* New Jacobian at the prediction, where the residual has been evaluated. */
static int renew(gust_newton *newton, const step_data *step, bool bad, void *ida, void *user_data)
{
    if (!newton->finite(step->t, step->residual, user_data)) {
        return SUN_NLS_CONV_RECVR;
    }
    N_VScale(1.0, step->y_predicted, step->y);
    N_VScale(1.0, step->yp_predicted, step->yp);
    sunbooleantype current = SUNFALSE;
    const int result = newton->setup(bad ? SUNTRUE : SUNFALSE, &current, ida);
    newton->setup_cj = step->cj;
    newton->contraction = FRESH_CONTRACTION;
    return result;
}

static int newton_solve(SUNNonlinearSolver solver, N_Vector unused, N_Vector correction, N_Vector weights,
                        sunrealtype tolerance, sunbooleantype call_setup, void *ida)
{
    (void)unused;
    gust_newton *newton = solver->content;
    step_data step;
    void *user_data = NULL;
    newton->iterations = 0;
    newton->failures = 0;
    if (IDAGetNonlinearSystemData(ida, &step.t, &step.y_predicted, &step.yp_predicted, &step.y, &step.yp,
                                  &step.residual, &step.cj, &user_data) != IDA_SUCCESS) {
        return GUST_NONLINEAR_LOST;
    }
    if (step.cj != newton->last_cj) {
        newton->contraction = STALE_CONTRACTION;
        newton->last_cj = step.cj;
    }
    bool renewed = call_setup != SUNFALSE;
    for (bool bad = false;; bad = true) {
        if (newton->residual(step.t, step.y_predicted, step.yp_predicted, step.residual, user_data) != 0) {
            return IDA_RES_FAIL;
        }
        int result = renewed ? renew(newton, &step, bad, ida, user_data) : GUST_NONLINEAR_SOLVED;
        if (result == GUST_NONLINEAR_SOLVED) {
            result = iterate(newton, &step, correction, weights, tolerance, user_data);
        }
        if (result == GUST_NONLINEAR_SOLVED) {
            return result;
        }
        ++newton->failures;
        if (result < 0 || renewed) {
            return result;
        }
        renewed = true;
    }
}

/* -- interface ------------------------------------------------------------------------------------------ */

static SUNNonlinearSolver_Type newton_type(SUNNonlinearSolver solver)
{
    (void)solver;
    return SUNNONLINEARSOLVER_ROOTFIND;
}

static int newton_initialize(SUNNonlinearSolver solver)
{
    (void)solver;
    return 0;
}

/* IDA's residual and solve functions are not needed: they call what we call. */

static int set_system(SUNNonlinearSolver solver, SUNNonlinSolSysFn function)
{
    (void)solver;
    (void)function;
    return 0;
}

static int set_setup(SUNNonlinearSolver solver, SUNNonlinSolLSetupFn function)
{
    ((gust_newton *)solver->content)->setup = function;
    return 0;
}

static int set_solve(SUNNonlinearSolver solver, SUNNonlinSolLSolveFn function)
{
    (void)solver;
    (void)function;
    return 0;
}

static int set_test(SUNNonlinearSolver solver, SUNNonlinSolConvTestFn function, void *data)
{
    (void)solver;
    (void)function;
    (void)data;
    return 0;
}

static int set_most_iterations(SUNNonlinearSolver solver, int most)
{
    ((gust_newton *)solver->content)->most_iterations = most;
    return 0;
}

static int get_iterations(SUNNonlinearSolver solver, long *iterations)
{
    *iterations = ((const gust_newton *)solver->content)->iterations;
    return 0;
}

static int get_failures(SUNNonlinearSolver solver, long *failures)
{
    *failures = ((const gust_newton *)solver->content)->failures;
    return 0;
}

static int newton_free(SUNNonlinearSolver solver)
{
    if (solver != NULL) {
        gust_newton *newton = solver->content;
        if (newton->delta != NULL) {
            N_VDestroy(newton->delta);
            newton->delta = NULL;
        }
        solver->content = NULL;
        SUNNonlinSolFreeEmpty(solver);
    }
    return 0;
}

SUNNonlinearSolver gust_newton_new(gust_newton *newton, N_Vector like, SUNContext context)
{
    SUNNonlinearSolver made = SUNNonlinSolNewEmpty(context);
    if (made == NULL) {
        return NULL;
    }
    made->content = newton;
    made->ops->gettype = newton_type;
    made->ops->initialize = newton_initialize;
    made->ops->solve = newton_solve;
    made->ops->free = newton_free;
    made->ops->setsysfn = set_system;
    made->ops->setlsetupfn = set_setup;
    made->ops->setlsolvefn = set_solve;
    made->ops->setctestfn = set_test;
    made->ops->setmaxiters = set_most_iterations;
    made->ops->getnumiters = get_iterations;
    made->ops->getnumconvfails = get_failures;
    newton->delta = N_VClone(like);
    if (newton->delta == NULL) {
        newton_free(made);
        return NULL;
    }
    return made;
}
