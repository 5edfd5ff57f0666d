/* The harness on a computer: files by stdio, no ticks, the stack of the process. */
#include "port.h"

#include <stdio.h>

static FILE *inputs, *records;

bool port_open(void)
{
    inputs = fopen("inputs.bin", "rb");
    records = fopen("records.bin", "wb");
    return inputs != NULL && records != NULL;
}

bool port_read(void *data, uint32_t size)
{
    return fread(data, size, 1, inputs) == 1U;
}

bool port_write(const void *data, uint32_t size)
{
    return fwrite(data, size, 1, records) == 1U;
}

bool port_close(void)
{
    const bool read = fclose(inputs) == 0;
    return (fclose(records) == 0) && read;
}

uint32_t port_call(uint32_t (*function)(void *context), void *context, uint32_t *ticks)
{
    *ticks = 0U;
    return function(context);
}

uint32_t port_nothing(void *context)
{
    (void)context;
    return 0U;
}

uint32_t port_thousand(void *context)
{
    (void)context;
    return 0U;
}

void port_paint(void)
{
}

uint32_t port_stack(void)
{
    return 0U;
}
