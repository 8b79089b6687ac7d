// SPDX-License-Identifier: Apache-2.0
// The robot's side of the link to its operator: answers that are true, a stop that holds, and a
// robot that stands once it has lost whoever started it. Why: firmware/RADIO.md.
#ifndef APP_LOOP_LINK_H
#define APP_LOOP_LINK_H

#include "loop_state.h"

// @param config already checked.
void loop_link_init(struct loop *loop, const struct app_config *config);

// us since the session began.
int64_t loop_link_session_us(const struct loop *loop);

// A command was obeyed: the operator is there. @param command what it was.
void loop_link_obeyed(struct loop *loop, const struct fw_command *command);

// A person at the robot itself starts it: whatever was said over the network is past.
void loop_link_start_by_hand(struct loop *loop);

// Stops a robot whose operator has not been heard for too long.
void loop_link_watch(struct loop *loop);

// An operator started the robot, and may still be there: ended, it could not say that it stands.
bool loop_link_is_held(const struct loop *loop);

// Keeps an answer until the motor board was told.
void loop_link_answer(struct loop *loop, const struct link_ack *ack);

// To be called after the motor board was told: what it said is part of the answers.
void loop_link_tell(struct loop *loop);

// What a report says of the link.
void loop_link_report(const struct loop *loop, struct link_report *report);

#endif
