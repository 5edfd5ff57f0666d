#include "archive.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

enum { VERSION = 1, TYPE_F64 = 1, TYPE_I64 = 4, RECORD = 40, CHECKSUM_AT = 32 };

uint64_t gust_hash(uint64_t hash, const void *bytes, size_t size)
{
    const uint8_t *byte = bytes;
    for (size_t k = 0; k < size; ++k) {
        hash = (hash ^ byte[k]) * UINT64_C(1099511628211);
    }
    return hash;
}

static uint64_t checksum(const uint8_t *bytes, size_t size)
{
    const uint64_t hash = gust_hash(GUST_HASH_START, bytes, CHECKSUM_AT);
    return gust_hash(hash, bytes + CHECKSUM_AT + sizeof hash, size - CHECKSUM_AT - sizeof hash);
}

static void go_bad(gust_archive *archive, const char *name)
{
    if (archive->good) {
        archive->good = false;
        snprintf(archive->wrong, sizeof archive->wrong, "%s", name);
    }
}

/* Head of a record written or compared; where its numbers are, NULL if there is nothing to copy. */
static uint8_t *record(gust_archive *archive, const char *name, uint32_t type, int64_t count)
{
    const size_t bytes = (size_t)count * 8;
    uint8_t head[RECORD] = {0};
    const uint64_t number = (uint64_t)count;
    snprintf((char *)head, GUST_ARCHIVE_NAME, "%s", name);
    memcpy(head + GUST_ARCHIVE_NAME, &type, sizeof type);
    memcpy(head + GUST_ARCHIVE_NAME + 8, &number, sizeof number);
    if (archive->mode == GUST_ARCHIVE_MEASURE) {
        archive->at += RECORD + bytes;
        return NULL;
    }
    if (!archive->good) {
        return NULL;
    }
    if (archive->size - archive->at < RECORD || archive->size - archive->at - RECORD < bytes) {
        go_bad(archive, name);
        return NULL;
    }
    uint8_t *at = archive->bytes + archive->at;
    if (archive->mode == GUST_ARCHIVE_SAVE) {
        memcpy(at, head, RECORD);
    } else if (memcmp(at, head, RECORD) != 0) {
        go_bad(archive, name);
        return NULL;
    }
    archive->at += RECORD + bytes;
    return at + RECORD;
}

static void copy(gust_archive *archive, uint8_t *at, void *data, size_t bytes)
{
    if (at == NULL || bytes == 0) {
        return;
    }
    if (archive->mode == GUST_ARCHIVE_SAVE) {
        memcpy(at, data, bytes);
    } else {
        memcpy(data, at, bytes);
    }
}

void gust_archive_doubles(gust_archive *archive, const char *name, double *data, int64_t count)
{
    copy(archive, record(archive, name, TYPE_F64, count), data, (size_t)count * sizeof *data);
}

void gust_archive_longs(gust_archive *archive, const char *name, int64_t *data, int64_t count)
{
    copy(archive, record(archive, name, TYPE_I64, count), data, (size_t)count * sizeof *data);
}

void gust_archive_index(gust_archive *archive, const char *name, int64_t *number, int64_t low, int64_t high)
{
    int64_t found = *number;
    gust_archive_longs(archive, name, &found, 1);
    if (archive->mode == GUST_ARCHIVE_LOAD && archive->good) {
        gust_archive_require(archive, name, found >= low && found <= high);
        *number = archive->good ? found : *number;
    }
}

void gust_archive_small_index(gust_archive *archive, const char *name, int32_t *number, int32_t low,
                              int32_t high)
{
    int64_t found = *number;
    gust_archive_index(archive, name, &found, low, high);
    *number = (int32_t)found;
}

void gust_archive_flag(gust_archive *archive, const char *name, bool *flag)
{
    int64_t number = *flag ? 1 : 0;
    gust_archive_index(archive, name, &number, 0, 1);
    *flag = number != 0;
}

void gust_archive_ints(gust_archive *archive, const char *name, int *data, int64_t count)
{
    uint8_t *at = record(archive, name, TYPE_I64, count);
    for (int64_t k = 0; at != NULL && k < count; ++k) {
        int64_t number = data[k];
        copy(archive, at + 8 * k, &number, sizeof number);
        gust_archive_require(archive, name, number >= INT_MIN && number <= INT_MAX);
        data[k] = archive->good ? (int)number : data[k];
    }
}

static void go_foreign(gust_archive *archive, const char *name)
{
    archive->foreign = archive->foreign || archive->good;
    go_bad(archive, name);
}

void gust_archive_same(gust_archive *archive, const char *name, double number)
{
    double found = number;
    gust_archive_doubles(archive, name, &found, 1);
    if (archive->good && found != number) {
        go_foreign(archive, name);
    }
}

void gust_archive_same_identity(gust_archive *archive, const char *name, uint64_t identity)
{
    int64_t own = 0;
    memcpy(&own, &identity, sizeof own);
    int64_t found = own;
    gust_archive_longs(archive, name, &found, 1);
    if (archive->good && found != own) {
        go_foreign(archive, name);
    }
}

void gust_archive_require(gust_archive *archive, const char *name, bool condition)
{
    if (!condition) {
        go_bad(archive, name);
    }
}

size_t gust_archive_total(const gust_archive *measured)
{
    return GUST_ARCHIVE_HEADER + measured->at;
}

void gust_archive_begin(gust_archive *archive, uint8_t *bytes, size_t size)
{
    *archive = (gust_archive){
        .mode = GUST_ARCHIVE_SAVE, .bytes = bytes, .size = size, .at = GUST_ARCHIVE_HEADER, .good = true};
    memset(bytes, 0, GUST_ARCHIVE_HEADER);
}

void gust_archive_seal(gust_archive *archive, const char magic[8], uint64_t identity)
{
    const uint32_t version = VERSION;
    const uint64_t size = archive->at;
    memcpy(archive->bytes, magic, 8);
    memcpy(archive->bytes + 8, &version, sizeof version);
    memcpy(archive->bytes + 16, &size, sizeof size);
    memcpy(archive->bytes + 24, &identity, sizeof identity);
    const uint64_t sum = checksum(archive->bytes, archive->at);
    memcpy(archive->bytes + CHECKSUM_AT, &sum, sizeof sum);
}

gust_archive_fault gust_archive_open(gust_archive *archive, const uint8_t *bytes, size_t size,
                                     const char magic[8], uint64_t identity)
{
    *archive = (gust_archive){.mode = GUST_ARCHIVE_LOAD, .size = size, .at = GUST_ARCHIVE_HEADER, .good = true};
    /* Not const in the struct, since saving shares it; loading does not write to it. */
    memcpy(&archive->bytes, &bytes, sizeof bytes);
    if (size < 8 || memcmp(bytes, magic, 8) != 0) {
        return GUST_ARCHIVE_NOT_ONE;
    }
    uint32_t version = 0;
    uint64_t said = 0;
    uint64_t whose = 0;
    uint64_t sum = 0;
    if (size < GUST_ARCHIVE_HEADER) {
        return GUST_ARCHIVE_TORN;
    }
    memcpy(&version, bytes + 8, sizeof version);
    memcpy(&said, bytes + 16, sizeof said);
    memcpy(&whose, bytes + 24, sizeof whose);
    memcpy(&sum, bytes + CHECKSUM_AT, sizeof sum);
    if (version != VERSION) {
        return GUST_ARCHIVE_VERSION;
    }
    if (said != size) {
        return GUST_ARCHIVE_TORN;
    }
    if (sum != checksum(bytes, size)) {
        return GUST_ARCHIVE_DAMAGED;
    }
    return whose == identity ? GUST_ARCHIVE_SOUND : GUST_ARCHIVE_FOREIGN;
}
