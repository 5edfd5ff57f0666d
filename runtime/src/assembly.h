/* The whole system from its instances: residual, Jacobian, outputs, roots, when-clauses.
 *
 * Each instance is evaluated with its own slice of y and y', the shared unknowns gathered through an index
 * table; its flows and Jacobian entries are added where the tables say. This loop over instances is what
 * lets one compiled kernel serve any number of them. */
#ifndef GUSTFORM_ASSEMBLY_H
#define GUSTFORM_ASSEMBLY_H

#include <stdbool.h>
#include <stdint.h>

#include "archive.h"
#include "model.h"

/* All instances of one type. */
typedef struct gust_block {
    const gust_model_type *type;
    gust_point *point;  /* [n_instances]: constant parts filled in; t, y, yp, w are set at each call */
    double *parameters; /* [n_instances * n_parameters] of now */
    double *constants;  /* [n_instances * n_constants] */
    double *discrete;   /* [n_instances * n_discrete] of now */
    const gust_table **tables;
    int64_t first_discrete; /* of this block among all discrete values */
    int64_t first_root;     /* of this block among all root functions of all instances */
    bool watched;           /* its roots are to be looked at */
} gust_block;

/* What the residual needs to know of one instance, gathered from block, type and kernel: with four instances
 * the way to these took longer than the small kernels themselves. */
typedef struct gust_instance {
    void (*residual)(const gust_point *at, double *residual, double *flow);
    gust_point *point;
    const int32_t *external; /* [n_external] */
    const int32_t *flow_row; /* [n_flows] */
    int32_t n_external;
    int32_t n_flows;
    int32_t first_unknown;
} gust_instance;

typedef struct gust_assembly {
    const gust_model *model;
    gust_block *blocks;
    gust_instance *instances; /* [n_instances] of all types, in order */
    int64_t n_instances;
    double *inputs;   /* [n_inputs] for the time being evaluated */
    double *discrete; /* [n_discrete] of all instances; the blocks point into it */
    double *shared;   /* scratch, the largest n_external */
    double *flow;     /* scratch, the largest n_flows */
    double *entry;    /* scratch, the largest n_nonzeros */
    double *output;   /* scratch, the largest n_outputs */
    int64_t n_discrete;
    int64_t n_roots; /* of all instances */
} gust_assembly;

/* Arrays for the model, with its parameters, inputs and discrete values. Free with gust_assembly_free. */
gust_status gust_assembly_create(gust_assembly *assembly, const gust_model *model);
void gust_assembly_free(gust_assembly *assembly);

/* Inputs must hold for time t in all of these. */

/* F(t, y, y') into residual[n_unknowns]. */
void gust_assembly_residual(gust_assembly *assembly, double t, const double *y, const double *yp,
                            double *residual);

/* dF/dy + cj dF/dy' into values[n_nonzeros]. */
void gust_assembly_jacobian(gust_assembly *assembly, double t, const double *y, const double *yp, double cj,
                            double *values);

/* Outputs of one instance into assembly->output. */
void gust_assembly_outputs(gust_assembly *assembly, const gust_block *block, int32_t instance, double t,
                           const double *y, const double *yp);

/* Root functions of one instance into value[n_roots of its type]. */
void gust_assembly_roots(gust_assembly *assembly, const gust_block *block, int32_t instance, double t,
                         const double *y, const double *yp, double *value);

/* When-clause `clause` of one instance: reads y, yp and the discrete values of now, writes the unknowns it
 * changes into y_after and the discrete values into discrete_after (all unknowns, all discrete values). */
void gust_assembly_when(gust_assembly *assembly, const gust_block *block, int32_t instance, int32_t clause,
                        double t, const double *y, const double *yp, double *y_after, double *discrete_after);

/* For checkpoints: inputs, parameters and discrete values of now. After loading, gust_assembly_prepare works
 * out what follows from the parameters. */
void gust_assembly_archive(gust_assembly *assembly, gust_archive *archive);
void gust_assembly_prepare(gust_assembly *assembly);

/* Sets one parameter and what follows from it. */
void gust_assembly_set_parameter(gust_assembly *assembly, int32_t type, int32_t instance, int32_t parameter,
                                 double value);

#endif
