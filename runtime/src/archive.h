/* A state as bytes: records of numbers, each with name, type and count, one after the other.
 *
 * Saving and loading are one function of whoever owns the state, which names its fields in one order; the
 * archive measures, writes or reads them. That way no field can be saved and not loaded.
 *
 *     header   64 bytes: magic[8], u32 version, u32 0, u64 size of everything, u64 identity (of the model or
 *              the settings the state belongs to), u64 checksum, 24 bytes 0
 *     record   name[24] zero-padded, u32 type (1 f64, 4 i64), u32 0, u64 count, count * 8 bytes
 *
 * Little-endian. The checksum is FNV-1a of all bytes but its own. */
#ifndef GUSTFORM_ARCHIVE_H
#define GUSTFORM_ARCHIVE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { GUST_ARCHIVE_HEADER = 64, GUST_ARCHIVE_NAME = 24 };

typedef enum gust_archive_mode {
    GUST_ARCHIVE_MEASURE, /* count bytes only */
    GUST_ARCHIVE_SAVE,
    GUST_ARCHIVE_LOAD
} gust_archive_mode;

typedef struct gust_archive {
    gust_archive_mode mode;
    uint8_t *bytes; /* belong to the caller; not written to when loading */
    size_t size;
    size_t at;
    bool foreign; /* that record was one of gust_archive_same */
    bool good;    /* false after a record that was not the expected one; the rest is then left alone */
    char wrong[GUST_ARCHIVE_NAME]; /* name of that record */
} gust_archive;

/* Each goes through `count` numbers under `name`, in the direction of the mode. */
void gust_archive_doubles(gust_archive *archive, const char *name, double *data, int64_t count);
void gust_archive_longs(gust_archive *archive, const char *name, int64_t *data, int64_t count);
/* An integer that must be from low to high; anything else is not loaded and ends the archive. */
void gust_archive_index(gust_archive *archive, const char *name, int64_t *number, int64_t low, int64_t high);
void gust_archive_small_index(gust_archive *archive, const char *name, int32_t *number, int32_t low,
                              int32_t high);
void gust_archive_flag(gust_archive *archive, const char *name, bool *flag);

void gust_archive_ints(gust_archive *archive, const char *name, int *data, int64_t count);

/* Numbers that must be the same when loading: if one is not, the state belongs to something else. */
void gust_archive_same(gust_archive *archive, const char *name, double number);
void gust_archive_same_identity(gust_archive *archive, const char *name, uint64_t identity);

/* What loaded numbers must obey; if not, the archive is no longer good. */
void gust_archive_require(gust_archive *archive, const char *name, bool condition);

/* Bytes that the header takes and the records of a measured archive. */
size_t gust_archive_total(const gust_archive *measured);

/* Begins to save into bytes[size]; gust_archive_seal writes the header. */
void gust_archive_begin(gust_archive *archive, uint8_t *bytes, size_t size);
void gust_archive_seal(gust_archive *archive, const char magic[8], uint64_t identity);

typedef enum gust_archive_fault {
    GUST_ARCHIVE_SOUND,
    GUST_ARCHIVE_NOT_ONE, /* another magic */
    GUST_ARCHIVE_VERSION, /* written by another version */
    GUST_ARCHIVE_TORN,    /* shorter or longer than it says */
    GUST_ARCHIVE_DAMAGED, /* the checksum is wrong */
    GUST_ARCHIVE_FOREIGN  /* sound, but of another identity */
} gust_archive_fault;

/* Checks the header of bytes[size] and begins to load. */
gust_archive_fault gust_archive_open(gust_archive *archive, const uint8_t *bytes, size_t size,
                                     const char magic[8], uint64_t identity);

/* FNV-1a, 64 bit, of `size` bytes, going on from `hash`. */
#define GUST_HASH_START UINT64_C(14695981039346656037)
uint64_t gust_hash(uint64_t hash, const void *bytes, size_t size);

#endif
