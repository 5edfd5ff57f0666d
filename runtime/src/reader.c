#define _POSIX_C_SOURCE 200809L

#include "reader.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "gustform/gust_model.h"
#include "memory.h"

void gust_reader_note(gust_reader *load, gust_status status, const char *format, ...)
{
    if (load->message != NULL && load->message_size > 0) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(load->message, load->message_size, format, arguments);
        va_end(arguments);
    }
    load->status = status;
}

bool gust_read_no_memory(gust_reader *load)
{
    return gust_refuse(load, GUST_OUT_OF_MEMORY, "out of memory while reading the model");
}

/* -- sections ------------------------------------------------------------------------------------------- */

/* Section prefix + name; NULL if there is none, which is right only where nothing is expected in it. */
static const gust_section *section(const gust_reader *load, const char *name)
{
    char full[GUST_SECTION_NAME];
    const int length = snprintf(full, sizeof full, "%s%s", load->prefix, name);
    return length > 0 && length < (int)sizeof full ? gust_container_find(&load->container, full) : NULL;
}

static const char *dtype_name(gust_dtype dtype)
{
    switch (dtype) {
    case GUST_F64:
        return "f64";
    case GUST_I32:
        return "i32";
    case GUST_U8:
        return "u8";
    case GUST_I64:
        return "i64";
    }
    return "?";
}

/* Array `name` of exactly `count` elements into *data. */
bool gust_read_array(gust_reader *load, const char *name, gust_dtype dtype, int64_t count, const void **data)
{
    static const double nothing[1];
    const gust_section *found = section(load, name);
    if (found == NULL && count == 0) {
        *data = nothing;
        return true;
    }
    if (found == NULL) {
        return gust_refuse(load, GUST_BAD_TABLE, "section \"%s%s\" is missing: build the model again",
                           load->prefix, name);
    }
    if (found->dtype != dtype) {
        return gust_refuse(load, GUST_BAD_TABLE, "section \"%s\" holds %s, not %s: build the model again",
                           found->name, dtype_name(found->dtype), dtype_name(dtype));
    }
    if (count < 0 || found->count != (uint64_t)count) {
        return gust_refuse(load, GUST_BAD_TABLE,
                           "section \"%s\" has %llu elements, not %lld: build the model again", found->name,
                           (unsigned long long)found->count, (long long)count);
    }
    *data = found->data;
    return true;
}

bool gust_read_doubles(gust_reader *load, const char *name, int64_t count, const double **data)
{
    const void *found = NULL;
    const bool good = gust_read_array(load, name, GUST_F64, count, &found);
    *data = found;
    return good;
}

bool gust_read_integers(gust_reader *load, const char *name, int64_t count, const int32_t **data)
{
    const void *found = NULL;
    const bool good = gust_read_array(load, name, GUST_I32, count, &found);
    *data = found;
    return good;
}

bool gust_read_bytes(gust_reader *load, const char *name, int64_t count, const uint8_t **data)
{
    const void *found = NULL;
    const bool good = gust_read_array(load, name, GUST_U8, count, &found);
    *data = found;
    return good;
}

/* An array of whatever length it has. */
bool gust_read_sized(gust_reader *load, const char *name, gust_dtype dtype, const void **data, int64_t *count)
{
    const gust_section *found = section(load, name);
    *count = 0;
    if (found != NULL) {
        if (found->count > INT64_MAX / 16) {
            return gust_refuse(load, GUST_BAD_TABLE, "section \"%s\" is too long", found->name);
        }
        *count = (int64_t)found->count;
    }
    return gust_read_array(load, name, dtype, *count, data);
}

/* Array of integers, all in low .. high - 1. */
bool gust_read_indices(gust_reader *load, const char *name, int64_t count, int32_t low, int32_t high,
                       const int32_t **data)
{
    if (!gust_read_integers(load, name, count, data)) {
        return false;
    }
    for (int64_t i = 0; i < count; ++i) {
        if ((*data)[i] < low || (*data)[i] >= high) {
            return gust_refuse(load, GUST_BAD_TABLE,
                               "\"%s%s\"[%lld] is %d, outside %d ... %d: build the model again", load->prefix,
                               name, (long long)i, (*data)[i], low, high - 1);
        }
    }
    return true;
}

bool gust_read_finite(gust_reader *load, const char *name, int64_t count, const double **data)
{
    if (!gust_read_doubles(load, name, count, data)) {
        return false;
    }
    for (int64_t i = 0; i < count; ++i) {
        if (!isfinite((*data)[i])) {
            return gust_refuse(load, GUST_BAD_TABLE, "\"%s%s\"[%lld] is %g: it must be a number", load->prefix,
                               name, (long long)i, (*data)[i]);
        }
    }
    return true;
}

/* `count` strings, each closed by a zero byte, as an array of pointers that the model owns. */
bool gust_read_texts(gust_reader *load, const char *name, int64_t count, const char ***table)
{
    const uint8_t *data = NULL;
    int64_t size = 0;
    const void *found = NULL;
    if (!gust_read_sized(load, name, GUST_U8, &found, &size)) {
        return false;
    }
    data = found;
    int64_t closed = 0;
    for (int64_t i = 0; i < size; ++i) {
        closed += data[i] == 0 ? 1 : 0;
    }
    if (closed != count || (size > 0 && data[size - 1] != 0)) {
        return gust_refuse(load, GUST_BAD_TABLE,
                           "section \"%s%s\" holds %lld texts, not %lld: build the model again", load->prefix,
                           name, (long long)closed, (long long)count);
    }
    char **made = gust_allocate((size_t)count, sizeof *made);
    if (made == NULL) {
        return gust_read_no_memory(load);
    }
    load->model->text_tables[load->model->n_text_tables++] = (char *)made;
    const char *next = (const char *)data;
    for (int64_t i = 0; i < count; ++i) {
        memcpy(&made[i], &next, sizeof next);
        next += strlen(next) + 1;
    }
    *table = (const char **)made;
    return true;
}

/* One string, "" if the section is absent. */
bool gust_read_text(gust_reader *load, const char *name, const char **result)
{
    const void *found = NULL;
    int64_t size = 0;
    if (!gust_read_sized(load, name, GUST_U8, &found, &size)) {
        return false;
    }
    *result = size > 0 ? found : "";
    if (size > 0 && (*result)[size - 1] != '\0') {
        return gust_refuse(load, GUST_BAD_TABLE, "section \"%s%s\" is not closed by a zero byte", load->prefix,
                           name);
    }
    return true;
}

const char *gust_read_path(const char *folder, const char *path)
{
    if (path[0] == '/' || folder == NULL) {
        return NULL;
    }
    const size_t size = strlen(folder) + strlen(path) + 2;
    char *made = gust_allocate(size, 1);
    if (made != NULL) {
        snprintf(made, size, "%s/%s", folder, path);
    }
    return made;
}
