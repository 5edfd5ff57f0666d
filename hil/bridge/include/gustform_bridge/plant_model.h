/* A model of libgustform as a plant: apart from the bus, for both sides have names of their own.
 *
 * Owned by the caller; gust_plant_model_open allocates what gust_plant_model_close frees. Built only with
 * -DGUST_BRIDGE_PLANT=ON.
 */
#ifndef GUSTFORM_BRIDGE_PLANT_MODEL_H
#define GUSTFORM_BRIDGE_PLANT_MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* One sample: commands hold the last ones on entry. Not 0: stop. */
typedef int (*gust_plant_step)(void *context, double time, const double *measurements, double *commands);

typedef struct gust_plant_model {
    void *model, *sim;
    double period; /* s */
    uint32_t n_measurements, n_commands;
    const char *const *measurements; /* names; the model's */
    const char *const *commands;
    const double *start;
} gust_plant_model;

/* The first sampled block of the model in `file` is stepped by `step`. false and a text if there is none. */
bool gust_plant_model_open(gust_plant_model *plant, const char *file, gust_plant_step step, void *context,
                           char *text, size_t size);

/* Until `step` stops it; false and a text if the simulation fails. */
bool gust_plant_model_run(gust_plant_model *plant, char *text, size_t size);

/* Simulated time, s. */
double gust_plant_model_time(const gust_plant_model *plant);

void gust_plant_model_close(gust_plant_model *plant);

#endif
