/* Parameters of the controller over the bus, by their stable ids: read, write, activate.
 *
 * A write is staged: the controller goes on with what it has. Activate hands everything staged to recalibrate,
 * which takes over all of it or, if one value is not allowed, nothing; then what was staged is given up. The
 * state is kept by recalibrate but an output may jump with a gain, so writing and activating belong to READY,
 * where commands are blocked; `in_run` allows them while running, for who commissions and knows what a step
 * does.
 *
 * One request a period: of several, the last is answered. Owned by the caller, no allocation.
 */
#ifndef GUSTFORM_BRIDGE_PARAMETERS_H
#define GUSTFORM_BRIDGE_PARAMETERS_H

#include <stdbool.h>
#include <stdint.h>

#include "faults.h"
#include "gust_controller.h"
#include "messages.h"

#define GUST_PARAMETERS 96 /* of a controller, at most */

typedef enum gust_operation {
    GUST_OPERATION_READ,
    GUST_OPERATION_WRITE,
    GUST_OPERATION_ACTIVATE
} gust_operation;

typedef enum gust_result {
    GUST_RESULT_DONE,
    GUST_RESULT_UNKNOWN_ID,
    GUST_RESULT_RANGE,
    GUST_RESULT_STATE
} gust_result;

typedef struct gust_request {
    bool asked;
    uint32_t operation;
    uint32_t id;
    double value; /* to be written; of the answer: what holds now, staged values included */
} gust_request;

typedef struct gust_parameters {
    const gust_controller *controller;
    bool in_run;
    gust_request request;
    double active[GUST_PARAMETERS];
} gust_parameters;

/* false: more parameters than GUST_PARAMETERS. The context has been started up. */
bool gust_parameters_init(gust_parameters *parameters, const gust_controller *controller, const void *context,
                          bool in_run);

/* Keep a request until gust_parameters_answer. */
void gust_parameters_ask(gust_parameters *parameters, const gust_message *message, const double *values);

/* Do what was asked; `request.value` becomes what holds now. */
gust_result gust_parameters_answer(gust_parameters *parameters, void *context, gust_state state);

#endif
