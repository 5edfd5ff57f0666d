/* IDA with our vectors, matrix, linear solver and error weights. */
#ifndef GUSTFORM_SOLVER_H
#define GUSTFORM_SOLVER_H

#include <stdbool.h>
#include <stdint.h>

#include "events.h"
#include "linear.h"
#include "newton.h"
#include "options.h"
#include "sundials_compat.h"
#include "system.h"

/* How a step ended. */
typedef enum gust_step { GUST_STEP_TAKEN, GUST_STEP_AT_STOP, GUST_STEP_AT_ROOT, GUST_STEP_FAILED } gust_step;

typedef struct gust_solver {
    gust_system *system;
    gust_events *events;
    const gust_options *options;
    SUNContext context;
    void *ida;
    N_Vector y; /* at the time of the last step */
    N_Vector yp;
    N_Vector dense_y; /* between steps, for result rows */
    N_Vector dense_yp;
    N_Vector mask;     /* 1 where differential */
    N_Vector absolute; /* absolute tolerance */
    SUNMatrix matrix;
    SUNLinearSolver linear;
    SUNNonlinearSolver nonlinear;
    gust_newton newton;
    klu_common common;
    klu_symbolic *symbolic;
    gust_factors factors;
    double t;          /* of y and yp, s */
    double first_step; /* after the last (re)start, s */
    double stop;       /* time the integrator may not step over, s; NaN: not told yet */
    int stalled_steps; /* in succession, that did not move the time */
    /* the last point at which the residual was evaluated, for diagnosis */
    double last_t;
    double last_cj;
    N_Vector last_y;
    N_Vector last_yp;
    int32_t bad_row; /* row that was not finite in the last failed evaluation, -1 */
    double bad_row_t;
    int64_t failures_seen; /* corrector iterations that did not converge, since the last restart */
    int64_t doubtful_step; /* step in which the last of them was, -1 */
    /* counters of the runs before the last restart */
    int64_t steps;
    int64_t error_test_failures;
    int64_t nonlinear_iterations;
    int64_t nonlinear_failures;
    int64_t restarts;
    char ida_message[256];
} gust_solver;

/* Analyses the pattern; the linear part is then ready for others to use too. Free with gust_solver_free,
 * also after an error. */
gust_status gust_solver_create(gust_solver *solver, gust_system *system, gust_events *events,
                               const gust_options *options, char *message, size_t size);
void gust_solver_free(gust_solver *solver);

/* First start at t from consistent solver->y, solver->yp. */
gust_status gust_solver_start(gust_solver *solver, double t, double first_step, char *message, size_t size);

/* New start at t, after y or yp or the equations have changed. */
gust_status gust_solver_restart(gust_solver *solver, double t, double first_step, char *message, size_t size);

/* How long the next step is meant to be, and the last one was (0 after a start), s. */
double gust_solver_next_step(const gust_solver *solver);
double gust_solver_last_step(const gust_solver *solver);

/* One step, not beyond `stop`. On failure status and message say why. */
gust_step gust_solver_step(gust_solver *solver, double stop, gust_status *status, char *message, size_t size);

/* y (and y' if wanted) at a time within the last step, into dense_y and dense_yp. */
bool gust_solver_dense(gust_solver *solver, double t, bool derivatives);

/* For checkpoints, right after a restart: everything gust_solver_restart needs to do that again. */
void gust_solver_archive(gust_solver *solver, gust_archive *archive);
void gust_solver_archive_counters(gust_solver *solver, gust_archive *archive);

/* Counters since the first start. */
void gust_solver_statistics(const gust_solver *solver, gust_statistics *statistics);

#endif
