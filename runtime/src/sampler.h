/* What happens at known times: sampled when-clauses and scheduled parameter changes. */
#ifndef GUSTFORM_SAMPLER_H
#define GUSTFORM_SAMPLER_H

#include <stdbool.h>
#include <stdint.h>

#include "system.h"

/* One sampled clause of one instance. Its samples are at start + count * period, counted, so that no error
 * adds up over a million samples. */
typedef struct gust_sampled {
    const gust_block *block;
    int32_t instance;
    int32_t clause;
    int32_t parameter; /* that holds the period */
    double period;     /* s */
    double start;      /* s */
    int64_t count;     /* samples since start */
    double next;       /* s */
    bool due;
} gust_sampled;

typedef struct gust_sampler {
    const gust_model *model;
    gust_sampled *sampled;
    int32_t n_sampled;
    int32_t next_change; /* in the schedule of the model */
} gust_sampler;

/* Free with gust_sampler_free. */
gust_status gust_sampler_create(gust_sampler *sampler, const gust_system *system);
void gust_sampler_free(gust_sampler *sampler);

/* First samples at t0; changes up to t0 are made. false: a period is not positive, see *bad. */
bool gust_sampler_start(gust_sampler *sampler, gust_system *system, double t0, const gust_sampled **bad);

/* For checkpoints. */
void gust_sampler_archive(gust_sampler *sampler, gust_archive *archive);

/* Next time at which something is due, s. */
double gust_sampler_next(const gust_sampler *sampler);

/* Marks the clauses due at t (`due`) and moves them to their next sample; *any is set if there are some. */
void gust_sampler_take(gust_sampler *sampler, double t, bool *any);

/* Makes the parameter changes due at t; *changed is set if a value became another. false: see *bad. */
bool gust_sampler_change(gust_sampler *sampler, gust_system *system, double t, bool *changed,
                         const gust_sampled **bad);

#endif
