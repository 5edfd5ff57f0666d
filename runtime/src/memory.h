/* Zeroed arrays that start on a cache line, so that vector loops need no peeling. */
#ifndef GUSTFORM_MEMORY_H
#define GUSTFORM_MEMORY_H

#include <stddef.h>

/* count elements of `size` bytes, all zero; at least one cache line even for count = 0, so that NULL always
 * means "no memory". The caller frees with gust_release. */
void *gust_allocate(size_t count, size_t size);

void gust_release(void *block);

#endif
