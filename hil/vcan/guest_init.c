/* The first process of a guest: it makes the CAN interfaces, runs one command and switches the guest off.
 *
 * The runner describes the work on the kernel's command line, which arrives here as environment:
 *
 *   VCAN_INTERFACES=vcan0,vcan1   interfaces to make; each carries CAN FD frames
 *   VCAN_MODULES=FILE             kernel modules to load, one path a line, in this order
 *   VCAN_COMMAND=FILE             what to run, as guest_command.h has it
 *   VCAN_STDOUT, VCAN_STDERR      terminal lines that lead to the runner's streams
 *   VCAN_CONTROL                  terminal line between the runner and this program: "ready" and "exit N" go
 *                                 out, a line each; one byte with the number of a signal comes in
 *
 * The same program serves user-mode Linux, where the root is the host's, and an initramfs. Whatever goes wrong
 * is written to the console, which is the runner's log, and ends the guest without an "exit" line. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/signalfd.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include "guest_command.h"
#include "vcan_link.h"

enum {
    STREAMS = 2, /* stdout and stderr */
    EXIT_SIGNAL = 128,
    QUIET_MS = 100 /* how long output of what the command left behind is waited for */
};

/* One stream of the command: the pipe it writes to and the line that leads out. */
struct stream {
    int from;
    int to;
};

/* Where the command's life is followed. */
struct session {
    pid_t child;
    bool ended;
    int status;
    int children; /* signalfd for SIGCHLD */
    int control;
    struct stream streams[STREAMS];
};

static _Noreturn void switch_off(void)
{
    sync();
    (void)reboot(RB_POWER_OFF);
    for (;;) {
        (void)pause();
    }
}

static _Noreturn void fail(const char *what)
{
    (void)dprintf(STDERR_FILENO, "guest: %s: %s\n", what, strerror(errno));
    switch_off();
}

static const char *setting(const char *name)
{
    const char *value = getenv(name);
    if (value == NULL || *value == '\0') {
        errno = EINVAL;
        fail(name);
    }
    return value;
}

/* ---- The file systems a program expects ---- */

static void mount_one(const char *type, const char *place, const char *options)
{
    (void)mkdir(place, 0755);
    if (mount(type, place, type, 0, options) != 0 && errno != EBUSY) {
        fail(place);
    }
}

static void mount_all(void)
{
    mount_one("devtmpfs", "/dev", "");
    mount_one("proc", "/proc", "");
    mount_one("sysfs", "/sys", "");
    mount_one("devpts", "/dev/pts", "ptmxmode=0666");
    mount_one("tmpfs", "/dev/shm", "mode=1777");
    mount_one("tmpfs", "/run", "mode=0755");
    static const char *const links[][2] = {{"/proc/self/fd", "/dev/fd"},
                                           {"/proc/self/fd/0", "/dev/stdin"},
                                           {"/proc/self/fd/1", "/dev/stdout"},
                                           {"/proc/self/fd/2", "/dev/stderr"}};
    for (size_t i = 0; i < sizeof links / sizeof *links; i++) {
        (void)symlink(links[i][0], links[i][1]);
    }
}

/* Messages of this program belong to the kernel's log. */
static void open_console(void)
{
    const int console = open("/dev/console", O_RDWR | O_NOCTTY);
    if (console >= 0) {
        for (int i = 0; i <= STDERR_FILENO; i++) {
            (void)dup2(console, i);
        }
        if (console > STDERR_FILENO) {
            (void)close(console);
        }
    }
}

static void load_modules(const char *list)
{
    FILE *const file = fopen(list, "re");
    if (file == NULL) {
        fail(list);
    }
    char path[4096];
    while (fgets(path, sizeof path, file) != NULL) {
        char *const end = strchr(path, '\n');
        if (end != NULL) {
            *end = '\0';
        }
        const int module = open(path, O_RDONLY | O_CLOEXEC);
        if (module < 0 || (syscall(SYS_finit_module, module, "", 0) != 0 && errno != EEXIST)) {
            fail(path);
        }
        (void)close(module);
    }
    (void)fclose(file);
}

static void make_interfaces(char *names)
{
    if (link_up("lo") != 0) {
        fail("lo");
    }
    char *rest = NULL;
    for (const char *name = strtok_r(names, ",", &rest); name != NULL; name = strtok_r(NULL, ",", &rest)) {
        if (link_add_vcan(name) != 0 || link_up(name) != 0) {
            fail(name);
        }
    }
}

/* ---- The command ---- */

/* A line that passes every byte as it is. */
static int open_line(const char *path)
{
    const int line = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC);
    struct termios mode;
    if (line < 0 || tcgetattr(line, &mode) != 0) {
        fail(path);
    }
    cfmakeraw(&mode);
    if (tcsetattr(line, TCSANOW, &mode) != 0) {
        fail(path);
    }
    return line;
}

static struct session start(const struct command *command)
{
    struct session session = {.control = open_line(setting("VCAN_CONTROL"))};
    session.streams[0].to = open_line(setting("VCAN_STDOUT"));
    session.streams[1].to = open_line(setting("VCAN_STDERR"));
    int writers[STREAMS];
    for (int i = 0; i < STREAMS; i++) {
        int ends[2];
        if (pipe2(ends, O_CLOEXEC) != 0) {
            fail("pipe");
        }
        session.streams[i].from = ends[0];
        writers[i] = ends[1];
    }
    sigset_t child;
    (void)sigemptyset(&child);
    (void)sigaddset(&child, SIGCHLD);
    (void)sigprocmask(SIG_BLOCK, &child, NULL);
    session.children = signalfd(-1, &child, SFD_CLOEXEC | SFD_NONBLOCK);
    session.child = fork();
    if (session.child == 0) {
        command_become(command, writers[0], writers[1]);
    }
    if (session.child < 0 || session.children < 0) {
        fail("fork");
    }
    for (int i = 0; i < STREAMS; i++) {
        (void)close(writers[i]);
    }
    (void)dprintf(session.control, "ready\n");
    return session;
}

/* ---- Following it to its end ---- */

static void reap(struct session *session)
{
    struct signalfd_siginfo ignored;
    while (read(session->children, &ignored, sizeof ignored) > 0) {
    }
    int status = 0;
    for (pid_t ended = waitpid(-1, &status, WNOHANG); ended > 0; ended = waitpid(-1, &status, WNOHANG)) {
        if (ended == session->child) {
            session->ended = true;
            session->status = status;
        }
    }
}

/* What a terminal sends goes to the whole group, as a terminal would; anything else to the command alone. */
static void pass_signals(struct session *session)
{
    unsigned char numbers[16];
    const ssize_t count = read(session->control, numbers, sizeof numbers);
    if (count <= 0) {
        fail("the runner has gone");
    }
    for (ssize_t i = 0; i < count && !session->ended; i++) {
        const bool terminal = numbers[i] == SIGINT || numbers[i] == SIGQUIT;
        (void)kill(terminal ? -session->child : session->child, numbers[i]);
    }
}

static void copy(struct stream *stream)
{
    static char buffer[65536];
    const ssize_t count = read(stream->from, buffer, sizeof buffer);
    if (count <= 0) {
        stream->from = -1;
    }
    for (ssize_t done = 0; done < count;) {
        const ssize_t written = write(stream->to, buffer + done, (size_t)(count - done));
        if (written < 0 && errno != EINTR && errno != EAGAIN) {
            fail("output");
        }
        done += written > 0 ? written : 0;
    }
}

/* Until the command has ended and its streams are at their end, or quiet where something left behind holds
 * them. */
static void follow(struct session *session)
{
    while (!session->ended || session->streams[0].from >= 0 || session->streams[1].from >= 0) {
        struct pollfd watched[] = {{.fd = session->children, .events = POLLIN},
                                   {.fd = session->control, .events = POLLIN},
                                   {.fd = session->streams[0].from, .events = POLLIN},
                                   {.fd = session->streams[1].from, .events = POLLIN}};
        const int count = poll(watched, sizeof watched / sizeof *watched, session->ended ? QUIET_MS : -1);
        if (count == 0) {
            return;
        }
        if (watched[0].revents != 0) {
            reap(session);
        }
        if (watched[1].revents != 0) {
            pass_signals(session);
        }
        for (int i = 0; i < STREAMS; i++) {
            if (watched[2 + i].revents != 0) {
                copy(&session->streams[i]);
            }
        }
    }
}

int main(void)
{
    mount_all();
    open_console();
    load_modules(setting("VCAN_MODULES"));
    char *const interfaces = strdup(setting("VCAN_INTERFACES"));
    if (interfaces == NULL) {
        fail("VCAN_INTERFACES");
    }
    make_interfaces(interfaces);
    free(interfaces);
    struct command command;
    if (!command_read(setting("VCAN_COMMAND"), &command)) {
        fail("VCAN_COMMAND");
    }
    struct session session = start(&command);
    follow(&session);
    for (int i = 0; i < STREAMS; i++) {
        (void)tcdrain(session.streams[i].to);
    }
    const int code =
        WIFEXITED(session.status) ? WEXITSTATUS(session.status) : EXIT_SIGNAL + WTERMSIG(session.status);
    (void)dprintf(session.control, "exit %d\n", code);
    (void)tcdrain(session.control);
    switch_off();
}
