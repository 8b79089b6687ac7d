// SPDX-License-Identifier: Apache-2.0
#include "priority.h"

#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

static rlim_t limit_of(__rlimit_resource_t resource)
{
    struct rlimit limit = {0};
    return getrlimit(resource, &limit) == 0 ? limit.rlim_cur : 0;
}

void priority_take(enum priority_rank rank)
{
    // Under a limit the next mapping would fail, the camera's for one.
    if (limit_of(RLIMIT_MEMLOCK) == RLIM_INFINITY)
    {
        (void)mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT);
    }
    const rlim_t highest = limit_of(RLIMIT_RTPRIO);
    if (highest > 0 && highest <= (rlim_t)sched_get_priority_max(SCHED_FIFO))
    {
        const int wanted = (int)highest - (int)rank;
        const struct sched_param parameters = {.sched_priority = wanted > 1 ? wanted : 1};
        (void)sched_setscheduler(0, SCHED_FIFO, &parameters);
    }
}
