#define _POSIX_C_SOURCE 200809L

#include "text.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void gust_text(char *buffer, size_t size, const char *format, ...)
{
    if (buffer == NULL || size == 0) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(buffer, size, format, arguments);
    va_end(arguments);
}

void gust_text_append(char *buffer, size_t size, const char *format, ...)
{
    if (buffer == NULL || size == 0) {
        return;
    }
    const size_t used = strnlen(buffer, size);
    if (used >= size) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(buffer + used, size - used, format, arguments);
    va_end(arguments);
}
