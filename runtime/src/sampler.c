#include "sampler.h"

#include <math.h>

#include "memory.h"
#include "moment.h"

gust_status gust_sampler_create(gust_sampler *sampler, const gust_system *system)
{
    const gust_model *model = system->model;
    *sampler = (gust_sampler){.model = model};
    int64_t count = 0;
    for (int32_t b = 0; b < model->n_types; ++b) {
        const gust_model_type *type = &model->types[b];
        for (int32_t k = 0; k < type->kernel->n_whens; ++k) {
            count += type->when_period[k] >= 0 ? type->n_instances : 0;
        }
    }
    if (count > INT32_MAX) {
        return GUST_OUT_OF_MEMORY;
    }
    sampler->sampled = gust_allocate((size_t)count, sizeof *sampler->sampled);
    if (sampler->sampled == NULL) {
        return GUST_OUT_OF_MEMORY;
    }
    for (int32_t b = 0; b < model->n_types; ++b) {
        const gust_model_type *type = &model->types[b];
        for (int32_t i = 0; i < type->n_instances; ++i) {
            for (int32_t k = 0; k < type->kernel->n_whens; ++k) {
                if (type->when_period[k] >= 0) {
                    sampler->sampled[sampler->n_sampled++] =
                        (gust_sampled){.block = &system->assembly.blocks[b],
                                       .instance = i,
                                       .clause = k,
                                       .parameter = type->when_period[k]};
                }
            }
        }
    }
    return GUST_OK;
}

void gust_sampler_free(gust_sampler *sampler)
{
    gust_release(sampler->sampled);
    *sampler = (gust_sampler){0};
}

static double period_of(const gust_sampled *sampled)
{
    const int32_t n_parameters = sampled->block->type->kernel->n_parameters;
    return sampled->block->parameters[(int64_t)sampled->instance * n_parameters + sampled->parameter];
}

/* Periods may have changed: a clause then counts from its last sample, and if the next one should have been
 * before t it is now. */
static bool renew_periods(gust_sampler *sampler, double t, const gust_sampled **bad)
{
    for (int32_t k = 0; k < sampler->n_sampled; ++k) {
        gust_sampled *sampled = &sampler->sampled[k];
        const double period = period_of(sampled);
        if (!(period > 0.0 && isfinite(period))) {
            *bad = sampled;
            return false;
        }
        if (period == sampled->period) {
            continue;
        }
        const double last = sampled->start + (double)(sampled->count - 1) * sampled->period;
        sampled->start = sampled->count > 0 ? last + period : sampled->start;
        sampled->start = sampled->start < t ? t : sampled->start;
        sampled->count = 0;
        sampled->period = period;
        sampled->next = sampled->start;
    }
    return true;
}

bool gust_sampler_start(gust_sampler *sampler, gust_system *system, double t0, const gust_sampled **bad)
{
    bool changed = false;
    for (int32_t k = 0; k < sampler->n_sampled; ++k) {
        sampler->sampled[k].start = t0;
        sampler->sampled[k].count = 0;
    }
    return gust_sampler_change(sampler, system, t0, &changed, bad) && renew_periods(sampler, t0, bad);
}

double gust_sampler_next(const gust_sampler *sampler)
{
    double next = INFINITY;
    if (sampler->next_change < sampler->model->n_schedule) {
        next = sampler->model->schedule[sampler->next_change].time;
    }
    for (int32_t k = 0; k < sampler->n_sampled; ++k) {
        next = sampler->sampled[k].next < next ? sampler->sampled[k].next : next;
    }
    return next;
}

void gust_sampler_take(gust_sampler *sampler, double t, bool *any)
{
    const double now = gust_moment_end(t);
    for (int32_t k = 0; k < sampler->n_sampled; ++k) {
        gust_sampled *sampled = &sampler->sampled[k];
        sampled->due = sampled->next <= now;
        if (sampled->due) {
            *any = true;
            ++sampled->count;
            sampled->next = sampled->start + (double)sampled->count * sampled->period;
        }
    }
}

bool gust_sampler_change(gust_sampler *sampler, gust_system *system, double t, bool *changed,
                         const gust_sampled **bad)
{
    const double now = gust_moment_end(t);
    const gust_model *model = sampler->model;
    bool any = false;
    while (sampler->next_change < model->n_schedule && model->schedule[sampler->next_change].time <= now) {
        const gust_schedule_entry *entry = &model->schedule[sampler->next_change++];
        const gust_block *block = &system->assembly.blocks[entry->type];
        const double old =
            block->parameters[(int64_t)entry->instance * block->type->kernel->n_parameters + entry->parameter];
        any = any || old != entry->value;
        gust_assembly_set_parameter(&system->assembly, entry->type, entry->instance, entry->parameter,
                                    entry->value);
    }
    *changed = *changed || any;
    return !any || renew_periods(sampler, t, bad);
}

void gust_sampler_archive(gust_sampler *sampler, gust_archive *archive)
{
    gust_archive_small_index(archive, "sampler.next_change", &sampler->next_change, 0,
                             sampler->model->n_schedule);
    for (int32_t k = 0; k < sampler->n_sampled; ++k) {
        gust_sampled *sampled = &sampler->sampled[k];
        gust_archive_doubles(archive, "sampler.period", &sampled->period, 1);
        gust_archive_doubles(archive, "sampler.start", &sampled->start, 1);
        gust_archive_index(archive, "sampler.count", &sampled->count, 0, INT64_MAX / 2);
        gust_archive_doubles(archive, "sampler.next", &sampled->next, 1);
    }
}
