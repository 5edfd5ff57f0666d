/* Every status the runtime can return: one list, number and sentence side by side.
 *
 *   0        the call did what it was asked to do
 *   1 ...    stopped for a stated reason; results so far are complete and the model can be looked at
 *  -1 ...    wrong use of this interface
 *  -100 ...  the model file or a kernel library
 *  -200 ...  finding consistent initial values
 *  -300 ...  integration
 *  -400 ...  events
 *  -500 ...  time series
 *  -600 ...  results and checkpoints
 */
#ifndef GUSTFORM_GUST_STATUS_H
#define GUSTFORM_GUST_STATUS_H

#include "gust_export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* X(name, number, sentence) */
#define GUST_STATUS_LIST(X)                                                                                    \
    X(OK, 0, "done")                                                                                           \
    X(STOP_REQUESTED, 1, "stopped because a stop was requested")                                               \
    X(END_OF_DATA, 2, "stopped because a time series has no more data")                                        \
    X(SINK_STOPPED, 3, "stopped because the receiver of the results asked for it")                             \
    X(CONTROLLER_STOPPED, 4, "stopped because the host's controller asked for it")                             \
    X(BAD_ARGUMENT, -1, "an argument is outside its range")                                                    \
    X(BAD_ORDER, -2, "the call is not possible in this phase of the simulation")                               \
    X(UNKNOWN_OPTION, -3, "there is no option of this name")                                                   \
    X(OUT_OF_MEMORY, -4, "out of memory")                                                                      \
    X(FILE_UNREADABLE, -101, "the model file cannot be read")                                                  \
    X(BAD_CONTAINER, -102, "the model file is damaged or not a model file")                                    \
    X(BAD_TABLE, -103, "the model file contradicts itself")                                                    \
    X(BAD_KERNEL, -104, "a kernel library cannot be used")                                                     \
    X(BAD_CONTROLLER, -105, "a controller library cannot be used")                                             \
    X(NOT_FINITE, -201, "an equation gives a value that is not a number at the start")                         \
    X(SINGULAR, -202, "the equations do not determine the initial values")                                     \
    X(NOT_CONSISTENT, -203, "no consistent initial values found")                                              \
    X(STEP_TOO_SMALL, -301, "the step became too small to meet the tolerance")                                 \
    X(NO_CONVERGENCE, -302, "the equations of a step could not be solved")                                     \
    X(SINGULAR_STEP, -303, "the Jacobian of a step is singular")                                               \
    X(NOT_FINITE_STEP, -304, "an equation gives a value that is not a number")                                 \
    X(SOLVER_FAILED, -305, "the integrator gave up")                                                           \
    X(EVENT_ITERATION, -401, "when-clauses trigger each other without end")                                    \
    X(CHATTERING, -402, "events follow each other without the time advancing")                                 \
    X(RESTART_FAILED, -403, "no consistent values found after an event")                                       \
    X(BAD_PERIOD, -404, "a sample period is not a positive number")                                            \
    X(CONTROLLER_FAILED, -405, "a sampled controller failed")                                                  \
    X(SERIES_UNREADABLE, -501, "a time series cannot be read")                                                 \
    X(BAD_SERIES, -502, "a time series contains an unusable sample")                                           \
    X(SERIES_NOT_COVERING, -503, "a time series begins after the start of the simulation")                     \
    X(SINK_FAILED, -601, "the results could not be written")                                                   \
    X(CHECKPOINT_FAILED, -602, "a checkpoint could not be written")                                            \
    X(CHECKPOINT_UNREADABLE, -603, "a checkpoint cannot be read")                                              \
    X(BAD_CHECKPOINT, -604, "a checkpoint is damaged or not a checkpoint")                                     \
    X(FOREIGN_CHECKPOINT, -605, "a checkpoint belongs to another model or other settings")

typedef enum gust_status {
#define GUST_STATUS_ENUMERATOR(name, number, sentence) GUST_##name = (number),
    GUST_STATUS_LIST(GUST_STATUS_ENUMERATOR)
#undef GUST_STATUS_ENUMERATOR
} gust_status;

/* Name ("END_OF_DATA") and sentence of a status; never NULL, never to be freed. */
GUST_API const char *gust_status_name(gust_status status);
GUST_API const char *gust_status_text(gust_status status);

/* Status number `index` of the list, for those who want all of them; 0 past the end (and at index 0). */
GUST_API gust_status gust_status_list(int index);

#ifdef __cplusplus
}
#endif

#endif
