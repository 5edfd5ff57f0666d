/* Runs a controller over recorded samples; the same source on the host and on a board.
 *
 * Reads inputs.bin, the inputs of each sample in the controller's number type, and writes records.bin: for each
 * sample the ticks that its step took and the whole context after it, then one gust_pil_summary. Compile with
 * -DCONTROLLER=<prefix>_controller.
 */
#include "gust_controller.h"
#include "port.h"

#include <stdbool.h>

extern const gust_controller CONTROLLER;

enum { LARGEST_CONTEXT = 4096, LARGEST_ROW = 32 * 8 };

typedef struct gust_pil_summary {
    uint32_t samples;
    uint32_t errors;         /* samples whose step returned an error signal */
    uint32_t ticks_nothing;  /* of a function that only returns: one instruction */
    uint32_t ticks_thousand; /* of one with a thousand instructions before that */
    uint32_t stack;          /* bytes that no step went beyond */
    uint32_t context_size;
} gust_pil_summary;

static double context[LARGEST_CONTEXT / 8];
static unsigned char row[LARGEST_ROW];

static void write_inputs(const gust_controller *c)
{
    for (uint32_t k = 0U; k < c->n_inputs; k++) {
        (void)memcpy((char *)context + c->inputs[k].offset, &row[(size_t)k * c->real_size], c->real_size);
    }
}

/* All samples; false if the results cannot be written. */
static bool run(const gust_controller *c, gust_pil_summary *summary)
{
    const uint32_t width = c->n_inputs * c->real_size;

    while (port_read(row, width)) {
        uint32_t ticks = 0U;
        write_inputs(c);
        if (port_call(c->step, context, &ticks) != 0U) {
            summary->errors++;
        }
        summary->samples++;
        if (!port_write(&ticks, (uint32_t)sizeof ticks) || !port_write(context, c->context_size)) {
            return false;
        }
    }
    return true;
}

int main(void)
{
    const gust_controller *c = &CONTROLLER;
    gust_pil_summary summary = {0};

    if ((c->context_size > LARGEST_CONTEXT) || (c->n_inputs * c->real_size > LARGEST_ROW) || !port_open()) {
        return 1;
    }
    summary.context_size = c->context_size;
    (void)port_call(port_nothing, context, &summary.ticks_nothing);
    (void)port_call(port_thousand, context, &summary.ticks_thousand);
    (void)c->startup(context);
    port_paint();
    if (!run(c, &summary)) {
        return 1;
    }
    summary.stack = port_stack();
    return (port_write(&summary, (uint32_t)sizeof summary) && port_close()) ? 0 : 1;
}
