#include "sink.h"

#include <math.h>
#include <stdlib.h>

#include "memory.h"

/* An output channel on its way into the plan. */
typedef struct wanted {
    int32_t instance; /* counted through all types */
    int32_t output;
    int32_t channel;
} wanted;

static int by_instance(const void *left, const void *right)
{
    const wanted *a = left;
    const wanted *b = right;
    if (a->instance != b->instance) {
        return a->instance < b->instance ? -1 : 1;
    }
    return a->channel < b->channel ? -1 : 1;
}

static void make_groups(gust_sink *sink, const gust_system *system, const wanted *list, int32_t count)
{
    for (int32_t k = 0; k < count; ++k) {
        sink->output[k] = list[k].output;
        sink->channel[k] = list[k].channel;
        if (k == 0 || list[k].instance != list[k - 1].instance) {
            int32_t instance = list[k].instance;
            int32_t t = 0;
            while (instance >= system->model->types[t].n_instances) {
                instance -= system->model->types[t++].n_instances;
            }
            sink->groups[sink->n_groups++] = (gust_sink_group){&system->assembly.blocks[t], instance, k, 0};
        }
        ++sink->groups[sink->n_groups - 1].count;
    }
}

static bool is_wanted(const gust_stats *stats, int32_t channel)
{
    for (int32_t k = 0; stats != NULL && k < stats->n_channels; ++k) {
        if (stats->channels[k].column == channel) {
            return true;
        }
    }
    return stats == NULL;
}

gust_status gust_sink_create(gust_sink *sink, const gust_system *system, gust_stats *stats)
{
    const gust_model *model = system->model;
    const size_t n = (size_t)model->n_channels;
    *sink = (gust_sink){.model = model, .stats = stats, .next_time = INFINITY};
    wanted *list = gust_allocate(n, sizeof *list);
    sink->groups = gust_allocate(n, sizeof *sink->groups);
    sink->output = gust_allocate(n, sizeof *sink->output);
    sink->channel = gust_allocate(n, sizeof *sink->channel);
    sink->copied = gust_allocate(n, sizeof *sink->copied);
    sink->row = gust_allocate(n, sizeof *sink->row);
    if (list == NULL || sink->copied == NULL || sink->groups == NULL || sink->output == NULL ||
        sink->channel == NULL || sink->row == NULL) {
        gust_release(list);
        return GUST_OUT_OF_MEMORY;
    }
    int32_t count = 0;
    for (int32_t k = 0; k < model->n_channels; ++k) {
        if (!is_wanted(stats, k)) {
            continue;
        }
        if (model->channels[k].kind == GUST_CHANNEL_UNKNOWN) {
            sink->copied[sink->n_copied++] = k;
        } else {
            list[count++] = (wanted){model->channels[k].a, model->channels[k].b, k};
        }
    }
    qsort(list, (size_t)count, sizeof *list, by_instance);
    make_groups(sink, system, list, count);
    sink->derivatives = count > 0;
    gust_release(list);
    return GUST_OK;
}

void gust_sink_free(gust_sink *sink)
{
    gust_release(sink->groups);
    gust_release(sink->output);
    gust_release(sink->channel);
    gust_release(sink->copied);
    gust_release(sink->row);
    gust_release(sink->time);
    gust_release(sink->values);
    *sink = (gust_sink){0};
}

gust_status gust_sink_open(gust_sink *sink, double start)
{
    sink->start = start;
    if (sink->stats != NULL) {
        sink->interval = gust_stats_interval(sink->stats);
        sink->next_time = start;
    }
    if (sink->receive == NULL) {
        return GUST_OK;
    }
    const size_t rows = (size_t)sink->block_rows;
    sink->time = gust_allocate(rows, sizeof *sink->time);
    sink->values = gust_allocate(rows * (size_t)sink->model->n_channels, sizeof *sink->values);
    sink->next_time = start;
    return sink->time != NULL && sink->values != NULL ? GUST_OK : GUST_OUT_OF_MEMORY;
}

bool gust_sink_evaluate(gust_sink *sink, gust_system *system, double t, const double *y, const double *yp,
                        double *row)
{
    if (!gust_system_inputs(system, t)) {
        return false;
    }
    const gust_channel *channels = sink->model->channels;
    for (int32_t k = 0; k < sink->n_copied; ++k) {
        row[sink->copied[k]] = y[channels[sink->copied[k]].a];
    }
    for (int32_t g = 0; g < sink->n_groups; ++g) {
        const gust_sink_group *group = &sink->groups[g];
        gust_assembly_outputs(&system->assembly, group->block, group->instance, t, y, yp);
        for (int32_t k = group->first; k < group->first + group->count; ++k) {
            row[sink->channel[k]] = system->assembly.output[sink->output[k]];
        }
    }
    return true;
}

gust_status gust_sink_add(gust_sink *sink, gust_system *system, const double *y, const double *yp)
{
    if (!gust_sink_evaluate(sink, system, sink->next_time, y, yp, sink->row)) {
        return system->series.failure;
    }
    const double time = sink->next_time;
    ++sink->next_row;
    sink->next_time = sink->start + (double)sink->next_row * sink->interval;
    if (sink->stats != NULL) {
        return gust_stats_add(sink->stats, 1, &time, sink->row);
    }
    const int32_t n = sink->model->n_channels;
    float *values = sink->values + (int64_t)sink->filled * n;
    for (int32_t k = 0; k < n; ++k) {
        values[k] = (float)sink->row[k];
    }
    sink->time[sink->filled++] = time;
    return sink->filled == sink->block_rows ? gust_sink_flush(sink) : GUST_OK;
}

gust_status gust_sink_flush(gust_sink *sink)
{
    if (sink->receive == NULL || sink->filled == 0) {
        return GUST_OK;
    }
    const int32_t rows = sink->filled;
    sink->filled = 0;
    const int answer = sink->receive(sink->context, rows, sink->time, sink->values);
    if (answer < 0) {
        return GUST_SINK_FAILED;
    }
    return answer > 0 ? GUST_SINK_STOPPED : GUST_OK;
}

void gust_sink_archive_kind(gust_sink *sink, gust_archive *archive)
{
    const bool used = sink->receive != NULL || sink->stats != NULL;
    gust_archive_same(archive, "rows.interval", used ? sink->interval : 0.0);
    gust_archive_same_identity(archive, "statistics", sink->stats != NULL ? sink->stats->identity : 0);
}

void gust_sink_archive(gust_sink *sink, gust_archive *archive)
{
    gust_archive_doubles(archive, "rows.start", &sink->start, 1);
    gust_archive_index(archive, "rows.next", &sink->next_row, 0, INT64_MAX / 2);
    if (archive->mode == GUST_ARCHIVE_LOAD && isfinite(sink->next_time)) {
        sink->next_time = sink->start + (double)sink->next_row * sink->interval;
    }
    if (sink->stats != NULL) {
        gust_stats_archive(sink->stats, archive);
    }
}
