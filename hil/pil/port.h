/* What the harness needs of the machine it runs on: board.c for a Cortex-M, host.c for a computer. */
#ifndef GUST_PIL_PORT_H
#define GUST_PIL_PORT_H

#include <stdbool.h>
#include <stdint.h>

/* Opens inputs.bin and records.bin in the working folder. */
bool port_open(void);

/* Reads exactly `size` bytes of the inputs; false at their end. */
bool port_read(void *data, uint32_t size);

/* Appends to the records. */
bool port_write(const void *data, uint32_t size);

/* Closes both; false if something was not written. */
bool port_close(void);

/* Calls `function` on a stack of its own and measures it in ticks; 0 ticks where there is no such measure. */
uint32_t port_call(uint32_t (*function)(void *context), void *context, uint32_t *ticks);

/* One instruction, and a thousand and one: the scale of the ticks. */
uint32_t port_nothing(void *context);
uint32_t port_thousand(void *context);

/* Fills the stack of port_call with a pattern. */
void port_paint(void);

/* The bytes of that stack that have been written to since; 0 where it is not known. */
uint32_t port_stack(void);

#endif
