// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/app/loop_link.c
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "robot.h"

// Fixture

static char folder[] = "/tmp/test_link.XXXXXX";

void setUp(void)
{
    robot_make();
    robot.view = VIEW_GREEN;
    robot_boot();
    robot_steps(15);
}

void tearDown(void)
{
    robot_free();
}

// Test

static void test_stop_holds_until_armed(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_START, 0, ""));
    TEST_ASSERT_NOT_NULL(strstr(robot.ack.reason, "arm"));
    TEST_ASSERT_BITS_HIGH(LINK_STATUS_LATCHED, robot.report.status_flags);
    robot_steps(1);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_ARM, 0, ""));
    TEST_ASSERT_TRUE(robot_stands());
    TEST_ASSERT_BITS_LOW(LINK_STATUS_LATCHED, robot.report.status_flags);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    ASSERT_DUTIES(left_pct);
}

// Whose key is another is told which one counts, and who arms a robot which one did.
static void test_answers_name_the_robots_key(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_ARM, 0, ""));
    TEST_ASSERT_NOT_NULL(strstr(robot.ack.reason, ROBOT_KEY_NAME));
    robot.command.order.seal = FW_SEAL_WRONG;
    robot.has_command = true;
    robot_steps(1);
    TEST_ASSERT_FALSE(robot.ack.accepted);
    TEST_ASSERT_NOT_NULL(strstr(robot.ack.reason, ROBOT_KEY_NAME));
}

// Starts every 10 ms against one stop.
static void test_flood_of_starts_does_not_undo_a_stop(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    robot.hand.wait_us = 10000;
    for (int i = 0; i < 500; ++i)
    {
        TEST_ASSERT_FALSE(robot_tell(FW_VERB_START, 0, ""));
        TEST_ASSERT_TRUE(robot_stands());
    }
}

// A stop that is stamped far ahead, as by a broken clock or by somebody who means it.
static void test_stop_from_the_future_locks_nobody_out(void)
{
    TEST_ASSERT_TRUE(robot_tell_as_of(-INT64_C(3155760000000000), FW_VERB_STOP, 0, ""));
    robot_steps(1);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_ARM, 0, ""));
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    ASSERT_DUTIES(left_pct);
}

static void test_button_starts_a_robot_that_was_stopped(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    robot.panel.pressed = true;
    robot_steps(3);
    robot.panel.pressed = false;
    robot_steps(3);
    ASSERT_DUTIES(left_pct);
    TEST_ASSERT_BITS_LOW(LINK_STATUS_LATCHED, robot.report.status_flags);
    TEST_ASSERT_BITS_HIGH(LINK_STATUS_UNTETHERED, robot.report.status_flags);
}

static void test_stop_outlives_the_program(void)
{
    char path[128];
    snprintf(path, sizeof path, "%s/stopped", folder);
    snprintf(robot.config.run_dir, sizeof robot.config.run_dir, "%s", folder);
    robot_boot();
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    TEST_ASSERT_EQUAL(0, access(path, F_OK));
    robot_boot();
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_START, 0, ""));
    robot_steps(1);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_ARM, 0, ""));
    TEST_ASSERT_NOT_EQUAL(0, access(path, F_OK));
    robot_boot();
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
}

// No file can be made, as on a full disk: the stop renames one that is there.
static void test_stop_is_kept_where_there_is_no_room(void)
{
    char path[128];
    struct rlimit none, limit;
    snprintf(path, sizeof path, "%s/stopped", folder);
    snprintf(robot.config.run_dir, sizeof robot.config.run_dir, "%s", folder);
    robot_boot();
    TEST_ASSERT_TRUE(latch_works(&robot.loop.operator_link.latch));
    TEST_ASSERT_EQUAL(0, getrlimit(RLIMIT_NOFILE, &none));
    limit = none;
    limit.rlim_cur = 0;
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_NOFILE, &limit));
    const bool stopped = robot_tell(FW_VERB_STOP, 0, "");
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_NOFILE, &none));
    TEST_ASSERT_TRUE(stopped);
    TEST_ASSERT_EQUAL_STRING("", robot.ack.reason);
    TEST_ASSERT_EQUAL(0, access(path, F_OK));
    robot_steps(1);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_ARM, 0, ""));
    TEST_ASSERT_NOT_EQUAL(0, access(path, F_OK));
}

// As a card that gave up: what was written before is there, and nothing more can be.
static void test_no_stop_can_be_kept_where_nothing_can_be_written(void)
{
    snprintf(robot.config.run_dir, sizeof robot.config.run_dir, "%s", folder);
    robot_boot();
    TEST_ASSERT_TRUE(latch_works(&robot.loop.operator_link.latch));
    if (unshare(CLONE_NEWNS) != 0 || mount(NULL, "/", NULL, MS_REC | MS_PRIVATE, NULL) != 0)
    {
        TEST_IGNORE_MESSAGE("a folder can be made read-only here by root alone");
    }
    TEST_ASSERT_EQUAL(0, mount(folder, folder, NULL, MS_BIND, NULL));
    TEST_ASSERT_EQUAL(0, mount(NULL, folder, NULL, MS_BIND | MS_REMOUNT | MS_RDONLY, NULL));
    robot_boot();
    TEST_ASSERT_FALSE(latch_works(&robot.loop.operator_link.latch));
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    TEST_ASSERT_NOT_NULL(strstr(robot.ack.reason, "run_dir"));
    TEST_ASSERT_EQUAL(0, umount(folder));
}

// Its board is a stand-in, and what that takes says nothing of wheels.
static void test_dry_run_is_told_by_all_that_is_sent(void)
{
    robot_steps(1);
    TEST_ASSERT_BITS_LOW(LINK_STATUS_DRY_RUN, robot.report.status_flags);
    robot.devices.dry_run = true;
    robot_boot();
    robot_steps(1);
    TEST_ASSERT_BITS_HIGH(LINK_STATUS_DRY_RUN, robot.report.status_flags);
}

// A folder that is not there yet.
static void test_stop_that_cannot_be_kept_in_mind_is_told_and_kept_later(void)
{
    char path[sizeof robot.config.run_dir + 16];
    snprintf(robot.config.run_dir, sizeof robot.config.run_dir, "%s/later", folder);
    snprintf(path, sizeof path, "%s/stopped", robot.config.run_dir);
    robot_boot();
    TEST_ASSERT_FALSE(latch_works(&robot.loop.operator_link.latch));
    robot_steps(1);
    TEST_ASSERT_BITS_HIGH(LINK_STATUS_LATCH_LOST, robot.report.status_flags);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    TEST_ASSERT_NOT_NULL(strstr(robot.ack.reason, "run_dir"));
    TEST_ASSERT_EQUAL(0, mkdir(robot.config.run_dir, 0700));
    // Not in every step: once a second.
    robot_steps(3);
    TEST_ASSERT_NOT_EQUAL(0, access(path, F_OK));
    robot_steps(1000000 / ROBOT_PERIOD_US + 1);
    TEST_ASSERT_EQUAL(0, access(path, F_OK));
    TEST_ASSERT_BITS_LOW(LINK_STATUS_LATCH_LOST, robot.report.status_flags);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    TEST_ASSERT_EQUAL_STRING("", robot.ack.reason);
    robot_steps(1);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_ARM, 0, ""));
    snprintf(path, sizeof path, "%s/not_stopped", robot.config.run_dir);
    TEST_ASSERT_EQUAL(0, unlink(path));
    TEST_ASSERT_EQUAL(0, rmdir(robot.config.run_dir));
}

static void test_robot_that_loses_its_operator_stops(void)
{
    robot.link_timeout_ms = 1000;
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    const int64_t heard_us = robot.hand.monotonic_us;
    while (!robot_stands())
    {
        robot_steps(1);
        TEST_ASSERT_LESS_OR_EQUAL_INT64(heard_us + 1000000 + ROBOT_PERIOD_US,
                                        robot.hand.monotonic_us);
    }
    TEST_ASSERT_GREATER_THAN_INT64(heard_us + 1000000, robot.hand.monotonic_us);
    TEST_ASSERT_BITS_HIGH(LINK_STATUS_LINK_LOST, robot.report.status_flags);
    // It waits for a start, and needs no arming: nobody has said stop.
    robot_steps(30);
    TEST_ASSERT_TRUE(robot_stands());
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    TEST_ASSERT_BITS_LOW(LINK_STATUS_LINK_LOST, robot.report.status_flags);
}

static void test_robot_that_hears_its_operator_goes_on(void)
{
    robot.link_timeout_ms = 1000;
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    const int acks = robot.ack_count;
    for (int i = 0; i < 10; ++i)
    {
        robot.command.order.verb = FW_VERB_HOLD;
        robot.command.order.made_us = loop_link_session_us(&robot.loop);
        robot.has_command = true;
        robot_steps(20);
        ASSERT_DUTIES(left_pct);
    }
    // It is said too often to be answered.
    TEST_ASSERT_EQUAL(acks, robot.ack_count);
}

static void test_robot_that_lost_its_operator_does_not_start_later(void)
{
    robot.link_timeout_ms = 1000;
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, robot_unix_us() + 5000000, ""));
    robot_steps(300);
    TEST_ASSERT_TRUE(robot_stands());
}

static void test_start_without_a_word_on_it_has_the_configured_time_out(void)
{
    robot.link_timeout_ms = -1;
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    TEST_ASSERT_EQUAL(robot.config.link_timeout_ms, robot.report.link_timeout_ms);
    TEST_ASSERT_EQUAL(2000, robot.config.link_timeout_ms);
    TEST_ASSERT_BITS_LOW(LINK_STATUS_UNTETHERED, robot.report.status_flags);
}

static void test_answer_to_a_stop_says_if_the_board_took_it(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    TEST_ASSERT_FALSE(robot.ack.stands);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    TEST_ASSERT_TRUE(robot.ack.stands);
    robot.faults = (struct stub_faults){.fails_at = 1, .fails_count = 1000, .err = FW_ERR_IO};
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    TEST_ASSERT_FALSE(robot.ack.stands);
    TEST_ASSERT_FALSE(robot.report.stands);
}

// Whoever selects in another's countdown is told by the robot itself what will be played instead.
static void test_select_before_a_start_is_answered_with_what_that_plays(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_SELECT, 0, "diffusing_v2"));
    TEST_ASSERT_EQUAL_STRING("", robot.ack.reason);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, robot_unix_us() + 700000, "milling"));
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_SELECT, 0, "diffusing_v2"));
    TEST_ASSERT_EQUAL_STRING("a start that it waits for plays milling", robot.ack.reason);
    robot_steps(60);
    TEST_ASSERT_EQUAL_STRING("milling", robot.report.behavior);
    // One that names nothing plays what was selected.
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, robot_unix_us() + 700000, ""));
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_SELECT, 0, "diffusing_v2"));
    TEST_ASSERT_EQUAL_STRING("", robot.ack.reason);
    robot_steps(60);
    TEST_ASSERT_EQUAL_STRING("diffusing_v2", robot.report.behavior);
}

// Whoever looks on has not heard the start: its operator may be gone since.
static void test_robot_that_waits_for_a_start_says_so(void)
{
    robot_steps(1);
    TEST_ASSERT_BITS_LOW(LINK_STATUS_AWAITS_START, robot.report.status_flags);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, robot_unix_us() + 700000, ""));
    TEST_ASSERT_TRUE(robot_stands());
    TEST_ASSERT_BITS_HIGH(LINK_STATUS_AWAITS_START, robot.report.status_flags);
    robot_steps(60);
    ASSERT_DUTIES(left_pct);
    TEST_ASSERT_BITS_LOW(LINK_STATUS_AWAITS_START, robot.report.status_flags);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, robot_unix_us() + 700000, ""));
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    TEST_ASSERT_BITS_LOW(LINK_STATUS_AWAITS_START, robot.report.status_flags);
}

int main(void)
{
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    UNITY_BEGIN();
    RUN_TEST(test_stop_holds_until_armed);
    RUN_TEST(test_answers_name_the_robots_key);
    RUN_TEST(test_flood_of_starts_does_not_undo_a_stop);
    RUN_TEST(test_stop_from_the_future_locks_nobody_out);
    RUN_TEST(test_button_starts_a_robot_that_was_stopped);
    RUN_TEST(test_stop_outlives_the_program);
    RUN_TEST(test_stop_is_kept_where_there_is_no_room);
    RUN_TEST(test_no_stop_can_be_kept_where_nothing_can_be_written);
    RUN_TEST(test_dry_run_is_told_by_all_that_is_sent);
    RUN_TEST(test_stop_that_cannot_be_kept_in_mind_is_told_and_kept_later);
    RUN_TEST(test_robot_that_loses_its_operator_stops);
    RUN_TEST(test_robot_that_hears_its_operator_goes_on);
    RUN_TEST(test_robot_that_lost_its_operator_does_not_start_later);
    RUN_TEST(test_start_without_a_word_on_it_has_the_configured_time_out);
    RUN_TEST(test_answer_to_a_stop_says_if_the_board_took_it);
    RUN_TEST(test_select_before_a_start_is_answered_with_what_that_plays);
    RUN_TEST(test_robot_that_waits_for_a_start_says_so);
    const int failures = UNITY_END();
    char path[128];
    snprintf(path, sizeof path, "%s/not_stopped", folder);
    unlink(path);
    rmdir(folder);
    return failures;
}
