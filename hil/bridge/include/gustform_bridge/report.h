/* What the bridge says of itself: one JSON object a line. */
#ifndef GUSTFORM_BRIDGE_REPORT_H
#define GUSTFORM_BRIDGE_REPORT_H

#include <stddef.h>
#include <stdio.h>

#include "loop.h"

#define GUST_REPORT 2048 /* bytes of a line, at most */

const char *gust_state_name(gust_state state);

/* {"event": "state", "state": "SAFE", "faults": ["TIMEOUT"], "sample": 1234, "time_ns": 5678} */
void gust_report_event(FILE *file, const gust_event *event);

/* Counters, times and quantiles; `event` is "status" or "end". */
void gust_report_statistics(FILE *file, const char *event, const gust_loop *loop);

#endif
