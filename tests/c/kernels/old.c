/* A kernel library of another interface version. */
#include "gustform/gust_kernel.h"

static const gust_kernel KERNEL = {.abi = GUST_KERNEL_ABI + 1, .type_name = "old"};

const gust_kernel *gust_kernel_get(void);

const gust_kernel *gust_kernel_get(void)
{
    return &KERNEL;
}
