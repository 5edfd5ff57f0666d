/* Opening the shared library of an exported controller. */
#ifndef GUSTFORM_CONTROLLER_LIBRARY_H
#define GUSTFORM_CONTROLLER_LIBRARY_H

#include <stddef.h>

#include "gustform/gust_controller.h"

/* The controller in the library at `path`, its table checked; *library is to be closed with
 * gust_controller_close once nobody uses it. NULL and a message if there is none, or one of another interface
 * version. */
const gust_controller *gust_controller_open(const char *path, void **library, char *message, size_t size);

void gust_controller_close(void *library);

#endif
