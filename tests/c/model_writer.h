/* Writes model files for tests: sections are added one by one and become a container in memory. */
#ifndef GUSTFORM_TEST_MODEL_WRITER_H
#define GUSTFORM_TEST_MODEL_WRITER_H

#include <stddef.h>
#include <stdint.h>

#include "gustform/gust_kernel.h"

enum { WRITER_SECTIONS = 256 };

typedef struct writer_section {
    char name[56];
    uint32_t dtype;
    uint64_t count;
    unsigned char *data;
    size_t size;
} writer_section;

typedef struct model_writer {
    writer_section sections[WRITER_SECTIONS];
    uint32_t n_sections;
} model_writer;

/* A section replaces one of the same name. The data are copied. */
void writer_f64(model_writer *writer, const char *name, const double *data, size_t count);
void writer_i32(model_writer *writer, const char *name, const int32_t *data, size_t count);
void writer_u8(model_writer *writer, const char *name, const uint8_t *data, size_t count);

/* `count` strings, each closed by a zero byte. */
void writer_texts(model_writer *writer, const char *name, const char *const *texts, size_t count);
void writer_text(model_writer *writer, const char *name, const char *text);

void writer_remove(model_writer *writer, const char *name);

/* The container; the caller frees the bytes. */
unsigned char *writer_bytes(const model_writer *writer, size_t *size);

/* Frees the sections. */
void writer_clear(model_writer *writer);

#endif
