/* The section directory of a GUSTTAB1 file: which arrays there are and where, all bounds checked. */
#ifndef GUSTFORM_CONTAINER_H
#define GUSTFORM_CONTAINER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { GUST_SECTION_NAME = 56 };

typedef enum gust_dtype { GUST_F64 = 1, GUST_I32 = 2, GUST_U8 = 3, GUST_I64 = 4 } gust_dtype;

typedef struct gust_section {
    char name[GUST_SECTION_NAME];
    gust_dtype dtype;
    uint64_t count;
    const void *data; /* 64-byte aligned, inside the bytes of the container */
} gust_section;

typedef struct gust_container {
    gust_section *sections; /* sorted by name */
    uint32_t n_sections;
} gust_container;

/* Bytes of one element. */
size_t gust_dtype_size(gust_dtype dtype);

/* Reads the directory of bytes[size], which must start on a 64-byte boundary and outlive the container.
 * false and a message if anything in it cannot be. Free with gust_container_close. */
bool gust_container_open(gust_container *container, const uint8_t *bytes, size_t size, char *message,
                         size_t message_size);

void gust_container_close(gust_container *container);

/* The section of that exact name, or NULL. */
const gust_section *gust_container_find(const gust_container *container, const char *name);

#endif
