/* One simulation of a model: options and callbacks, then initialise, then advance as often as wanted.
 *
 *     gust_sim *sim;
 *     gust_sim_create(model, &sim);
 *     gust_sim_set_option(sim, "rtol", 1e-6);
 *     gust_sim_set_sink(sim, 0.02, 1024, write_rows, file);
 *     gust_sim_initialise(sim, 0.0);            // the last call that allocates
 *     gust_sim_advance(sim, 90.0, &reached);
 *     gust_sim_destroy(&sim);
 *
 * Every function returns a gust_status unless it says otherwise; gust_sim_message tells the details of
 * the last status that was not GUST_OK. A simulation is used by one thread at a time, except
 * gust_sim_request_stop and gust_sim_time, which any thread may call, the former also a signal handler.
 */
#ifndef GUSTFORM_GUST_SIM_H
#define GUSTFORM_GUST_SIM_H

#include <stddef.h>
#include <stdint.h>

#include "gust_export.h"
#include "gust_model.h"
#include "gust_stats.h"
#include "gust_status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct gust_sim gust_sim;

/* Delivers samples first .. first + count - 1 of a series (counted from 0) into time[count] (NULL for a
 * uniform series) and value[count]. Returns how many it delivered, fewer than count only at the end of
 * the data, negative on failure. Called while advancing, with any `first`; usually in order. */
typedef int (*gust_series_reader)(void *context, int64_t first, int64_t count, double *time, double *value);

/* Takes a block of result rows: time[rows] (s), values[rows * channels], one row after the other. The
 * arrays belong to the simulation and are reused. Returns 0, a positive number to stop the run, a negative
 * one to report a failure. */
typedef int (*gust_row_sink)(void *context, int64_t rows, const double *time, const float *values);

/* One sample of a sampled block in place of the model's own controller: measurements[n_measurements] at `time`
 * (s) in, commands[n_commands] out, which on entry hold what the sample before gave. Returns 0, a positive
 * number to stop the run, a negative one to report a failure. Numbers are rounded to the block's number type on
 * either side. */
typedef int (*gust_sampled_step)(void *context, double time, const double *measurements, double *commands);

enum { GUST_SAMPLED_ERRORS = 8 };

/* How a sampled block has fared. */
typedef struct gust_sampled_statistics {
    int64_t samples;
    int64_t bad_samples;                 /* with an error signal other than 0 */
    int64_t errors[GUST_SAMPLED_ERRORS]; /* samples with that bit of it set, least first */
    double first_error;                  /* time of the first bad sample, s; NaN: none */
} gust_sampled_statistics;

typedef struct gust_statistics {
    int64_t steps;                /* accepted steps */
    int64_t residual_evaluations; /* of the whole system */
    int64_t jacobian_evaluations;
    int64_t factorisations;      /* with a new choice of pivots */
    int64_t refactorisations;    /* with the pivots of the last factorisation */
    int64_t error_test_failures; /* steps repeated because the local error was too large */
    int64_t nonlinear_iterations;
    int64_t nonlinear_failures; /* corrector iterations that did not converge */
    int64_t root_evaluations;
    int64_t events;             /* times at which something happened */
    int64_t restarts;           /* of the integrator, after events */
    int64_t initial_iterations; /* Newton iterations for consistent values, at the start and after events */
    int64_t rows;               /* result rows produced */
    int64_t cut_steps;          /* made shorter because a series turns within them */
    double last_step;           /* s */
    int32_t last_order;
} gust_statistics;

/* What an option is; the texts are never to be freed. */
typedef struct gust_option_info {
    const char *name;
    const char *sentence;
    double initial; /* value unless set */
    double minimum;
    double maximum;
} gust_option_info;

/* Option number `index`, or NULL past the end. */
GUST_API const gust_option_info *gust_option_list(int index);

/* A simulation of `model`, which must outlive it. *sim is the caller's, to be given back by
 * gust_sim_destroy; NULL on an error. */
GUST_API gust_status gust_sim_create(const gust_model *model, gust_sim **sim);

/* Frees the simulation and sets *sim to NULL. Does nothing if it is NULL already. */
GUST_API void gust_sim_destroy(gust_sim **sim);

/* Before initialise. */
GUST_API gust_status gust_sim_set_option(gust_sim *sim, const char *name, double value);
GUST_API gust_status gust_sim_option(const gust_sim *sim, const char *name, double *value);

/* Before initialise: where a series with source "reader" gets its samples. `context` stays the caller's. */
GUST_API gust_status gust_sim_set_series_reader(gust_sim *sim, int32_t series, gust_series_reader reader,
                                                void *context);

/* Before initialise: result rows at t0, t0 + interval, ... in blocks of at most block_rows. The last,
 * partial block is delivered when advance() ends: at `until`, on a stop and on an error. A row at the time
 * of an event holds the values before it. `context` stays the caller's. */
GUST_API gust_status gust_sim_set_sink(gust_sim *sim, double interval, int32_t block_rows, gust_row_sink sink,
                                       void *context);

/* Before initialise: `stats`, whose columns are the channels of the model, gets a row at `start` (s; at the
 * start of the simulation if that is later) and each of its intervals from then on. Only what it looks at is
 * worked out. It stays the caller's and must outlive the simulation; results may be asked for between two
 * advances. NULL: none. */
GUST_API gust_status gust_sim_set_statistics(gust_sim *sim, gust_stats *stats, double start);

/* Before initialise: `step` takes the place of the controller of a sampled block (counted from 0, see
 * gust_model_sampled_block). NULL: the model's own again. `context` stays the caller's; a checkpoint holds
 * nothing of it. What the model's controller would tell of itself, its monitors, is recorded as NaN. */
GUST_API gust_status gust_sim_set_sampled(gust_sim *sim, int32_t block, gust_sampled_step step, void *context);

/* Samples and errors of a sampled block so far. */
GUST_API gust_status gust_sim_sampled_statistics(gust_sim *sim, int32_t block,
                                                 gust_sampled_statistics *statistics);

/* Finds consistent values at t0 (s), starting from the start values of the model. */
GUST_API gust_status gust_sim_initialise(gust_sim *sim, double t0);

/* Integrates to `until` (s) or to whatever stops it earlier; *reached (may be NULL) is the time reached.
 * The integrator itself may look ahead of `until` by a step, never past an event. */
GUST_API gust_status gust_sim_advance(gust_sim *sim, double until, double *reached);

/* Makes the running or the next advance() return GUST_STOP_REQUESTED after the current step. */
GUST_API void gust_sim_request_stop(gust_sim *sim);

/* Simulated time reached (s). */
GUST_API double gust_sim_time(const gust_sim *sim);

/* Checkpoints: everything the run needs to go on, in another process or after a crash.
 *
 *     gust_sim_advance(sim, next, &reached);   // rows up to `next` have been handed over: write them out first
 *     gust_sim_checkpoint(sim, "run.gustck");
 *
 *     gust_sim_create ... options, readers, sink and statistics as before ... gust_sim_initialise(sim, t0);
 *     gust_sim_restore(sim, "run.gustck");     // gust_sim_statistics(...).rows: how many rows there were
 *     gust_sim_advance(sim, until, &reached);
 *
 * The integrator starts anew at a checkpoint, in the run that writes it as in the one that takes it up: both
 * then take the same steps and give the same rows, bit for bit, on one machine and build of this library. A
 * checkpoint does not depend on where the model file lies. */

/* After initialise: state at the time reached, into the file `path`, which is replaced in one go: whatever
 * happens, it holds this checkpoint or the one before. NULL: no file. CHECKPOINT_FAILED: not written, the
 * simulation can go on. Does not allocate. */
GUST_API gust_status gust_sim_checkpoint(gust_sim *sim, const char *path);

/* Bytes of the last checkpoint; they belong to the simulation and hold until the next one. */
GUST_API gust_status gust_sim_checkpoint_bytes(const gust_sim *sim, const void **bytes, size_t *size);

/* After initialise, at any time: to the state of a checkpoint. FOREIGN_CHECKPOINT: it belongs to another model,
 * other options, another sink or other statistics; BAD_CHECKPOINT: it is damaged or none;
 * CHECKPOINT_UNREADABLE: there is no such file. After these the simulation is as it was, unless the message
 * says otherwise. May allocate, as initialise does. */
GUST_API gust_status gust_sim_restore(gust_sim *sim, const char *path);
GUST_API gust_status gust_sim_restore_bytes(gust_sim *sim, const void *bytes, size_t size);

/* What the last status that was not GUST_OK was about; "" if there was none. Belongs to the simulation. */
GUST_API const char *gust_sim_message(const gust_sim *sim);

GUST_API gust_status gust_sim_statistics(const gust_sim *sim, gust_statistics *statistics);

/* Time reached, unknowns y[n_unknowns] and their derivatives yp[n_unknowns] there; each may be NULL. */
GUST_API gust_status gust_sim_state(gust_sim *sim, double *time, double *y, double *yp);

/* All channels at the time reached, into row[n_channels]. */
GUST_API gust_status gust_sim_channels(gust_sim *sim, double *row);

/* F(t, y, y') into residual[n_unknowns]; after create, with the parameters and discrete values of now. */
GUST_API gust_status gust_sim_residual(gust_sim *sim, double t, const double *y, const double *yp,
                                       double *residual);

/* dF/dy + cj dF/dy' into values[n_nonzeros], in the column order of the model's pattern. */
GUST_API gust_status gust_sim_jacobian(gust_sim *sim, double t, const double *y, const double *yp, double cj,
                                       double *values);

/* Versions of the solvers in this library, "6.4.1"; never to be freed. */
GUST_API const char *gust_sundials_version(void);
GUST_API const char *gust_klu_version(void);

#ifdef __cplusplus
}
#endif

#endif
