/* The options of a simulation: one table, the values of one simulation beside it. */
#ifndef GUSTFORM_OPTIONS_H
#define GUSTFORM_OPTIONS_H

#include "gustform/gust_sim.h"

/* X(name, initial value, minimum, maximum, sentence) */
#define GUST_OPTION_LIST(X)                                                                                    \
    X(rtol, 1e-6, 1e-14, 1e-1, "relative tolerance of one step")                                               \
    X(atol, 0.0, 0.0, 1e6, "absolute tolerance in nominal values of each unknown; 0: a hundredth of rtol")     \
    X(max_step, 0.0, 0.0, 1e12, "largest step, s; 0: no limit")                                                \
    X(first_step, 0.0, 0.0, 1e12, "first step at the start and after events, s; 0: estimated")                 \
    X(max_order, 5.0, 1.0, 5.0, "highest order of the BDF")                                                    \
    X(suppress_algebraic, 1.0, 0.0, 1.0, "1: only differential unknowns take part in the error test")          \
    X(kinks, 0.0, 0.0, 1.0, "1: locate every limiter crossing and restart there; 0: pass over them")           \
    X(nonlinear_coefficient, 0.33, 1e-6, 10.0, "how exactly a step is solved, in tolerances")                  \
    X(nonlinear_iterations, 4.0, 1.0, 100.0, "Newton iterations in a step before it is made smaller")          \
    X(cj_change, 0.1, 0.0, 0.95, "relative change of the step's leading coefficient that renews the Jacobian") \
    X(growth_check, 20.0, 0.0, 1e9, "refactorisations between two checks of the pivot growth; 0: never check") \
    X(growth_limit, 1e-8, 0.0, 1.0, "reciprocal pivot growth under which pivots are chosen anew")              \
    X(initial_iterations, 50.0, 1.0, 10000.0, "Newton iterations for consistent values")                       \
    X(initial_tolerance, 0.01, 1e-12, 1e3,                                                                     \
      "size of the last Newton correction of consistent values, in tolerances")                                \
    X(event_iterations, 20.0, 1.0, 10000.0, "rounds in which when-clauses may trigger each other at one time") \
    X(chatter_events, 200.0, 2.0, 1e9, "events in direct succession that count as chattering")                 \
    X(chatter_interval, 1e-7, 0.0, 1.0, "time between events below which they are in direct succession, s")    \
    X(series_block, 1024.0, 16.0, 1e7, "samples read at once from a series that is not held in the model")     \
    X(series_tolerance, 1e-3, 0.0, 1e3,                                                                        \
      "how far samples inside a step may leave the line between its ends, of their size; 0: not looked at")

typedef struct gust_options {
#define GUST_OPTION_FIELD(name, initial, minimum, maximum, sentence) double name;
    GUST_OPTION_LIST(GUST_OPTION_FIELD)
#undef GUST_OPTION_FIELD
} gust_options;

/* Absolute tolerance in nominal values. Unless set, a hundredth of rtol, as Modelica tools have it: measured
 * on the load step, every state then stays within 10 rtol of its nominal over the whole run (7 rtol; with the
 * same as rtol it was 70). */
static inline double gust_options_absolute(const gust_options *options)
{
    return options->atol > 0.0 ? options->atol : 0.01 * options->rtol;
}

/* Sets all to their initial values. */
void gust_options_reset(gust_options *options);

/* Where the value of an option is, NULL if there is none of that name; *info (may be NULL) its row. */
double *gust_options_find(gust_options *options, const char *name, const gust_option_info **info);

#endif
