/* Opening the shared library with the kernel of one unit type. */
#ifndef GUSTFORM_KERNEL_LIBRARY_H
#define GUSTFORM_KERNEL_LIBRARY_H

#include <stddef.h>

#include "gustform/gust_kernel.h"

/* The kernel in the library at `path`; *library is to be closed with gust_kernel_close once nobody uses
 * the kernel. NULL and a message if there is none, or one of another interface version. */
const gust_kernel *gust_kernel_open(const char *path, void **library, char *message, size_t size);

void gust_kernel_close(void *library);

#endif
