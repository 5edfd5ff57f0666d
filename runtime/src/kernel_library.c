#define _POSIX_C_SOURCE 200809L

#include "kernel_library.h"

#include <dlfcn.h>
#include <stdbool.h>
#include <string.h>

#include "text.h"

static bool complete(const gust_kernel *kernel)
{
    const bool counts = kernel->n_unknowns >= 0 && kernel->n_external >= 0 && kernel->n_inputs >= 0 &&
                        kernel->n_parameters >= 0 && kernel->n_constants >= 0 && kernel->n_discrete >= 0 &&
                        kernel->n_tables >= 0 && kernel->n_flows >= 0 && kernel->n_nonzeros >= 0 &&
                        kernel->n_outputs >= 0 && kernel->n_roots >= 0 && kernel->n_whens >= 0;
    const bool pattern =
        kernel->n_nonzeros == 0 || (kernel->jacobian_row != NULL && kernel->jacobian_column != NULL);
    return counts && pattern && kernel->type_name != NULL && kernel->prepare != NULL &&
           kernel->residual != NULL && kernel->jacobian != NULL &&
           (kernel->n_outputs == 0 || kernel->outputs != NULL) &&
           (kernel->n_roots == 0 || kernel->roots != NULL) && (kernel->n_whens == 0 || kernel->when != NULL);
}

const gust_kernel *gust_kernel_open(const char *path, void **library, char *message, size_t size)
{
    *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (*library == NULL) {
        const char *reason = dlerror();
        gust_text(message, size, "kernel library \"%s\" cannot be loaded (%s): build the model again", path,
                  reason != NULL ? reason : "no reason given");
        return NULL;
    }
    gust_kernel_getter get = NULL;
    void *symbol = dlsym(*library, "gust_kernel_get");
    /* ISO C has no cast from void * to a function pointer; POSIX demands that the bits are the same. */
    memcpy(&get, &symbol, sizeof get);
    const gust_kernel *kernel = get != NULL ? get() : NULL;
    if (kernel == NULL) {
        gust_text(message, size, "\"%s\" is no kernel library: it has no gust_kernel_get", path);
    } else if (kernel->abi != GUST_KERNEL_ABI) {
        gust_text(message, size,
                  "kernel library \"%s\" was made for kernel interface %u, this runtime has %d: empty the "
                  "kernel cache and build the model again",
                  path, kernel->abi, GUST_KERNEL_ABI);
        kernel = NULL;
    } else if (!complete(kernel)) {
        gust_text(message, size, "the kernel in \"%s\" is incomplete: build the model again", path);
        kernel = NULL;
    }
    if (kernel == NULL) {
        gust_kernel_close(*library);
        *library = NULL;
    }
    return kernel;
}

void gust_kernel_close(void *library)
{
    if (library != NULL) {
        dlclose(library);
    }
}
