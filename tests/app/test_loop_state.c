// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/app/loop_state.c: what the robot says of its wheels is what the board does.
#include "loop_state.h"

#include "robot.h"

// Fixture: a board between the robot and the stub, which tears, refuses and contradicts.

static struct
{
    struct watch watch;
    struct hal_motors inner;
    // Writes of which only the first wheel's byte is taken; stops and questions that are refused.
    int torn_count, refused_stop_count, refused_question_count;
    int question_count;
} board;

static enum fw_err write_duties(void *device, const int8_t wheel_duty_pct[FW_WHEEL_COUNT])
{
    (void)device;
    // Whoever watches knows before the first byte is written.
    TEST_ASSERT_TRUE(board.watch.may_move);
    if (board.torn_count > 0)
    {
        --board.torn_count;
        robot.board.wheel_duty_pct[0] = wheel_duty_pct[0];
        return FW_ERR_IO;
    }
    return hal_motors_write(&board.inner, wheel_duty_pct);
}

static enum fw_err stop(void *device)
{
    (void)device;
    if (board.refused_stop_count > 0)
    {
        --board.refused_stop_count;
        return FW_ERR_IO;
    }
    return hal_motors_stop(&board.inner);
}

static enum fw_err confirm(void *device)
{
    (void)device;
    ++board.question_count;
    if (board.refused_question_count > 0)
    {
        --board.refused_question_count;
        return FW_ERR_IO;
    }
    return hal_motors_confirm(&board.inner);
}

static enum fw_err open_board(void *device)
{
    (void)device;
    return FW_OK;
}

static void close_board(void *device)
{
    (void)device;
}

static void all_beat(void)
{
    watch_beat(&board.watch, WATCH_SUPERVISOR);
    watch_beat(&board.watch, WATCH_GUARD);
}

void setUp(void)
{
    static const struct hal_motors_ops ops = {open_board, write_duties, stop, confirm, close_board};
    robot_make();
    memset(&board, 0, sizeof board);
    board.inner = robot.devices.motors;
    robot.devices.motors = (struct hal_motors){NULL, &ops};
    robot.view = VIEW_GREEN;
    robot_boot();
    // The watchers' time is real, the robot's is moved by hand.
    robot.loop.watchdog_ms = 10000;
    robot.loop.watch = &board.watch;
    all_beat();
}

void tearDown(void)
{
    robot_free();
}

// One step; then the wheels turn only if it is said that they may, and a robot that is said to be
// stopped stands.
static void step(void)
{
    robot_steps(1);
    const struct link_report *report = &robot.report;
    TEST_ASSERT_TRUE(robot_stands() || board.watch.may_move);
    TEST_ASSERT_TRUE(robot_stands() || report->out.mode != FW_MODE_STOPPED);
    TEST_ASSERT_EQUAL(board.watch.may_move, robot.loop.may_move);
}

static void steps(int count)
{
    for (int i = 0; i < count; ++i)
    {
        step();
    }
}

// Test

static void test_what_the_wheels_do_is_unknown_until_a_stop_is_confirmed(void)
{
    TEST_ASSERT_TRUE(robot.loop.may_move);
    board.refused_question_count = 20;
    step();
    TEST_ASSERT_TRUE(robot.loop.may_move);
    TEST_ASSERT_EQUAL(FW_MODE_FAULT, robot.report.out.mode);
    TEST_ASSERT_BITS_HIGH(LINK_STATUS_STOP_UNCONFIRMED, robot.report.status_flags);
    // A camera may take seconds to open: not while wheels may turn.
    TEST_ASSERT_FALSE(robot.camera_is_open);
    steps(20);
    TEST_ASSERT_FALSE(robot.loop.may_move);
    TEST_ASSERT_EQUAL(FW_MODE_STOPPED, robot.report.out.mode);
    TEST_ASSERT_TRUE(robot.camera_is_open);
}

static void test_first_write_that_is_torn_leaves_a_robot_that_may_move(void)
{
    steps(3);
    board.torn_count = 1;
    board.refused_stop_count = 30;
    loop_start(&robot.loop);
    steps(5);
    TEST_ASSERT_FALSE(robot_stands());
    TEST_ASSERT_EQUAL(FW_MODE_FAULT, robot.report.out.mode);
    TEST_ASSERT_BITS_HIGH(LINK_STATUS_STOP_UNCONFIRMED | LINK_STATUS_BOARD_LOST,
                          robot.report.status_flags);
    steps(40);
    TEST_ASSERT_EQUAL(LINK_STATUS_UNTETHERED, robot.report.status_flags);
    ASSERT_DUTIES(left_pct);
}

static void test_board_that_refuses_the_stop_is_no_stopped_robot(void)
{
    steps(3);
    loop_start(&robot.loop);
    steps(5);
    board.refused_stop_count = 1000;
    loop_stop(&robot.loop);
    steps(30);
    ASSERT_DUTIES(left_pct);
    TEST_ASSERT_EQUAL(FW_MODE_FAULT, robot.report.out.mode);
    TEST_ASSERT_BITS_HIGH(LINK_STATUS_STOP_UNCONFIRMED, robot.report.status_flags);
    // What is reported is what the board was told last.
    TEST_ASSERT_EQUAL_INT8_ARRAY(left_pct, robot.report.out.wheel_duty_pct, FW_WHEEL_COUNT);
    board.refused_stop_count = 0;
    step();
    TEST_ASSERT_TRUE(robot_stands());
    step();
    TEST_ASSERT_EQUAL(FW_MODE_STOPPED, robot.report.out.mode);
    TEST_ASSERT_EQUAL(0, robot.report.status_flags);
}

// Another program writes to the board of a robot that stands.
static void test_wheels_that_somebody_else_turns_are_seen_and_stopped(void)
{
    steps(3);
    robot.board.wheel_duty_pct[2] = 50;
    // A stop is told in every step, and looked at every half second.
    robot_steps(1);
    TEST_ASSERT_TRUE(robot_stands());
    const int questions = board.question_count;
    steps(30);
    TEST_ASSERT_INT_WITHIN(1, 2, board.question_count - questions);
}

static void test_robot_without_its_watchers_stands(void)
{
    steps(3);
    loop_start(&robot.loop);
    steps(5);
    ASSERT_DUTIES(left_pct);
    for (int role = WATCH_SUPERVISOR; role <= WATCH_GUARD; ++role)
    {
        board.watch.beat_us[role] -= 20000000;
        step();
        TEST_ASSERT_TRUE(robot_stands());
        TEST_ASSERT_EQUAL(FW_MODE_FAULT, robot.report.out.mode);
        TEST_ASSERT_BITS_HIGH(LINK_STATUS_UNGUARDED, robot.report.status_flags);
        all_beat();
        steps(10);
        ASSERT_DUTIES(left_pct);
        TEST_ASSERT_EQUAL(LINK_STATUS_UNTETHERED, robot.report.status_flags);
    }
}

static void test_close_says_whether_the_wheels_stand(void)
{
    steps(3);
    loop_start(&robot.loop);
    steps(5);
    board.refused_stop_count = 1000;
    TEST_ASSERT_FALSE(loop_close(&robot.loop));
    // What might block is left to who stops the wheels.
    TEST_ASSERT_TRUE(robot.camera_is_open && board.watch.may_move);
    board.refused_stop_count = 0;
    TEST_ASSERT_TRUE(loop_close(&robot.loop));
    TEST_ASSERT_FALSE(robot.camera_is_open || board.watch.may_move);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_what_the_wheels_do_is_unknown_until_a_stop_is_confirmed);
    RUN_TEST(test_first_write_that_is_torn_leaves_a_robot_that_may_move);
    RUN_TEST(test_board_that_refuses_the_stop_is_no_stopped_robot);
    RUN_TEST(test_wheels_that_somebody_else_turns_are_seen_and_stopped);
    RUN_TEST(test_robot_without_its_watchers_stands);
    RUN_TEST(test_close_says_whether_the_wheels_stand);
    return UNITY_END();
}
