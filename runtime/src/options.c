#include "options.h"

#include <stddef.h>
#include <string.h>

static const gust_option_info OPTIONS[] = {
#define OPTION_ROW(name, initial, minimum, maximum, sentence) {#name, sentence, initial, minimum, maximum},
    GUST_OPTION_LIST(OPTION_ROW)
#undef OPTION_ROW
};

static const size_t OFFSETS[] = {
#define OPTION_OFFSET(name, initial, minimum, maximum, sentence) offsetof(gust_options, name),
    GUST_OPTION_LIST(OPTION_OFFSET)
#undef OPTION_OFFSET
};

enum { N_OPTIONS = sizeof OPTIONS / sizeof OPTIONS[0] };

static double *value_of(gust_options *options, int index)
{
    return (double *)(void *)((char *)options + OFFSETS[index]);
}

const gust_option_info *gust_option_list(int index)
{
    return index >= 0 && index < N_OPTIONS ? &OPTIONS[index] : NULL;
}

void gust_options_reset(gust_options *options)
{
    for (int i = 0; i < N_OPTIONS; ++i) {
        *value_of(options, i) = OPTIONS[i].initial;
    }
}

double *gust_options_find(gust_options *options, const char *name, const gust_option_info **info)
{
    for (int i = 0; i < N_OPTIONS; ++i) {
        if (strcmp(OPTIONS[i].name, name) == 0) {
            if (info != NULL) {
                *info = &OPTIONS[i];
            }
            return value_of(options, i);
        }
    }
    return NULL;
}
