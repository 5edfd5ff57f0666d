/* From numbers to names: which equations and unknowns a failure is about. */
#ifndef GUSTFORM_DIAGNOSE_H
#define GUSTFORM_DIAGNOSE_H

#include <stddef.h>
#include <stdint.h>

#include "model.h"

/* Appends the rows with the largest |residual|, each relative to the largest term its equation can have for
 * nominal values (from the Jacobian `values`), with name and value. */
void gust_diagnose_rows(const gust_model *model, const double *residual, const double *values, char *message,
                        size_t size);

/* Appends the unknowns with the largest |weighted|, with name, value, and `what` about the number. */
void gust_diagnose_unknowns(const gust_model *model, const double *weighted, const double *value,
                            const char *what, char *message, size_t size);

/* Appends which unknowns the singular matrix `values` cannot tell apart and which equations depend on each
 * other; `column` is what KLU found, -1 if nothing. Allocates: for failures at the start only. */
void gust_diagnose_singular(const gust_model *model, const double *values, int32_t column, char *message,
                            size_t size);

#endif
