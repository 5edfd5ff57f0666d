/* The command of a guest: a file of strings with a NUL after each, which are the working directory, the number
 * of arguments, the arguments, then the environment. */
#ifndef GUSTFORM_GUEST_COMMAND_H
#define GUSTFORM_GUEST_COMMAND_H

#include <stdbool.h>

/* What is run: pointers into one buffer that lives as long as the guest. */
struct command {
    const char *directory;
    char **arguments;   /* ends with NULL */
    char **environment; /* ends with NULL */
};

/* Reads the file at `path`. false, with errno set, if it cannot be read or is no such file. */
bool command_read(const char *path, struct command *command);

/* Turns this process into the command, with /dev/null as stdin and `out` and `err` as its streams. If that
 * cannot be, says why on `err` and ends with 125 (no such directory), 126 (not executable) or 127 (not found).
 */
_Noreturn void command_become(const struct command *command, int out, int err);

#endif
