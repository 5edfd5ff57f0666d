#include "assembly.h"

#include <string.h>

#include "memory.h"

static int32_t larger(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

static bool create_block(gust_assembly *assembly, gust_block *block, const gust_model_type *type)
{
    const gust_kernel *kernel = type->kernel;
    const size_t ni = (size_t)type->n_instances;
    block->type = type;
    block->point = gust_allocate(ni, sizeof *block->point);
    block->parameters = gust_allocate(ni * (size_t)kernel->n_parameters, sizeof(double));
    block->constants = gust_allocate(ni * (size_t)kernel->n_constants, sizeof(double));
    block->tables = gust_allocate(ni * (size_t)kernel->n_tables, sizeof(const gust_table *));
    if (block->point == NULL || block->parameters == NULL || block->constants == NULL ||
        block->tables == NULL) {
        return false;
    }
    memcpy(block->parameters, type->parameters, ni * (size_t)kernel->n_parameters * sizeof(double));
    block->discrete = assembly->discrete + block->first_discrete;
    memcpy(block->discrete, type->discrete, ni * (size_t)kernel->n_discrete * sizeof(double));
    for (size_t k = 0; k < ni * (size_t)kernel->n_tables; ++k) {
        block->tables[k] = &assembly->model->tables[type->table[k]];
    }
    for (size_t i = 0; i < ni; ++i) {
        gust_point *point = &block->point[i];
        double *constants = block->constants + i * (size_t)kernel->n_constants;
        point->u = assembly->inputs + type->first_input[i];
        point->d = block->discrete + i * (size_t)kernel->n_discrete;
        point->p = block->parameters + i * (size_t)kernel->n_parameters;
        point->c = constants;
        point->tables = block->tables + i * (size_t)kernel->n_tables;
        point->w = assembly->shared;
        kernel->prepare(point->p, constants);
    }
    return true;
}

static bool list_instances(gust_assembly *assembly)
{
    const gust_model *model = assembly->model;
    int64_t count = 0;
    for (int32_t t = 0; t < model->n_types; ++t) {
        count += model->types[t].n_instances;
    }
    assembly->instances = gust_allocate((size_t)count, sizeof *assembly->instances);
    if (assembly->instances == NULL) {
        return false;
    }
    for (int32_t t = 0; t < model->n_types; ++t) {
        const gust_model_type *type = &model->types[t];
        const gust_kernel *kernel = type->kernel;
        for (int32_t i = 0; i < type->n_instances; ++i) {
            assembly->instances[assembly->n_instances++] =
                (gust_instance){.residual = kernel->residual,
                                .point = &assembly->blocks[t].point[i],
                                .external = type->external + (int64_t)i * kernel->n_external,
                                .flow_row = type->flow_row + (int64_t)i * kernel->n_flows,
                                .n_external = kernel->n_external,
                                .n_flows = kernel->n_flows,
                                .first_unknown = type->first_unknown[i]};
        }
    }
    return true;
}

gust_status gust_assembly_create(gust_assembly *assembly, const gust_model *model)
{
    *assembly = (gust_assembly){.model = model};
    int32_t n_external = 0;
    int32_t n_flows = 0;
    int32_t n_nonzeros = 0;
    int32_t n_outputs = 0;
    assembly->blocks = gust_allocate((size_t)model->n_types, sizeof *assembly->blocks);
    if (assembly->blocks == NULL) {
        return GUST_OUT_OF_MEMORY;
    }
    for (int32_t t = 0; t < model->n_types; ++t) {
        const gust_kernel *kernel = model->types[t].kernel;
        n_external = larger(n_external, kernel->n_external);
        n_flows = larger(n_flows, kernel->n_flows);
        n_nonzeros = larger(n_nonzeros, kernel->n_nonzeros);
        n_outputs = larger(n_outputs, kernel->n_outputs);
        assembly->blocks[t].first_discrete = assembly->n_discrete;
        assembly->blocks[t].first_root = assembly->n_roots;
        assembly->n_discrete += (int64_t)model->types[t].n_instances * kernel->n_discrete;
        assembly->n_roots += (int64_t)model->types[t].n_instances * kernel->n_roots;
    }
    assembly->inputs = gust_allocate((size_t)model->n_inputs, sizeof(double));
    assembly->discrete = gust_allocate((size_t)assembly->n_discrete, sizeof(double));
    assembly->shared = gust_allocate((size_t)n_external, sizeof(double));
    assembly->flow = gust_allocate((size_t)n_flows, sizeof(double));
    assembly->entry = gust_allocate((size_t)n_nonzeros, sizeof(double));
    assembly->output = gust_allocate((size_t)n_outputs, sizeof(double));
    if (assembly->inputs == NULL || assembly->discrete == NULL || assembly->shared == NULL ||
        assembly->flow == NULL || assembly->entry == NULL || assembly->output == NULL) {
        return GUST_OUT_OF_MEMORY;
    }
    memcpy(assembly->inputs, model->input_value, (size_t)model->n_inputs * sizeof(double));
    for (int32_t t = 0; t < model->n_types; ++t) {
        if (!create_block(assembly, &assembly->blocks[t], &model->types[t])) {
            return GUST_OUT_OF_MEMORY;
        }
    }
    return list_instances(assembly) ? GUST_OK : GUST_OUT_OF_MEMORY;
}

void gust_assembly_free(gust_assembly *assembly)
{
    for (int32_t t = 0; assembly->blocks != NULL && t < assembly->model->n_types; ++t) {
        gust_release(assembly->blocks[t].point);
        gust_release(assembly->blocks[t].parameters);
        gust_release(assembly->blocks[t].constants);
        gust_release(assembly->blocks[t].tables);
    }
    gust_release(assembly->blocks);
    gust_release(assembly->instances);
    gust_release(assembly->inputs);
    gust_release(assembly->discrete);
    gust_release(assembly->shared);
    gust_release(assembly->flow);
    gust_release(assembly->entry);
    gust_release(assembly->output);
    *assembly = (gust_assembly){0};
}

/* The point of an instance at (t, y, yp), with its shared unknowns gathered. */
static inline const gust_point *point_at(const gust_assembly *assembly, const gust_block *block,
                                         int32_t instance, double t, double cj, const double *y,
                                         const double *yp)
{
    const gust_model_type *type = block->type;
    const int32_t n_external = type->kernel->n_external;
    const int32_t *external = type->external + (int64_t)instance * n_external;
    double *shared = assembly->shared;
    for (int32_t k = 0; k < n_external; ++k) {
        shared[k] = y[external[k]];
    }
    gust_point *point = &block->point[instance];
    point->t = t;
    point->cj = cj;
    point->y = y + type->first_unknown[instance];
    point->yp = yp + type->first_unknown[instance];
    return point;
}

void gust_assembly_residual(gust_assembly *assembly, double t, const double *y, const double *yp,
                            double *residual)
{
    const gust_model *model = assembly->model;
    double *shared = assembly->shared;
    double *flow = assembly->flow;
    for (int32_t k = 0; k < model->n_unowned; ++k) {
        residual[model->unowned[k]] = 0.0;
    }
    const gust_instance *end = assembly->instances + assembly->n_instances;
    for (const gust_instance *instance = assembly->instances; instance < end; ++instance) {
        for (int32_t k = 0; k < instance->n_external; ++k) {
            shared[k] = y[instance->external[k]];
        }
        gust_point *point = instance->point;
        point->t = t;
        point->cj = 0.0;
        point->y = y + instance->first_unknown;
        point->yp = yp + instance->first_unknown;
        instance->residual(point, residual + instance->first_unknown, flow);
        for (int32_t k = 0; k < instance->n_flows; ++k) {
            residual[instance->flow_row[k]] += flow[k];
        }
    }
}

void gust_assembly_jacobian(gust_assembly *assembly, double t, const double *y, const double *yp, double cj,
                            double *values)
{
    const gust_model *model = assembly->model;
    double *entry = assembly->entry;
    memset(values, 0, (size_t)model->n_nonzeros * sizeof *values);
    for (int32_t b = 0; b < model->n_types; ++b) {
        const gust_block *block = &assembly->blocks[b];
        const gust_model_type *type = block->type;
        const gust_kernel *kernel = type->kernel;
        const int32_t n_nonzeros = kernel->n_nonzeros;
        for (int32_t i = 0; i < type->n_instances; ++i) {
            kernel->jacobian(point_at(assembly, block, i, t, cj, y, yp), entry);
            const int32_t *position = type->jacobian_position + (int64_t)i * n_nonzeros;
            for (int32_t k = 0; k < n_nonzeros; ++k) {
                values[position[k]] += entry[k];
            }
        }
    }
}

void gust_assembly_outputs(gust_assembly *assembly, const gust_block *block, int32_t instance, double t,
                           const double *y, const double *yp)
{
    block->type->kernel->outputs(point_at(assembly, block, instance, t, 0.0, y, yp), assembly->output);
}

void gust_assembly_roots(gust_assembly *assembly, const gust_block *block, int32_t instance, double t,
                         const double *y, const double *yp, double *value)
{
    block->type->kernel->roots(point_at(assembly, block, instance, t, 0.0, y, yp), value);
}

void gust_assembly_when(gust_assembly *assembly, const gust_block *block, int32_t instance, int32_t clause,
                        double t, const double *y, const double *yp, double *y_after, double *discrete_after)
{
    const gust_model_type *type = block->type;
    const int64_t first = block->first_discrete + (int64_t)instance * type->kernel->n_discrete;
    type->kernel->when(point_at(assembly, block, instance, t, 0.0, y, yp), clause,
                       y_after + type->first_unknown[instance], discrete_after + first);
}

void gust_assembly_archive(gust_assembly *assembly, gust_archive *archive)
{
    const gust_model *model = assembly->model;
    gust_archive_doubles(archive, "inputs", assembly->inputs, model->n_inputs);
    gust_archive_doubles(archive, "discrete", assembly->discrete, assembly->n_discrete);
    for (int32_t b = 0; b < model->n_types; ++b) {
        const gust_block *block = &assembly->blocks[b];
        gust_archive_doubles(archive, "parameters", block->parameters,
                             (int64_t)block->type->n_instances * block->type->kernel->n_parameters);
    }
}

void gust_assembly_prepare(gust_assembly *assembly)
{
    for (int32_t b = 0; b < assembly->model->n_types; ++b) {
        const gust_block *block = &assembly->blocks[b];
        const gust_kernel *kernel = block->type->kernel;
        for (int32_t i = 0; i < block->type->n_instances; ++i) {
            kernel->prepare(block->point[i].p, block->constants + (int64_t)i * kernel->n_constants);
        }
    }
}

void gust_assembly_set_parameter(gust_assembly *assembly, int32_t type, int32_t instance, int32_t parameter,
                                 double value)
{
    const gust_block *block = &assembly->blocks[type];
    const gust_kernel *kernel = block->type->kernel;
    double *parameters = block->parameters + (int64_t)instance * kernel->n_parameters;
    parameters[parameter] = value;
    kernel->prepare(parameters, block->constants + (int64_t)instance * kernel->n_constants);
}
