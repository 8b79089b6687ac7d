// SPDX-License-Identifier: Apache-2.0
#include "robot_state.h"

#define COUNT_OF(table) (sizeof(table) / sizeof(table)[0])
#define WISHED ROBOT_BIT(ROBOT_WISHED)

const struct robot_transition robot_transitions[] = {
    {ROBOT_ALL_STATES, ROBOT_UNKNOWN, 0, ROBOT_BIT(ROBOT_BOARD_CONFIRMS)},
    {ROBOT_ALL_STATES, ROBOT_STANDING, 0, WISHED},
    {ROBOT_ALL_STATES, ROBOT_FAULT, WISHED, ROBOT_ALL_CONDITIONS},
    // The first that a board hears after an outage is a stop.
    {ROBOT_BIT(ROBOT_UNKNOWN), ROBOT_FAULT, ROBOT_ALL_CONDITIONS, 0},
    {ROBOT_ALL_STATES, ROBOT_DRIVING, ROBOT_ALL_CONDITIONS, 0},
};

enum robot_state robot_next(enum robot_state state, uint8_t conditions)
{
    for (unsigned i = 0; i < ROBOT_TRANSITION_COUNT; ++i)
    {
        const struct robot_transition *transition = &robot_transitions[i];
        const uint8_t missing = transition->not_all_of & (uint8_t)~conditions;
        if ((transition->from & ROBOT_BIT(state)) != 0 &&
            (transition->all_of & conditions) == transition->all_of &&
            (transition->not_all_of == 0 || missing != 0))
        {
            return transition->to;
        }
    }
    return ROBOT_UNKNOWN;
}

const struct robot_condition_words robot_condition_words[] = {
    [ROBOT_BOARD_CONFIRMS] = {"board_confirms",
                              "the last stop was confirmed, or the last duties were taken",
                              "`STOP_UNCONFIRMED`, `BOARD_LOST`"},
    [ROBOT_CAMERA_WORKS] =
        {"camera_works", "open, the last call succeeded, and pictures change (`frozen_ms`, 2000)",
         "`CAMERA_LOST`"},
    [ROBOT_FRAME_FRESH] = {"frame_fresh",
                           "the newest good frame is younger than `frame_timeout_ms` (200); a "
                           "script needs none",
                           "`FRAME_STALE`"},
    [ROBOT_BATTERY_OK] = {"battery_ok",
                          "not all of the last 5 readings were below `battery_low_mV`, ever",
                          "`BATTERY_LOW`"},
    [ROBOT_PARTS_ANSWER] = {"parts_answer", "button, lights and battery can be read",
                            "the mode alone; stderr names the part"},
    [ROBOT_GUARDED] = {"guarded", "supervisor and guard were heard within `watchdog_ms`",
                       "`UNGUARDED`"},
    [ROBOT_WISHED] = {"wished",
                      "START, the button or `autostart` came last, not STOP, a lost operator, a "
                      "reload or a script's end; a START for later counts from its instant",
                      "`LATCHED` after a STOP, `LINK_LOST`"},
};
_Static_assert(COUNT_OF(robot_condition_words) == ROBOT_CONDITION_COUNT, "each has its words");

const struct robot_state_words robot_state_words[] = {
    [ROBOT_UNKNOWN] = {"unknown", "fault",
                       "told zero in every step; camera neither opened nor closed"},
    [ROBOT_STANDING] = {"standing", "stopped", "told zero in every step"},
    [ROBOT_FAULT] = {"fault", "fault", "told zero in every step"},
    [ROBOT_DRIVING] = {"driving", "running, script", "the table's or script's duties"},
};
_Static_assert(COUNT_OF(robot_state_words) == ROBOT_STATE_COUNT, "each has its words");
_Static_assert(ROBOT_CONDITION_COUNT <= 8 && ROBOT_STATE_COUNT <= 8, "sets of 8 bits");
