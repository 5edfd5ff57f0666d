/* Checked sections of a model file while it is being loaded. Every function returns false, with status and
 * message kept, for a section that is not what it should be. */
#ifndef GUSTFORM_READER_H
#define GUSTFORM_READER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "container.h"
#include "gustform/gust_status.h"
#include "model.h"

typedef struct gust_reader {
    gust_model *model;
    gust_container container;
    const char *folder; /* where relative paths start; NULL for the working folder */
    char *message;
    size_t message_size;
    gust_status status;
    char prefix[32]; /* "type.3." while that type is read */
} gust_reader;

__attribute__((format(printf, 3, 4))) void gust_reader_note(gust_reader *load, gust_status status,
                                                            const char *format, ...);

/* Keeps status and message; false, so that a function can return it. */
#define gust_refuse(...) (gust_reader_note(__VA_ARGS__), false)

bool gust_read_no_memory(gust_reader *load);

/* Section prefix + name of exactly `count` elements into *data, which points into the file. */
bool gust_read_array(gust_reader *load, const char *name, gust_dtype dtype, int64_t count, const void **data);
bool gust_read_doubles(gust_reader *load, const char *name, int64_t count, const double **data);
bool gust_read_finite(gust_reader *load, const char *name, int64_t count, const double **data);
bool gust_read_integers(gust_reader *load, const char *name, int64_t count, const int32_t **data);
bool gust_read_bytes(gust_reader *load, const char *name, int64_t count, const uint8_t **data);

/* An array of whatever length it has. */
bool gust_read_sized(gust_reader *load, const char *name, gust_dtype dtype, const void **data, int64_t *count);

/* Integers, all in low .. high - 1. */
bool gust_read_indices(gust_reader *load, const char *name, int64_t count, int32_t low, int32_t high,
                       const int32_t **data);

/* `count` strings, each closed by a zero byte, as an array of pointers that the model owns. */
bool gust_read_texts(gust_reader *load, const char *name, int64_t count, const char ***table);

/* One string, "" if the section is absent. */
bool gust_read_text(gust_reader *load, const char *name, const char **result);

/* folder/path, from gust_allocate; NULL if the path needs no folder, or for want of memory. */
const char *gust_read_path(const char *folder, const char *path);

#endif
