/* Reads what the runner wrote, and becomes it. Nothing is freed: the guest ends with its command. */
#define _GNU_SOURCE
#include "guest_command.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum {
    EXIT_RUNNER = 125,         /* the command could not be begun: as env(1) and the runner say it */
    EXIT_NOT_EXECUTABLE = 126, /* as the shells say it */
    EXIT_NOT_FOUND = 127
};

static char *read_whole(const char *path, size_t *size)
{
    const int file = open(path, O_RDONLY | O_CLOEXEC);
    struct stat about;
    if (file < 0 || fstat(file, &about) != 0) {
        return NULL;
    }
    *size = (size_t)about.st_size;
    char *const text = malloc(*size + 1);
    size_t done = 0;
    while (text != NULL && done < *size) {
        const ssize_t got = read(file, text + done, *size - done);
        if (got <= 0) {
            free(text);
            (void)close(file);
            *size = 0;
            return NULL;
        }
        done += (size_t)got;
    }
    if (text != NULL) {
        text[*size] = '\0';
    } else {
        *size = 0;
    }
    (void)close(file);
    return text;
}

bool command_read(const char *path, struct command *command)
{
    size_t size = 0;
    char *const text = read_whole(path, &size);
    size_t strings = 0;
    for (size_t i = 0; i < size; i++) {
        strings += text[i] == '\0';
    }
    /* Two strings come before the arguments; two ends are added. */
    char **const pointers = calloc(strings + 2, sizeof *pointers);
    char *next = strings > 2 ? text + strlen(text) + 1 : NULL;
    const size_t arguments = next != NULL ? strtoul(next, NULL, 10) : 0;
    if (pointers == NULL || arguments == 0 || arguments > strings - 2) {
        errno = text == NULL || pointers == NULL ? errno : EINVAL;
        free(pointers);
        free(text);
        return false;
    }
    size_t filled = 0;
    for (size_t i = 0; i < strings - 2; i++) {
        next += strlen(next) + 1;
        filled += i == arguments; /* a NULL between the two lists */
        pointers[filled++] = next;
    }
    *command = (struct command){text, pointers, pointers + arguments + 1};
    return true;
}

void command_become(const struct command *command, int out, int err)
{
    sigset_t none;
    (void)sigemptyset(&none);
    (void)sigprocmask(SIG_SETMASK, &none, NULL);
    (void)setsid();
    (void)close(STDIN_FILENO);
    (void)open("/dev/null", O_RDONLY); /* becomes the lowest free descriptor: stdin */
    (void)dup2(out, STDOUT_FILENO);
    (void)dup2(err, STDERR_FILENO);
    if (chdir(command->directory) != 0) {
        (void)dprintf(STDERR_FILENO, "with-vcan: %s: %s\n", command->directory, strerror(errno));
        _exit(EXIT_RUNNER);
    }
    /* execvpe looks along the PATH of this process, which is to be the command's. */
    environ = command->environment;
    (void)execvp(command->arguments[0], command->arguments);
    const int code = errno == ENOENT ? EXIT_NOT_FOUND : EXIT_NOT_EXECUTABLE;
    (void)dprintf(STDERR_FILENO, "with-vcan: %s: %s\n", command->arguments[0], strerror(errno));
    _exit(code);
}
