/* What a thread that prints and waits is woken by: SIGTERM and SIGINT, and word of another thread. */
#ifndef GUSTFORM_BRIDGE_WAKEUP_H
#define GUSTFORM_BRIDGE_WAKEUP_H

#include <stdbool.h>

#include "bind.h"

typedef struct gust_wakeup {
    int signals; /* readable: the program is to end */
    int word;    /* an eventfd, not blocking: whoever has something to tell writes to it */
} gust_wakeup;

/* Blocks the two signals in this thread and in all that it starts, so it comes before them. The descriptors
 * stay open as long as the program runs. */
bool gust_wakeup_open(gust_wakeup *wakeup, gust_error *error);

#endif
