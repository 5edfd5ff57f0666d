#include "gustform_bridge/parameters.h"

#include <string.h>

#include "gustform_bridge/link.h"

/* Of every exported controller's error signal: the calibration was refused. */
#define ERROR_PARAMETER UINT32_C(0x8)

bool gust_parameters_init(gust_parameters *parameters, const gust_controller *controller, const void *context,
                          bool in_run)
{
    memset(parameters, 0, sizeof *parameters);
    parameters->controller = controller;
    parameters->in_run = in_run;
    for (uint32_t k = 0; k < controller->n_parameters && k < GUST_PARAMETERS; ++k) {
        parameters->active[k] = gust_controller_get(controller, context, &controller->parameters[k]);
    }
    return controller->n_parameters <= GUST_PARAMETERS;
}

void gust_parameters_ask(gust_parameters *parameters, const gust_message *message, const double *values)
{
    parameters->request = (gust_request){
        .asked = true,
        .operation = (uint32_t)gust_link_get(message, values, GUST_FIELD_OPERATION, 0.0),
        .id = (uint32_t)gust_link_get(message, values, GUST_FIELD_PARAMETER, 0.0),
        .value = gust_link_get(message, values, GUST_FIELD_VALUE, 0.0),
    };
}

static const gust_controller_signal *find(const gust_controller *controller, uint32_t id)
{
    for (uint32_t k = 0; k < controller->n_parameters; ++k) {
        if (controller->parameters[k].id == id) {
            return &controller->parameters[k];
        }
    }
    return NULL;
}

/* All of what was staged, or nothing. */
static gust_result activate(gust_parameters *parameters, void *context)
{
    const gust_controller *controller = parameters->controller;
    const bool good = (controller->recalibrate(context) & ERROR_PARAMETER) == 0;
    for (uint32_t k = 0; k < controller->n_parameters; ++k) {
        if (good) {
            parameters->active[k] = gust_controller_get(controller, context, &controller->parameters[k]);
        } else {
            gust_controller_set(controller, context, &controller->parameters[k], parameters->active[k]);
        }
    }
    if (!good) {
        (void)controller->recalibrate(context); /* clears the error: what is active is good */
    }
    return good ? GUST_RESULT_DONE : GUST_RESULT_RANGE;
}

static gust_result access(gust_parameters *parameters, void *context)
{
    gust_request *request = &parameters->request;
    const gust_controller_signal *parameter = find(parameters->controller, request->id);
    if (parameter == NULL) {
        return GUST_RESULT_UNKNOWN_ID;
    }
    gust_result result = GUST_RESULT_DONE;
    if (request->operation == GUST_OPERATION_WRITE) {
        if (request->value >= parameter->low && request->value <= parameter->high) {
            gust_controller_set(parameters->controller, context, parameter, request->value);
        } else {
            result = GUST_RESULT_RANGE;
        }
    }
    request->value = gust_controller_get(parameters->controller, context, parameter);
    return result;
}

gust_result gust_parameters_answer(gust_parameters *parameters, void *context, gust_state state)
{
    gust_request *request = &parameters->request;
    request->asked = false;
    const bool allowed = state == GUST_STATE_READY || (state == GUST_STATE_RUN && parameters->in_run);
    if (request->operation != GUST_OPERATION_READ && !allowed) {
        return GUST_RESULT_STATE;
    }
    return request->operation == GUST_OPERATION_ACTIVATE ? activate(parameters, context)
                                                         : access(parameters, context);
}
