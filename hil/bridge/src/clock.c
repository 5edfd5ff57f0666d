#include "gustform_bridge/clock.h"

#include <errno.h>
#include <sched.h>
#include <time.h>

#define NS_PER_S UINT64_C(1000000000)

uint64_t gust_clock_now(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * NS_PER_S + (uint64_t)now.tv_nsec;
}

void gust_clock_sleep(uint64_t time)
{
    const struct timespec until = {.tv_sec = (time_t)(time / NS_PER_S), .tv_nsec = (long)(time % NS_PER_S)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR) {
    }
}

/* Small, because memory is locked. */
#define STACK ((size_t)256 * 1024)

static bool start(pthread_t *thread, void *(*run)(void *), void *context, int priority)
{
    pthread_attr_t attributes;
    const struct sched_param parameters = {.sched_priority = priority};
    if (pthread_attr_init(&attributes) != 0) {
        return false;
    }
    bool good = pthread_attr_setstacksize(&attributes, STACK) == 0;
    if (priority > 0) {
        good = good && pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED) == 0 &&
               pthread_attr_setschedpolicy(&attributes, SCHED_FIFO) == 0 &&
               pthread_attr_setschedparam(&attributes, &parameters) == 0;
    }
    good = good && pthread_create(thread, &attributes, run, context) == 0;
    (void)pthread_attr_destroy(&attributes);
    return good;
}

bool gust_clock_thread(pthread_t *thread, void *(*run)(void *), void *context, int priority, bool *real_time)
{
    const bool started = priority > 0 && start(thread, run, context, priority);
    if (real_time != NULL) {
        *real_time = started;
    }
    return started || start(thread, run, context, 0);
}
