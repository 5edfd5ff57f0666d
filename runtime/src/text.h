/* Short texts in fixed buffers, for messages. */
#ifndef GUSTFORM_TEXT_H
#define GUSTFORM_TEXT_H

#include <stddef.h>

/* Writes a formatted text into buffer[size], cut if it does not fit; nothing if buffer is NULL or size 0. */
__attribute__((format(printf, 3, 4))) void gust_text(char *buffer, size_t size, const char *format, ...);

/* The same, behind the text that is there already. */
__attribute__((format(printf, 3, 4))) void gust_text_append(char *buffer, size_t size, const char *format, ...);

#endif
