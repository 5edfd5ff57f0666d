/* What a simulation consists of. */
#ifndef GUSTFORM_SIMULATION_H
#define GUSTFORM_SIMULATION_H

#include <stdatomic.h>
#include <stdbool.h>

#include "controls.h"
#include "events.h"
#include "gustform/gust_sim.h"
#include "initial.h"
#include "options.h"
#include "sampler.h"
#include "sink.h"
#include "solver.h"
#include "system.h"

typedef enum gust_phase {
    GUST_PHASE_CREATED, /* options and callbacks may be set */
    GUST_PHASE_READY,   /* initialised: may be advanced */
    GUST_PHASE_ENDED    /* stopped for good: advancing gives the same status again */
} gust_phase;

struct gust_sim {
    const gust_model *model;
    gust_phase phase;
    gust_status ended_with;
    gust_options options; /* as set */
    gust_options solving; /* with the tolerances that the solver works to */
    gust_system system;
    gust_sampler sampler;
    gust_controls controls;
    gust_events events;
    gust_solver solver;
    gust_initial initial;
    gust_sink sink;
    gust_sink probe;     /* rows for statistics, on a grid of their own */
    bool pending;        /* the integrator stands at an event that has not been handled */
    bool root_found;     /* and it is a zero crossing */
    double next_event;   /* known time at which something will happen, s */
    double reached;      /* time that advance() has reached, s; the integrator may be a step ahead */
    _Atomic double time; /* the same, for other threads */
    int64_t cut_steps;   /* made shorter because a series turns within them */
    atomic_int stop;     /* set by gust_sim_request_stop */
    uint8_t *checkpoint; /* [checkpoint_room] bytes of the last one */
    size_t checkpoint_room;
    size_t checkpoint_size; /* 0: none yet */
    char message[4096];
};

/* Allocates the room for checkpoints; frees it. */
gust_status gust_checkpoint_create(gust_sim *sim);
void gust_checkpoint_free(gust_sim *sim);

/* The next time at which a sample, a scheduled change or a step of a series is due, s. */
double gust_next_event(const gust_sim *sim);

/* First step of the integrator at t, s: after consistent values were found and conditions settled there. */
double gust_first_step(gust_sim *sim, double t);

/* Starts the integrator anew where it stands, as if after an event that changed nothing. */
gust_status gust_begin_anew(gust_sim *sim);

/* The loop of gust_sim_advance, without hand-over of the last block. */
gust_status gust_integrate(gust_sim *sim, double until);

#endif
