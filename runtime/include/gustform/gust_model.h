/* A linked model: the SystemTable read from its container, checked, with its kernels loaded.
 *
 * A model never changes after it is loaded; several simulations may share one, also in several threads.
 * Container format: see runtime/README.md.
 */
#ifndef GUSTFORM_GUST_MODEL_H
#define GUSTFORM_GUST_MODEL_H

#include <stddef.h>
#include <stdint.h>

#include "gust_export.h"
#include "gust_status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct gust_model gust_model;

/* Reads and checks the model file at `path`, loads its kernel libraries (relative paths start at the
 * folder of the file). On success *model is the caller's, to be given back by gust_model_destroy, after
 * the last simulation on it. On an error *model is NULL and message[size] tells what and where. */
GUST_API gust_status gust_model_load(const char *path, gust_model **model, char *message, size_t size);

/* The same from bytes in memory, which are copied; relative kernel paths start at the working folder. */
GUST_API gust_status gust_model_parse(const void *bytes, size_t n_bytes, gust_model **model, char *message,
                                      size_t size);

/* Frees the model and sets *model to NULL. Does nothing if it is NULL already. */
GUST_API void gust_model_destroy(gust_model **model);

GUST_API int32_t gust_model_n_unknowns(const gust_model *model);
GUST_API int32_t gust_model_n_nonzeros(const gust_model *model);
GUST_API int32_t gust_model_n_channels(const gust_model *model);
GUST_API int32_t gust_model_n_series(const gust_model *model);
/* Instances of all types together. */
GUST_API int32_t gust_model_n_instances(const gust_model *model);

/* Texts belong to the model. A number out of range gives "". */
GUST_API const char *gust_model_channel_name(const gust_model *model, int32_t channel);
GUST_API const char *gust_model_channel_unit(const gust_model *model, int32_t channel);
GUST_API const char *gust_model_series_name(const gust_model *model, int32_t series);
GUST_API const char *gust_model_metadata(const gust_model *model);

/* Name of an unknown ("turbine.rotor.w") and of the equation in a row, for messages; cut to size. */
GUST_API void gust_model_unknown_name(const gust_model *model, int32_t unknown, char *text, size_t size);
GUST_API void gust_model_equation_name(const gust_model *model, int32_t row, char *text, size_t size);

#ifdef __cplusplus
}
#endif

#endif
