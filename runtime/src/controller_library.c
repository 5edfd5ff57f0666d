#define _POSIX_C_SOURCE 200809L

#include "controller_library.h"

#include <dlfcn.h>
#include <stdbool.h>
#include <string.h>

#include "text.h"

enum { LARGEST_CONTEXT = 1000000, MOST_SIGNALS = 1024 };

/* Every signal has a name and lies within the context. */
static bool signals_fit(const gust_controller *controller, const gust_controller_signal *signals,
                        uint32_t count)
{
    if (count > MOST_SIGNALS || (count > 0 && signals == NULL)) {
        return false;
    }
    for (uint32_t k = 0; k < count; ++k) {
        if (signals[k].name == NULL || controller->context_size < controller->real_size ||
            signals[k].offset > controller->context_size - controller->real_size) {
            return false;
        }
    }
    return true;
}

static bool complete(const gust_controller *controller)
{
    const bool numbers = (controller->real_size == 4 || controller->real_size == 8) &&
                         controller->context_size >= 4 && controller->context_size <= LARGEST_CONTEXT &&
                         controller->faulty_inputs <= controller->context_size - 4;
    const bool calls = controller->startup != NULL && controller->step != NULL &&
                       controller->recalibrate != NULL && controller->reinitialise != NULL;
    return numbers && calls && controller->name != NULL && controller->control != NULL &&
           controller->period > 0.0 && signals_fit(controller, controller->inputs, controller->n_inputs) &&
           signals_fit(controller, controller->outputs, controller->n_outputs) &&
           signals_fit(controller, controller->parameters, controller->n_parameters) &&
           signals_fit(controller, controller->monitors, controller->n_monitors);
}

const gust_controller *gust_controller_open(const char *path, void **library, char *message, size_t size)
{
    *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (*library == NULL) {
        const char *reason = dlerror();
        gust_text(message, size, "controller library \"%s\" cannot be loaded (%s): build the model again", path,
                  reason != NULL ? reason : "no reason given");
        return NULL;
    }
    const gust_controller *(*get)(void) = NULL;
    void *symbol = dlsym(*library, "gust_controller_interface");
    /* ISO C has no cast from void * to a function pointer; POSIX demands that the bits are the same. */
    memcpy(&get, &symbol, sizeof get);
    const gust_controller *controller = get != NULL ? get() : NULL;
    if (controller == NULL) {
        gust_text(message, size, "\"%s\" is no controller library: it has no gust_controller_interface", path);
    } else if (controller->version != GUST_CONTROLLER_VERSION) {
        gust_text(
            message, size,
            "controller library \"%s\" has interface version %u, this runtime knows %d: empty the cache and "
            "build the model again",
            path, controller->version, GUST_CONTROLLER_VERSION);
        controller = NULL;
    } else if (!complete(controller)) {
        gust_text(message, size, "the controller in \"%s\" is incomplete: build the model again", path);
        controller = NULL;
    }
    if (controller == NULL) {
        gust_controller_close(*library);
        *library = NULL;
    }
    return controller;
}

void gust_controller_close(void *library)
{
    if (library != NULL) {
        dlclose(library);
    }
}
