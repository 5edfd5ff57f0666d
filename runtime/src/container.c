#include "container.h"

#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "text.h"

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "model files are little-endian and used in place: this machine would have to swap them"
#endif

static const char MAGIC[8] = {'G', 'U', 'S', 'T', 'T', 'A', 'B', '1'};

enum { HEADER = 16, ENTRY = 80, ALIGNMENT = 64, VERSION = 1 };

static uint32_t read_u32(const uint8_t *at)
{
    uint32_t value;
    memcpy(&value, at, sizeof value);
    return value;
}

static uint64_t read_u64(const uint8_t *at)
{
    uint64_t value;
    memcpy(&value, at, sizeof value);
    return value;
}

static uint64_t element_size(uint32_t dtype)
{
    switch (dtype) {
    case GUST_F64:
    case GUST_I64:
        return 8;
    case GUST_I32:
        return 4;
    case GUST_U8:
        return 1;
    default:
        return 0;
    }
}

size_t gust_dtype_size(gust_dtype dtype)
{
    return (size_t)element_size(dtype);
}

static int by_name(const void *left, const void *right)
{
    return strcmp(((const gust_section *)left)->name, ((const gust_section *)right)->name);
}

static bool read_entry(gust_section *section, const uint8_t *bytes, size_t size, uint32_t number, char *message,
                       size_t message_size)
{
    const uint8_t *entry = bytes + HEADER + (size_t)number * ENTRY;
    memcpy(section->name, entry, GUST_SECTION_NAME);
    if (section->name[0] == '\0' || section->name[GUST_SECTION_NAME - 1] != '\0') {
        gust_text(message, message_size, "section %u has no usable name: build the model again", number);
        return false;
    }
    for (const char *c = section->name; *c != '\0'; ++c) {
        if (*c <= ' ' || *c > '~') {
            gust_text(message, message_size, "the name of section %u is not plain text: build the model again",
                      number);
            return false;
        }
    }
    const uint32_t dtype = read_u32(entry + 56);
    const uint32_t reserved = read_u32(entry + 60);
    const uint64_t count = read_u64(entry + 64);
    const uint64_t offset = read_u64(entry + 72);
    const uint64_t width = element_size(dtype);
    if (width == 0 || reserved != 0) {
        gust_text(message, message_size, "section \"%s\" has unknown element type %u: build the model again",
                  section->name, dtype);
        return false;
    }
    if (offset % ALIGNMENT != 0 || offset > size || count > (size - offset) / width) {
        gust_text(
            message, message_size,
            "section \"%s\" (%llu elements at byte %llu) does not fit in the %zu bytes of the file: it is "
            "incomplete or damaged; build the model again",
            section->name, (unsigned long long)count, (unsigned long long)offset, size);
        return false;
    }
    section->dtype = (gust_dtype)dtype;
    section->count = count;
    section->data = bytes + offset;
    return true;
}

bool gust_container_open(gust_container *container, const uint8_t *bytes, size_t size, char *message,
                         size_t message_size)
{
    *container = (gust_container){0};
    if (size < HEADER || memcmp(bytes, MAGIC, sizeof MAGIC) != 0) {
        gust_text(message, message_size, "not a model file: it does not start with GUSTTAB1");
        return false;
    }
    const uint32_t version = read_u32(bytes + 8);
    if (version != VERSION) {
        gust_text(message, message_size,
                  "model file of version %u, this runtime reads version %d: build the model again", version,
                  VERSION);
        return false;
    }
    const uint32_t n_sections = read_u32(bytes + 12);
    if (n_sections > (size - HEADER) / ENTRY) {
        gust_text(message, message_size, "a directory of %u sections does not fit in the %zu bytes of the file",
                  n_sections, size);
        return false;
    }
    gust_section *sections = gust_allocate(n_sections, sizeof *sections);
    if (sections == NULL) {
        gust_text(message, message_size, "out of memory for %u sections", n_sections);
        return false;
    }
    for (uint32_t i = 0; i < n_sections; ++i) {
        if (!read_entry(&sections[i], bytes, size, i, message, message_size)) {
            gust_release(sections);
            return false;
        }
    }
    qsort(sections, n_sections, sizeof *sections, by_name);
    for (uint32_t i = 1; i < n_sections; ++i) {
        if (strcmp(sections[i - 1].name, sections[i].name) == 0) {
            gust_text(message, message_size, "section \"%s\" occurs twice: build the model again",
                      sections[i].name);
            gust_release(sections);
            return false;
        }
    }
    container->sections = sections;
    container->n_sections = n_sections;
    return true;
}

void gust_container_close(gust_container *container)
{
    gust_release(container->sections);
    *container = (gust_container){0};
}

const gust_section *gust_container_find(const gust_container *container, const char *name)
{
    uint32_t low = 0;
    uint32_t high = container->n_sections;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        const int order = strcmp(container->sections[middle].name, name);
        if (order == 0) {
            return &container->sections[middle];
        }
        if (order < 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return NULL;
}
