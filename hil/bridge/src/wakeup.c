#include "gustform_bridge/wakeup.h"

#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>

bool gust_wakeup_open(gust_wakeup *wakeup, gust_error *error)
{
    sigset_t set;
    (void)sigemptyset(&set);
    (void)sigaddset(&set, SIGTERM);
    (void)sigaddset(&set, SIGINT);
    (void)signal(SIGPIPE, SIG_IGN);
    if (pthread_sigmask(SIG_BLOCK, &set, NULL) != 0) {
        return gust_fail(error, "GF8062: signals cannot be blocked");
    }
    wakeup->signals = signalfd(-1, &set, SFD_CLOEXEC);
    wakeup->word = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (wakeup->signals < 0 || wakeup->word < 0) {
        return gust_fail(error, "GF8062: no descriptor for signals (%s). Look at: ulimit -n", strerror(errno));
    }
    return true;
}
