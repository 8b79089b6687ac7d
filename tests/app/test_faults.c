// SPDX-License-Identifier: Apache-2.0
// Every call to a device is made to fail in turn: a stop of the motors follows each.
#include "robot.h"

#define STEPS 100

void setUp(void)
{
    robot_make();
}

void tearDown(void)
{
    robot_free();
}

// Calls that a robot makes from its first step to the last, without any failure.
static int32_t calls_of_a_drive(void)
{
    robot.view = VIEW_GREEN;
    robot_boot();
    loop_start(&robot.loop);
    robot_steps(STEPS);
    ASSERT_DUTIES(left_pct);
    const int32_t count = robot.faults.call_count;
    robot_free();
    robot_make();
    return count;
}

// Drives until the failure has happened: a stop was tried in that very step.
// @return stops that had succeeded before it.
static int drive_into(int32_t fails_at, int32_t fails_count, enum fw_err err)
{
    robot.faults =
        (struct stub_faults){.fails_at = fails_at, .fails_count = fails_count, .err = err};
    robot.view = VIEW_GREEN;
    robot_boot();
    loop_start(&robot.loop);
    int stops = 0, tries = 0;
    while (robot.faults.call_count < fails_at)
    {
        stops = robot.board.stop_count;
        tries = robot.board.stop_try_count;
        loop_step(&robot.loop);
    }
    TEST_ASSERT_GREATER_THAN(tries, robot.board.stop_try_count);
    return stops;
}

static void check_one_failure(enum fw_err err)
{
    const int32_t calls = calls_of_a_drive();
    TEST_ASSERT_GREATER_THAN(4 * STEPS, calls);
    for (int32_t fails_at = 1; fails_at <= calls; ++fails_at)
    {
        const int stops = drive_into(fails_at, 1, err);
        // Only a stop that fails itself has to wait for the next step.
        if (robot.board.stop_count == stops)
        {
            loop_step(&robot.loop);
        }
        TEST_ASSERT_GREATER_THAN(stops, robot.board.stop_count);
        // And the robot recovers from a single failure.
        robot_steps(60);
        ASSERT_DUTIES(left_pct);
        robot_free();
        robot_make();
    }
}

// Test

static void test_stop_follows_every_single_failure(void)
{
    check_one_failure(FW_ERR_IO);
    check_one_failure(FW_ERR_NO_DEVICE);
}

// All fails from some call on, for a second: the wheels are at zero in the first step that reaches
// the board again, and drive no sooner than it.
static void test_stop_is_the_first_that_a_board_hears_after_an_outage(void)
{
    const int32_t calls = calls_of_a_drive();
    for (int32_t fails_at = 1; fails_at <= calls; ++fails_at)
    {
        (void)drive_into(fails_at, 100000, FW_ERR_NO_DEVICE);
        robot_steps(30);
        robot.faults.fails_count = 0;
        const int stops = robot.board.stop_count, writes = robot.board.write_count;
        loop_step(&robot.loop);
        TEST_ASSERT_TRUE(robot_stands());
        TEST_ASSERT_GREATER_THAN(stops, robot.board.stop_count);
        TEST_ASSERT_EQUAL(writes, robot.board.write_count);
        robot_steps(60);
        ASSERT_DUTIES(left_pct);
        robot_free();
        robot_make();
    }
}

// A stop that fails while the program ends is tried again.
static void test_close_insists_on_the_stop(void)
{
    robot_drive(VIEW_GREEN);
    robot.faults = (struct stub_faults){.fails_at = 1, .fails_count = 2, .err = FW_ERR_IO};
    loop_close(&robot.loop);
    TEST_ASSERT_TRUE(robot_stands());
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_stop_follows_every_single_failure);
    RUN_TEST(test_stop_is_the_first_that_a_board_hears_after_an_outage);
    RUN_TEST(test_close_insists_on_the_stop);
    return UNITY_END();
}
