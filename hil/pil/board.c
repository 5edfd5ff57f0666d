/* The harness on a Cortex-M with an FPU: start-up, files by semihosting, SysTick, a painted stack.
 *
 * No interrupt is enabled, so whatever is measured is the controller's. Under QEMU's -icount SysTick counts
 * virtual time, which goes on by a fixed amount with each instruction; ticks are no cycles of a real core.
 */
#include "port.h"

#include <stddef.h>

enum { STACK_WORDS = 1024, PATTERN = 0x5AC3A53C };

/* ---- start-up
 * ---------------------------------------------------------------------------------------------------- */
#define CPACR (*(volatile uint32_t *)0xE000ED88U)
#define SYST  ((volatile uint32_t *)0xE000E010U) /* control, reload, current */

extern uint32_t board_stack_top, board_data_from, board_data_begin, board_data_end, board_bss_begin,
    board_bss_end;
extern int main(void);
void board_reset(void);
void board_fault(void);

/* Initial stack pointer, reset, and one handler for all exceptions of the core. */
static const struct {
    const void *stack;
    void (*handler[15])(void);
} vectors __attribute__((section(".vectors"), used)) = {
    &board_stack_top,
    {board_reset, board_fault, board_fault, board_fault, board_fault, board_fault, NULL, NULL, NULL, NULL,
     board_fault, board_fault, NULL, board_fault, board_fault},
};

/* ---- semihosting
 * ------------------------------------------------------------------------------------------------- */
enum { SYS_OPEN = 0x01, SYS_CLOSE = 0x02, SYS_WRITE = 0x05, SYS_READ = 0x06, SYS_EXIT_EXTENDED = 0x20 };
enum { MODE_READ_BINARY = 1, MODE_WRITE_BINARY = 5, APPLICATION_EXIT = 0x20026 };

static uint32_t inputs, records;

static uint32_t host_call(uint32_t operation, const void *arguments)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = arguments;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void leave(uint32_t status)
{
    const uint32_t block[2] = {APPLICATION_EXIT, status};
    for (;;) {
        (void)host_call(SYS_EXIT_EXTENDED, block);
    }
}

static uint32_t open_file(const char *name, uint32_t length, uint32_t mode)
{
    const uint32_t block[3] = {(uint32_t)name, mode, length};
    return host_call(SYS_OPEN, block);
}

/* Reads and writes return how much is left over. */
static bool transfer(uint32_t operation, uint32_t file, const void *data, uint32_t size)
{
    const uint32_t block[3] = {file, (uint32_t)data, size};
    return host_call(operation, block) == 0U;
}

bool port_open(void)
{
    inputs = open_file("inputs.bin", 10U, MODE_READ_BINARY);
    records = open_file("records.bin", 11U, MODE_WRITE_BINARY);
    return inputs != UINT32_MAX && records != UINT32_MAX;
}

bool port_read(void *data, uint32_t size)
{
    return transfer(SYS_READ, inputs, data, size);
}

bool port_write(const void *data, uint32_t size)
{
    return transfer(SYS_WRITE, records, data, size);
}

bool port_close(void)
{
    return host_call(SYS_CLOSE, &records) == 0U;
}

void board_reset(void)
{
    const uint32_t *from = &board_data_from;

    CPACR |= 0xFU << 20; /* the FPU, before anything may use it */
    for (uint32_t *to = &board_data_begin; to < &board_data_end; to++) {
        *to = *from++;
    }
    for (uint32_t *to = &board_bss_begin; to < &board_bss_end; to++) {
        *to = 0U;
    }
    SYST[1] = 0xFFFFFFU;
    SYST[2] = 0U;
    SYST[0] = 5U; /* on, at the core's clock, without an interrupt */
    leave((uint32_t)main());
}

void board_fault(void)
{
    leave(70U);
}

/* ---- measuring
 * --------------------------------------------------------------------------------------------------- */
static uint64_t stack[STACK_WORDS / 2];

/* Calls function(context) with the stack pointer at `top`; span: SysTick, which counts down, before and after.
 */
uint32_t board_call(uint32_t (*function)(void *context), void *context, void *top, uint32_t span[2]);

__asm__(".syntax unified\n"
        ".thumb\n"
        ".section .text.board_call,\"ax\"\n"
        ".global board_call\n"
        ".thumb_func\n"
        "board_call:\n"
        "    push {r4, r5, r6, lr}\n"
        "    mov r4, sp\n"
        "    mov r5, r3\n"
        "    mov r6, r0\n"
        "    mov sp, r2\n"
        "    mov r0, r1\n"
        "    ldr r2, =0xE000E018\n"
        "    ldr r3, [r2]\n"
        "    str r3, [r5]\n"
        "    blx r6\n"
        "    ldr r2, =0xE000E018\n"
        "    ldr r3, [r2]\n"
        "    str r3, [r5, #4]\n"
        "    mov sp, r4\n"
        "    pop {r4, r5, r6, pc}\n"
        "    .ltorg\n"
        ".section .text.port_nothing,\"ax\"\n"
        ".global port_nothing\n"
        ".thumb_func\n"
        "port_nothing:\n"
        "    bx lr\n"
        ".section .text.port_thousand,\"ax\"\n"
        ".global port_thousand\n"
        ".thumb_func\n"
        "port_thousand:\n"
        "    .rept 1000\n"
        "    nop\n"
        "    .endr\n"
        "    bx lr\n"
        ".text\n");

uint32_t port_call(uint32_t (*function)(void *context), void *context, uint32_t *ticks)
{
    uint32_t span[2] = {0U, 0U};
    const uint32_t result = board_call(function, context, stack + STACK_WORDS / 2, span);
    *ticks = (span[0] - span[1]) & 0xFFFFFFU;
    return result;
}

void port_paint(void)
{
    for (size_t k = 0U; k < STACK_WORDS / 2; k++) {
        stack[k] = ((uint64_t)PATTERN << 32) | (uint64_t)PATTERN;
    }
}

uint32_t port_stack(void)
{
    const uint32_t *words = (const uint32_t *)stack;
    size_t clean = 0U;
    while (clean < STACK_WORDS && words[clean] == (uint32_t)PATTERN) {
        clean++;
    }
    return (uint32_t)(4U * (STACK_WORDS - clean));
}
