// SPDX-License-Identifier: Apache-2.0
// Notices when nothing runs in the guest: whoever emulates it has other work.
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <time.h>

#include "agent.h"

#define LOOK_NS 10000000
#define LONG_NS 30000000

static _Atomic uint64_t longest_ns;

// Before all programs, and of next to no work.
static void *look(void *unused)
{
    const struct timespec pause = {.tv_nsec = LOOK_NS};
    for (uint64_t before_ns = now_ns();;)
    {
        (void)nanosleep(&pause, NULL);
        const uint64_t t_ns = now_ns(), stood_ns = t_ns - before_ns;
        before_ns = t_ns;
        if (stood_ns > LONG_NS && stood_ns > longest_ns)
        {
            longest_ns = stood_ns;
        }
    }
    return unused;
}

bool standstill_watch(void)
{
    pthread_t thread;
    pthread_attr_t attributes;
    const struct sched_param highest = {.sched_priority = sched_get_priority_max(SCHED_FIFO)};
    return pthread_attr_init(&attributes) == 0 &&
           pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED) == 0 &&
           pthread_attr_setschedpolicy(&attributes, SCHED_FIFO) == 0 &&
           pthread_attr_setschedparam(&attributes, &highest) == 0 &&
           pthread_create(&thread, &attributes, look, NULL) == 0;
}

uint64_t standstill_take_ns(void)
{
    return atomic_exchange(&longest_ns, 0);
}
