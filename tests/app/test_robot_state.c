// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/app/robot_state.c, over every state and every set of conditions. What is
// expected are the sentences of firmware/README.md, not the rows of the table.
#include "robot_state.h"

#include <stdbool.h>

#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

#define FOR_ALL(state, conditions)                          \
    for (int state = 0; state < ROBOT_STATE_COUNT; ++state) \
        for (int conditions = 0; conditions <= ROBOT_ALL_CONDITIONS; ++conditions)

static enum robot_state next(int state, int conditions)
{
    return robot_next((enum robot_state)state, (uint8_t)conditions);
}

static bool holds(int conditions, enum robot_condition one)
{
    return (conditions & ROBOT_BIT(one)) != 0;
}

static void test_wheels_turn_only_where_all_conditions_hold_and_a_stop_was_confirmed(void)
{
    FOR_ALL(state, conditions)
    {
        const bool may = conditions == ROBOT_ALL_CONDITIONS && state != ROBOT_UNKNOWN;
        TEST_ASSERT_EQUAL(may, next(state, conditions) == ROBOT_DRIVING);
    }
}

static void test_what_the_wheels_do_is_unknown_exactly_while_the_board_does_not_confirm(void)
{
    FOR_ALL(state, conditions)
    {
        TEST_ASSERT_EQUAL(!holds(conditions, ROBOT_BOARD_CONFIRMS),
                          next(state, conditions) == ROBOT_UNKNOWN);
    }
}

static void test_robot_stands_without_a_fault_exactly_where_nobody_wishes_otherwise(void)
{
    FOR_ALL(state, conditions)
    {
        const bool stands =
            holds(conditions, ROBOT_BOARD_CONFIRMS) && !holds(conditions, ROBOT_WISHED);
        TEST_ASSERT_EQUAL(stands, next(state, conditions) == ROBOT_STANDING);
    }
}

// No state is left for ever: what was lost may come back.
static void test_every_state_leads_to_driving(void)
{
    for (int state = 0; state < ROBOT_STATE_COUNT; ++state)
    {
        const enum robot_state after = next(state, ROBOT_ALL_CONDITIONS);
        TEST_ASSERT_EQUAL(ROBOT_DRIVING, next(after, ROBOT_ALL_CONDITIONS));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_wheels_turn_only_where_all_conditions_hold_and_a_stop_was_confirmed);
    RUN_TEST(test_what_the_wheels_do_is_unknown_exactly_while_the_board_does_not_confirm);
    RUN_TEST(test_robot_stands_without_a_fault_exactly_where_nobody_wishes_otherwise);
    RUN_TEST(test_every_state_leads_to_driving);
    return UNITY_END();
}
