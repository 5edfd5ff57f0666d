/* Sampled blocks while a simulation runs: controllers that measure at an instance and hold commands there.
 *
 * A block steps at start + count * period: it reads the values before everything else that happens then, and
 * its commands act from then on, or with a delay of one sample from the next one on. Whatever steps it, the
 * library of the model or the host, measurements and commands are rounded to the controller's number type. */
#ifndef GUSTFORM_CONTROLS_H
#define GUSTFORM_CONTROLS_H

#include <stdbool.h>
#include <stdint.h>

#include "gustform/gust_sim.h"
#include "system.h"

typedef struct gust_control {
    const gust_model_sampled *what;
    const gust_controller *controller; /* NULL: none in the model */
    gust_sampled_step step;            /* of the host, in its place; NULL: none */
    void *host;
    int64_t *context;    /* of the controller */
    int64_t n_context;   /* words */
    double *measurement; /* of the last sample */
    double *command;     /* that the last sample gave */
    double *waiting;     /* of the sample before it, with a delay */
    double start;        /* s */
    int64_t count;       /* samples since start */
    double next;         /* s */
    bool due;
    bool recalibrate; /* parameters have changed */
    gust_sampled_statistics statistics;
} gust_control;

typedef struct gust_controls {
    const gust_model *model;
    gust_control *control;
    int32_t n_controls;
    int32_t next_change; /* in the changes of the model */
} gust_controls;

/* Blocks of the model; contexts are allocated. Free with gust_controls_free, also after an error. */
gust_status gust_controls_create(gust_controls *controls, const gust_model *model);
void gust_controls_free(gust_controls *controls);

/* Starts every controller at t0 with what the model says, and holds the first commands in the system. */
gust_status gust_controls_start(gust_controls *controls, gust_system *system, double t0, char *message,
                                size_t size);

/* Next time at which a block has to be stepped or changed, s. */
double gust_controls_next(const gust_controls *controls);

/* The share of the tolerances that a step may take: every sample begins anew, at order one and with an error of
 * its own, and these add up. 1 without blocks. */
double gust_controls_share(const gust_controls *controls);

/* Makes the changes and the steps due at t, where y, yp and the inputs hold; commands wait in the blocks. *any
 * is set if there is one. */
gust_status gust_controls_step(gust_controls *controls, gust_system *system, double t, const double *y,
                               const double *yp, bool *any, char *message, size_t size);

/* Holds the commands of the blocks that have stepped; *changed is set if one has become another. */
void gust_controls_hold(gust_controls *controls, gust_system *system, bool *changed);

/* For checkpoints. */
void gust_controls_archive(gust_controls *controls, gust_archive *archive);

#endif
