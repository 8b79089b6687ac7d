// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/app/priority.c: what the kernel says of a process after it.
#include "priority.h"

#include <sched.h>
#include <stdbool.h>
#include <stdio.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "unity.h"

void setUp(void) {}

void tearDown(void) {}

// @return the process's locked memory in KB, -1 if the kernel does not say.
static long locked_kb(void)
{
    char line[128];
    long size_kb = -1;
    FILE *file = fopen("/proc/self/status", "r");
    while (file != NULL && fgets(line, sizeof line, file) != NULL)
    {
        (void)sscanf(line, "VmLck: %ld", &size_kb);
    }
    if (file != NULL)
    {
        (void)fclose(file);
    }
    return size_kb;
}

// In a process of its own. @return 0, or the number of what was not as expected.
static int take_under(rlim_t memlock, rlim_t rtprio, enum priority_rank rank, int expected)
{
    const pid_t child = fork();
    if (child == 0)
    {
        const struct rlimit memory = {memlock, memlock}, priority = {rtprio, rtprio};
        const struct sched_param low = {.sched_priority = 1};
        const bool may =
            setrlimit(RLIMIT_MEMLOCK, &memory) == 0 && setrlimit(RLIMIT_RTPRIO, &priority) == 0 &&
            (rtprio == 0 || (sched_setscheduler(0, SCHED_FIFO, &low) == 0 &&
                             sched_setscheduler(0, SCHED_OTHER, &(struct sched_param){0}) == 0));
        if (!may)
        {
            _exit(77);
        }
        priority_take(rank);
        struct sched_param now = {0};
        (void)sched_getparam(0, &now);
        _exit((locked_kb() > 0) != (memlock == RLIM_INFINITY)                    ? 1
              : sched_getscheduler(0) != (rtprio > 0 ? SCHED_FIFO : SCHED_OTHER) ? 2
              : now.sched_priority != expected                                   ? 3
                                                                                 : 0);
    }
    int status = -1;
    TEST_ASSERT_EQUAL(child, waitpid(child, &status, 0));
    if (WIFEXITED(status) && WEXITSTATUS(status) == 77)
    {
        TEST_IGNORE_MESSAGE("this user may not raise limits");
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void test_limits_of_the_service_are_used(void)
{
    TEST_ASSERT_EQUAL(0, take_under(RLIM_INFINITY, 10, PRIORITY_WATCHES, 10));
}

// In real time a process that never pauses leaves nothing to others of its own priority.
static void test_watchers_go_before_whom_they_watch(void)
{
    TEST_ASSERT_EQUAL(0, take_under(RLIM_INFINITY, 10, PRIORITY_DRIVES, 9));
    TEST_ASSERT_EQUAL(0, take_under(RLIM_INFINITY, 1, PRIORITY_DRIVES, 1));
}

static void test_limits_of_a_shell_leave_all_as_it_was(void)
{
    TEST_ASSERT_EQUAL(0, take_under(8 << 20, 0, PRIORITY_WATCHES, 0));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_limits_of_the_service_are_used);
    RUN_TEST(test_watchers_go_before_whom_they_watch);
    RUN_TEST(test_limits_of_a_shell_leave_all_as_it_was);
    return UNITY_END();
}
