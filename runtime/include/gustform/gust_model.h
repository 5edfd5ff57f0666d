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

/* A sampled block: the controller of one instance, outside of the equations. At each sample, start + k period,
 * it gets the measurements and gives the commands, which are held until they change again. `real_size` is that
 * of its number type: measurements and commands are rounded to it (4: float, 8: double). With a `delay` of 1
 * sample the commands of sample k act from sample k + 1 on. Texts and arrays belong to the model. */
typedef struct gust_sampled_info {
    const char *name; /* of the instance: "wt[3]" */
    double period;    /* s */
    int32_t delay;    /* samples, 0 or 1 */
    int32_t real_size;
    int32_t n_measurements;
    int32_t n_commands;
    const char *const *measurement_name; /* [n_measurements] */
    const char *const *measurement_unit;
    const char *const *command_name; /* [n_commands] */
    const char *const *command_unit;
    const double *command_start; /* [n_commands] held before the first sample */
} gust_sampled_info;

GUST_API int32_t gust_model_n_sampled(const gust_model *model);
/* Block number `block`, NULL past the end. */
GUST_API const gust_sampled_info *gust_model_sampled_block(const gust_model *model, int32_t block);

/* Name of an unknown ("turbine.rotor.w") and of the equation in a row, for messages; cut to size. */
GUST_API void gust_model_unknown_name(const gust_model *model, int32_t unknown, char *text, size_t size);
GUST_API void gust_model_equation_name(const gust_model *model, int32_t row, char *text, size_t size);

#ifdef __cplusplus
}
#endif

#endif
