/* The sampled blocks of a model file, with the libraries of their controllers. */
#ifndef GUSTFORM_LOADER_SAMPLED_H
#define GUSTFORM_LOADER_SAMPLED_H

#include "reader.h"

enum { GUST_TEXT_TABLES_OF_SAMPLED = 5 };

/* How many there are, before anything is allocated; a model without the section has none. */
bool gust_read_sampled_counts(gust_reader *load);

/* All of them, after types and their kernels. */
bool gust_read_sampled(gust_reader *load);

#endif
