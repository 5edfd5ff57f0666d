/* gust-bridge --role plant: a model of libgustform on the bus in place of the converter.
 *
 * The first sampled block of the model is stepped by the bus: what it measures goes out, the references that
 * answer come back. --clock monotonic keeps the period by this computer's clock, --clock sync goes on as soon
 * as the answer is there: lock-step, at whatever speed. Built only with -DGUST_BRIDGE_PLANT=ON.
 */
#ifndef GUSTFORM_BRIDGE_PLANT_PROGRAM_H
#define GUSTFORM_BRIDGE_PLANT_PROGRAM_H

#include "messages.h"
#include "options.h"

/* Until the model ends, a signal comes or something fails: an exit code. Prints JSON lines. */
int gust_plant_program(const gust_options *options, const gust_message_set *messages);

#endif
