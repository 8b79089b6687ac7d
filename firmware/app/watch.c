// SPDX-License-Identifier: Apache-2.0
#include "watch.h"

#include <stddef.h>
#include <sys/mman.h>
#include <time.h>

struct watch *watch_make(void)
{
    void *memory =
        mmap(NULL, sizeof(struct watch), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED)
    {
        return NULL;
    }
    struct watch *watch = memory;
    // What the wheels do is not known before a stop was confirmed.
    watch->may_move = true;
    return watch;
}

int64_t watch_now_us(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

void watch_beat(struct watch *watch, enum watch_role role)
{
    watch->beat_us[role] = watch_now_us();
}

int64_t watch_silent_ms(const struct watch *watch, enum watch_role role)
{
    return (watch_now_us() - watch->beat_us[role]) / 1000;
}
