// SPDX-License-Identifier: Apache-2.0
// A thread that hears the operator. It does nothing else: it writes no message and no file, so that
// nothing that blocks makes the robot deaf to a stop.
#ifndef APP_RADIO_H
#define APP_RADIO_H

#include <pthread.h>
#include <stdatomic.h>

#include "config.h"
#include "link.h"
#include "radio/multicast.h"
#include "radio/seal.h"

struct radio
{
    // false: the configuration names no UDP bus.
    bool hears;
    pthread_t thread;
    struct multicast ear;
    // Written to when the thread shall end.
    int end_fd;
    // Where commands go, whole.
    int command_fd;
    int32_t robot_id;
    int64_t session;
    struct seal_key key;
    // Channel on which robots of this number say who they are.
    char link_channel[24];
    // When the newest signed command of this session was made.
    int64_t made_us;
    // When a command that is not obeyed, or a copy, is answered again (monotonic).
    int64_t refusal_us;
    // Packets on the operator's channels that were not even answered.
    atomic_uint ignored_count;
    // When another robot of this number was heard (monotonic); 0: never.
    atomic_llong double_us;
};

// Starts the thread. @param command_fd one end of a connection that keeps messages whole; gets
// every struct link_command for this robot. @param session as in link.h.
// @return false and errno if it cannot; then nothing runs.
bool radio_start(struct radio *radio, const struct app_config *config, const struct seal_key *key,
                 int64_t session, int command_fd);

// Another robot of this number was heard in the last seconds.
bool radio_hears_double(const struct radio *radio);

void radio_stop(struct radio *radio);

#endif
