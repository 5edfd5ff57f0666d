#include "model_writer.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { HEADER = 16, ENTRY = 80, ALIGNMENT = 64 };

static void add(model_writer *writer, const char *name, uint32_t dtype, const void *data, size_t count,
                size_t width)
{
    writer_remove(writer, name);
    assert(writer->n_sections < WRITER_SECTIONS);
    writer_section *section = &writer->sections[writer->n_sections++];
    memset(section, 0, sizeof *section);
    snprintf(section->name, sizeof section->name, "%s", name);
    section->dtype = dtype;
    section->count = count;
    section->size = count * width;
    section->data = malloc(section->size + 1);
    assert(section->data != NULL);
    if (section->size > 0) {
        memcpy(section->data, data, section->size);
    }
}

void writer_f64(model_writer *writer, const char *name, const double *data, size_t count)
{
    add(writer, name, 1, data, count, sizeof *data);
}

void writer_i32(model_writer *writer, const char *name, const int32_t *data, size_t count)
{
    add(writer, name, 2, data, count, sizeof *data);
}

void writer_u8(model_writer *writer, const char *name, const uint8_t *data, size_t count)
{
    add(writer, name, 3, data, count, sizeof *data);
}

void writer_texts(model_writer *writer, const char *name, const char *const *texts, size_t count)
{
    char joined[8192];
    size_t used = 0;
    for (size_t k = 0; k < count; ++k) {
        const size_t length = strlen(texts[k]) + 1;
        assert(used + length <= sizeof joined);
        memcpy(joined + used, texts[k], length);
        used += length;
    }
    add(writer, name, 3, joined, used, 1);
}

void writer_text(model_writer *writer, const char *name, const char *text)
{
    writer_texts(writer, name, &text, 1);
}

void writer_remove(model_writer *writer, const char *name)
{
    for (uint32_t k = 0; k < writer->n_sections; ++k) {
        if (strcmp(writer->sections[k].name, name) == 0) {
            free(writer->sections[k].data);
            writer->sections[k] = writer->sections[--writer->n_sections];
            return;
        }
    }
}

unsigned char *writer_bytes(const model_writer *writer, size_t *size)
{
    size_t offset = (HEADER + writer->n_sections * (size_t)ENTRY + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    size_t total = offset;
    for (uint32_t k = 0; k < writer->n_sections; ++k) {
        total += (writer->sections[k].size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    }
    unsigned char *bytes = calloc(1, total);
    assert(bytes != NULL);
    const uint32_t version = 1;
    memcpy(bytes, "GUSTTAB1", 8);
    memcpy(bytes + 8, &version, 4);
    memcpy(bytes + 12, &writer->n_sections, 4);
    for (uint32_t k = 0; k < writer->n_sections; ++k) {
        const writer_section *section = &writer->sections[k];
        unsigned char *entry = bytes + HEADER + k * (size_t)ENTRY;
        const uint64_t at = offset;
        memcpy(entry, section->name, sizeof section->name);
        memcpy(entry + 56, &section->dtype, 4);
        memcpy(entry + 64, &section->count, 8);
        memcpy(entry + 72, &at, 8);
        if (section->size > 0) {
            memcpy(bytes + offset, section->data, section->size);
        }
        offset += (section->size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    }
    *size = total;
    return bytes;
}

void writer_clear(model_writer *writer)
{
    for (uint32_t k = 0; k < writer->n_sections; ++k) {
        free(writer->sections[k].data);
    }
    writer->n_sections = 0;
}
