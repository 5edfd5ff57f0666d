#include "model.h"

#include <stdbool.h>
#include <stddef.h>

#include "controller_library.h"
#include "kernel_library.h"
#include "memory.h"
#include "text.h"

void gust_model_destroy(gust_model **model)
{
    if (model == NULL || *model == NULL) {
        return;
    }
    gust_model *old = *model;
    for (int32_t t = 0; old->types != NULL && t < old->n_types; ++t) {
        gust_kernel_close(old->types[t].library);
    }
    for (int32_t k = 0; old->libraries != NULL && k < old->n_libraries; ++k) {
        gust_controller_close(old->libraries[k].library);
    }
    for (int32_t k = 0; old->sampled != NULL && k < old->n_sampled; ++k) {
        gust_release(old->sampled[k].measurement);
    }
    for (int64_t k = 0; k < old->n_text_tables; ++k) {
        gust_release(old->text_tables[k]);
    }
    for (int32_t k = 0; old->paths != NULL && k < old->n_series; ++k) {
        gust_release(old->paths[k]);
    }
    gust_release(old->text_tables);
    gust_release(old->paths);
    gust_release(old->types);
    gust_release(old->series);
    gust_release(old->tables);
    gust_release(old->schedule);
    gust_release(old->channels);
    gust_release(old->libraries);
    gust_release(old->sampled);
    gust_release(old->sampled_starts);
    gust_release(old->sampled_changes);
    gust_release(old->unowned);
    gust_release(old->bytes);
    gust_release(old);
    *model = NULL;
}

int32_t gust_model_n_unknowns(const gust_model *model)
{
    return model->n_unknowns;
}

int32_t gust_model_n_nonzeros(const gust_model *model)
{
    return model->n_nonzeros;
}

int32_t gust_model_n_channels(const gust_model *model)
{
    return model->n_channels;
}

int32_t gust_model_n_series(const gust_model *model)
{
    return model->n_series;
}

int32_t gust_model_n_sampled(const gust_model *model)
{
    return model->n_sampled;
}

const gust_sampled_info *gust_model_sampled_block(const gust_model *model, int32_t block)
{
    return block >= 0 && block < model->n_sampled ? &model->sampled[block].info : NULL;
}

int32_t gust_model_n_instances(const gust_model *model)
{
    return model->n_instances;
}

const char *gust_model_channel_name(const gust_model *model, int32_t channel)
{
    return channel >= 0 && channel < model->n_channels ? model->channels[channel].name : "";
}

const char *gust_model_channel_unit(const gust_model *model, int32_t channel)
{
    return channel >= 0 && channel < model->n_channels ? model->channels[channel].unit : "";
}

const char *gust_model_series_name(const gust_model *model, int32_t series)
{
    return series >= 0 && series < model->n_series ? model->series[series].name : "";
}

const char *gust_model_metadata(const gust_model *model)
{
    return model->metadata;
}

/* An unknown or row that belongs to no instance is known by what the first instance connected to it calls
 * it; `names` and `index` are that instance's shared unknowns or flows. */
static bool shared_name(const gust_model *model, int32_t wanted, bool flows, char *text, size_t size)
{
    for (int32_t t = 0; t < model->n_types; ++t) {
        const gust_model_type *type = &model->types[t];
        const int32_t count = flows ? type->kernel->n_flows : type->kernel->n_external;
        const int32_t *index = flows ? type->flow_row : type->external;
        const char **names = flows ? type->flow_name : type->external_name;
        for (int32_t i = 0; i < type->n_instances; ++i) {
            for (int32_t k = 0; k < count; ++k) {
                if (index[(int64_t)i * count + k] == wanted) {
                    gust_text_append(text, size, "%s.%s", type->instance_name[i], names[k]);
                    return true;
                }
            }
        }
    }
    return false;
}

/* The instance that owns an unknown; its type in *owner and its number as the result, or -1. */
static int32_t owner_of(const gust_model *model, int32_t unknown, const gust_model_type **owner)
{
    for (int32_t t = 0; t < model->n_types; ++t) {
        const gust_model_type *type = &model->types[t];
        for (int32_t i = 0; i < type->n_instances; ++i) {
            if (unknown >= type->first_unknown[i] &&
                unknown - type->first_unknown[i] < type->kernel->n_unknowns) {
                *owner = type;
                return i;
            }
        }
    }
    return -1;
}

void gust_model_unknown_name(const gust_model *model, int32_t unknown, char *text, size_t size)
{
    const gust_model_type *type = NULL;
    const int32_t instance = owner_of(model, unknown, &type);
    gust_text(text, size, "%s", "");
    if (instance >= 0) {
        gust_text(text, size, "%s.%s", type->instance_name[instance],
                  type->unknown_name[unknown - type->first_unknown[instance]]);
    } else if (!shared_name(model, unknown, false, text, size)) {
        gust_text(text, size, "unknown %d", unknown);
    }
}

void gust_model_equation_name(const gust_model *model, int32_t row, char *text, size_t size)
{
    const gust_model_type *type = NULL;
    const int32_t instance = owner_of(model, row, &type);
    if (instance >= 0) {
        gust_text(text, size, "%s: %s", type->instance_name[instance],
                  type->equation_name[row - type->first_unknown[instance]]);
        return;
    }
    gust_text(text, size, "sum of flows at ");
    if (!shared_name(model, row, true, text, size)) {
        gust_text(text, size, "row %d, to which no equation belongs", row);
    }
}
