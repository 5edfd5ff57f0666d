/* The command line of gust-bridge. */
#ifndef GUSTFORM_BRIDGE_OPTIONS_H
#define GUSTFORM_BRIDGE_OPTIONS_H

#include <stdbool.h>
#include <stdint.h>

#include "bind.h"
#include "bridge.h"

#define GUST_RATES 32 /* --rate options, at most */

typedef struct gust_options {
    const char *interface;
    bool synchronous;
    bool plant; /* --role plant */
    bool status;
    bool tune;
    bool real_time;
    bool help;
    uint64_t patience; /* ns; synchronous only */
    uint64_t watchdog; /* ns; 0: as the clock says */
    gust_limits limits;
    gust_rate rates[GUST_RATES];
    uint32_t n_rates;
    const char *model; /* of the plant */
} gust_options;

extern const char gust_usage[];

/* Texts stay those of `arguments`, which --rate cuts at the '='. false: usage error. */
bool gust_options_read(gust_options *options, int n, char **arguments, gust_error *error);

#endif
