/* Marks what the shared library exports; everything else is hidden. */
#ifndef GUSTFORM_GUST_EXPORT_H
#define GUSTFORM_GUST_EXPORT_H

#if defined(__GNUC__)
#define GUST_API __attribute__((visibility("default")))
#else
#define GUST_API
#endif

#endif
