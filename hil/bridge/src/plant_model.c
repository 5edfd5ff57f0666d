#include "gustform_bridge/plant_model.h"

#ifdef GUST_BRIDGE_PLANT

#include <stdio.h>
#include <string.h>

#include "gustform/gust_model.h"
#include "gustform/gust_sim.h"

#define UNTIL 1e9 /* s: for ever */

bool gust_plant_model_open(gust_plant_model *plant, const char *file, gust_plant_step step, void *context,
                           char *text, size_t size)
{
    gust_model *model = NULL;
    gust_sim *sim = NULL;
    memset(plant, 0, sizeof *plant);
    if (gust_model_load(file, &model, text, size) != GUST_OK) {
        return false;
    }
    plant->model = model;
    const gust_sampled_info *block = gust_model_sampled_block(model, 0);
    if (block == NULL) {
        (void)snprintf(text, size, "it has no sampled control");
        return false;
    }
    plant->period = block->period;
    plant->n_measurements = (uint32_t)block->n_measurements;
    plant->n_commands = (uint32_t)block->n_commands;
    plant->measurements = block->measurement_name;
    plant->commands = block->command_name;
    plant->start = block->command_start;
    const bool good =
        gust_sim_create(model, &sim) == GUST_OK && gust_sim_set_sampled(sim, 0, step, context) == GUST_OK;
    plant->sim = sim;
    if (!good) {
        (void)snprintf(text, size, "it cannot be run");
    }
    return good;
}

bool gust_plant_model_run(gust_plant_model *plant, char *text, size_t size)
{
    gust_sim *sim = plant->sim;
    gust_status status = gust_sim_initialise(sim, 0.0);
    if (status == GUST_OK) {
        status = gust_sim_advance(sim, UNTIL, NULL);
    }
    if (status < 0) {
        (void)snprintf(text, size, "%s", gust_sim_message(sim));
    }
    return status >= 0;
}

double gust_plant_model_time(const gust_plant_model *plant)
{
    return gust_sim_time(plant->sim);
}

void gust_plant_model_close(gust_plant_model *plant)
{
    gust_sim *sim = plant->sim;
    gust_model *model = plant->model;
    gust_sim_destroy(&sim);
    gust_model_destroy(&model);
    memset(plant, 0, sizeof *plant);
}

#endif
