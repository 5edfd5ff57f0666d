/* Preloaded into linux.uml: what its calls of ptrace need and do not have.
 *
 * The end of its processes with it. Each process of a guest is one of the host that linux.uml traces, and
 * system calls of the guest's programs are held up there. Were linux.uml killed, they would be let go: some
 * stay stopped for good and hold the runner's pipes open, others go on and their system calls reach the host's
 * kernel. PTRACE_O_EXITKILL has the host's kernel kill them with their tracer.
 *
 * Vector registers, where the processor has more state than it knows: AMX, 11,008 bytes and not 2,696. Debian
 * 12's user-mode Linux hands them to PTRACE_SETREGSET in an area of fixed size, and the host's kernel takes
 * only an area of exactly its own size: EFAULT, and the guest panics at its first process. This wrapper lays
 * UML's area at the head of one of full size. Components that have no room in UML's area are marked as unused
 * in the header's bit field, so the processor gives them their initial values: nothing of one guest process is
 * seen by another. Reading needs no help, the host fills what fits. */
#define _GNU_SOURCE
#include <cpuid.h>
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

enum {
    XSAVE_LEAF = 0xd,
    XSAVE_USED_AT = 512,      /* XSTATE_BV: which components hold other than their initial values */
    XSAVE_FIRST_EXTENDED = 2, /* components 0 and 1, x87 and SSE, lie in the area's fixed head */
    XSAVE_COMPONENTS = 63,
    LARGEST_AREA = 65536,
    OLD_SETOPTIONS = 21 /* the number by which UML still asks; its options have kept their values */
};

typedef long ptrace_function(enum __ptrace_request request, ...);

/* The size of the host's area with all that its kernel has switched on. */
static size_t host_size(void)
{
    unsigned size = 0;
    unsigned unused[3];
    __cpuid_count(XSAVE_LEAF, 0, unused[0], size, unused[1], unused[2]);
    return size;
}

/* The components that lie wholly within the first `size` bytes. */
static uint64_t components_within(size_t size)
{
    uint64_t fitting = UINT64_C(3);
    for (unsigned i = XSAVE_FIRST_EXTENDED; i < XSAVE_COMPONENTS; i++) {
        unsigned length = 0;
        unsigned offset = 0;
        unsigned unused[2];
        __cpuid_count(XSAVE_LEAF, i, length, offset, unused[0], unused[1]);
        if (length > 0 && (size_t)offset + length <= size) {
            fitting |= UINT64_C(1) << i;
        }
    }
    return fitting;
}

static long set_wide(ptrace_function *real, pid_t process, void *kind, const struct iovec *narrow, size_t size)
{
    static unsigned char area[LARGEST_AREA]; /* all zeros behind what is copied; UML's kernel has one thread */
    static uint64_t fitting;
    if (fitting == 0) {
        fitting = components_within(narrow->iov_len);
    }
    memcpy(area, narrow->iov_base, narrow->iov_len);
    uint64_t used = 0;
    memcpy(&used, area + XSAVE_USED_AT, sizeof used);
    used &= fitting;
    memcpy(area + XSAVE_USED_AT, &used, sizeof used);
    struct iovec wide = {area, size};
    return real(PTRACE_SETREGSET, process, kind, &wide);
}

long ptrace(enum __ptrace_request request, ...)
{
    static ptrace_function *real;
    static size_t wanted;
    if (real == NULL) {
        void *const next = dlsym(RTLD_NEXT, "ptrace");
        memcpy(&real, &next, sizeof real);
        wanted = host_size();
    }
    va_list rest;
    va_start(rest, request);
    const pid_t process = va_arg(rest, pid_t);
    void *const address = va_arg(rest, void *);
    void *const data = va_arg(rest, void *);
    va_end(rest);
    if (request == PTRACE_SETREGSET && (uintptr_t)address == NT_X86_XSTATE) {
        const struct iovec *const area = data;
        if (area->iov_len > XSAVE_USED_AT + sizeof(uint64_t) && area->iov_len < wanted &&
            wanted <= LARGEST_AREA) {
            return set_wide(real, process, address, area, wanted);
        }
    }
    if (request == PTRACE_SETOPTIONS || (int)request == OLD_SETOPTIONS) {
        const uintptr_t options = (uintptr_t)data | (uintptr_t)PTRACE_O_EXITKILL;
        return real(PTRACE_SETOPTIONS, process, address, options);
    }
    return real(request, process, address, data);
}
