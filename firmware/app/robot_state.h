// SPDX-License-Identifier: Apache-2.0
// When the wheels may turn: conditions, the states of a robot, and what leads from one to another.
// firmware/README.md's tables are made of these.
#ifndef APP_ROBOT_STATE_H
#define APP_ROBOT_STATE_H

#include <stdint.h>

enum robot_condition
{
    ROBOT_BOARD_CONFIRMS,
    ROBOT_CAMERA_WORKS,
    ROBOT_FRAME_FRESH,
    ROBOT_BATTERY_OK,
    ROBOT_PARTS_ANSWER,
    ROBOT_GUARDED,
    ROBOT_WISHED,
    ROBOT_CONDITION_COUNT,
};

enum robot_state
{
    ROBOT_UNKNOWN,
    ROBOT_STANDING,
    ROBOT_FAULT,
    ROBOT_DRIVING,
    ROBOT_STATE_COUNT,
};

// Sets of conditions, and of states.
#define ROBOT_BIT(one) ((uint8_t)(1u << (one)))
#define ROBOT_ALL_CONDITIONS ((uint8_t)(ROBOT_BIT(ROBOT_CONDITION_COUNT) - 1))
#define ROBOT_ALL_STATES ((uint8_t)(ROBOT_BIT(ROBOT_STATE_COUNT) - 1))

struct robot_transition
{
    // Set of states that it leads from.
    uint8_t from;
    enum robot_state to;
    // It is taken while all of these conditions hold, and, unless the second set is empty, not all
    // of those do.
    uint8_t all_of, not_all_of;
};

// The first that fits is taken; one always does.
#define ROBOT_TRANSITION_COUNT 5
extern const struct robot_transition robot_transitions[ROBOT_TRANSITION_COUNT];

// @param conditions set of those that hold.
enum robot_state robot_next(enum robot_state state, uint8_t conditions);

// For people.
struct robot_condition_words
{
    const char *name, *true_while, *else_telemetry_says;
};
struct robot_state_words
{
    const char *name, *mode, *wheels;
};
extern const struct robot_condition_words robot_condition_words[];
extern const struct robot_state_words robot_state_words[];

#endif
