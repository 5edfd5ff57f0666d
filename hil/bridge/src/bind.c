#include "gustform_bridge/bind.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

bool gust_fail(gust_error *error, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(error->text, sizeof error->text, format, arguments);
    va_end(arguments);
    return false;
}

static bool find(const gust_message_set *set, gust_part part, const char *quantity, gust_place *place)
{
    for (uint32_t piece = 0; piece < GUST_PIECES; ++piece) {
        const gust_message *message = gust_message_find(set, part, (uint8_t)piece);
        if (message == NULL) {
            return false;
        }
        const int signal = gust_message_signal(message, GUST_FIELD_QUANTITY, quantity);
        if (signal >= 0) {
            *place = (gust_place){.part = part, .piece = (uint8_t)piece, .signal = (uint8_t)signal};
            return true;
        }
    }
    return false;
}

bool gust_bind(const gust_message_set *set, const gust_controller_signal *signals, uint32_t n,
               const gust_part *parts, uint32_t n_parts, const char *role, gust_place *places,
               gust_error *error)
{
    if (n > GUST_SIGNALS) {
        return gust_fail(error, "GF8051: %u %ss, at most %d are allowed. Raise GUST_SIGNALS and compile again",
                         n, role, GUST_SIGNALS);
    }
    for (uint32_t k = 0; k < n; ++k) {
        bool found = false;
        for (uint32_t p = 0; p < n_parts && !found; ++p) {
            found = find(set, parts[p], signals[k].name, &places[k]);
        }
        if (!found) {
            return gust_fail(error,
                             "GF8050: no message of the database %s has the %s '%s'. Map a signal to "
                             "this quantity in mapping.yaml",
                             set->name, role, signals[k].name);
        }
    }
    return true;
}

void gust_bind_safe(const gust_message *message, double *values)
{
    for (uint32_t k = 0; k < message->n_signals; ++k) {
        values[k] = message->signals[k].safe;
    }
}

void gust_bind_fill(const gust_message *message, const gust_place *places, uint32_t n, const double *outputs,
                    double *values)
{
    for (uint32_t k = 0; k < n; ++k) {
        if (places[k].part == message->part && places[k].piece == message->piece) {
            values[places[k].signal] = outputs[k];
        }
    }
}
