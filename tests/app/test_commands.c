// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/app/loop_commands.c
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "robot.h"

// Fixture

static char folder[] = "/tmp/test_commands.XXXXXX";

void setUp(void)
{
    robot_make();
    snprintf(robot.config.script_dir, sizeof robot.config.script_dir, "%s", folder);
    robot.view = VIEW_GREEN;
    robot_boot();
    robot_steps(15);
}

void tearDown(void)
{
    robot_free();
}

static void write_script(const char *text)
{
    char path[128];
    snprintf(path, sizeof path, "%s/s.csv", folder);
    FILE *file = fopen(path, "w");
    TEST_ASSERT_NOT_NULL(file);
    fputs(text, file);
    fclose(file);
}

// Test

static void test_start_and_stop(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    ASSERT_DUTIES(left_pct);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    TEST_ASSERT_TRUE(robot_stands());
}

// Robots that got the command at different times start at one instant, to within a wake-up.
static void test_start_happens_at_its_instant(void)
{
    const int64_t start_us = robot_unix_us() + 700000;
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, start_us, ""));
    while (robot_stands())
    {
        TEST_ASSERT_LESS_OR_EQUAL_INT64(start_us, robot_unix_us());
        robot_steps(1);
    }
    TEST_ASSERT_EQUAL_INT64(start_us, robot_unix_us());
}

// What a running robot plays changes at the instant, not when the command comes.
static void test_start_to_come_leaves_a_running_robot_as_it_is(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    const int64_t start_us = robot_unix_us() + 700000;
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, start_us, "diffusing_v2"));
    while (robot_unix_us() < start_us)
    {
        ASSERT_DUTIES(left_pct);
        TEST_ASSERT_EQUAL_STRING("milling", robot.report.behavior);
        robot_steps(1);
    }
    ASSERT_DUTIES(((const int8_t[4]){100, 100, 100, 100}));
    TEST_ASSERT_EQUAL_STRING("diffusing_v2", robot.report.behavior);
}

// The time server sets the clock while a start waits: it comes when it was agreed to come.
static void test_start_that_waits_is_not_moved_by_a_clock_that_is_set(void)
{
    const int64_t steps_us[] = {59000000, -59000000};
    for (int i = 0; i < 2; ++i)
    {
        const int64_t start_us = robot.hand.monotonic_us + 700000;
        TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, robot_unix_us() + 700000, ""));
        robot.hand.unix_offset_us += steps_us[i];
        while (robot_stands())
        {
            TEST_ASSERT_LESS_OR_EQUAL_INT64(start_us, robot.hand.monotonic_us);
            robot_steps(1);
        }
        TEST_ASSERT_EQUAL_INT64(start_us, robot.hand.monotonic_us);
        TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
        robot_steps(1);
        TEST_ASSERT_TRUE(robot_tell(FW_VERB_ARM, 0, ""));
    }
}

static void test_start_with_an_unknown_table_leaves_all_as_it_is(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, robot_unix_us() + 700000, ""));
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_START, robot_unix_us() + 100000, "dance"));
    robot_steps(10);
    TEST_ASSERT_TRUE(robot_stands());
    robot_steps(20);
    ASSERT_DUTIES(left_pct);
}

static void test_stop_cancels_a_start_that_waits(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, robot_unix_us() + 700000, ""));
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    robot_steps(60);
    TEST_ASSERT_TRUE(robot_stands());
}

static void test_start_by_a_wrong_clock_is_refused(void)
{
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_START, robot_unix_us() - 3600000000, ""));
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_START, robot_unix_us() + 3600000000, ""));
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_START, INT64_MIN, ""));
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_START, INT64_MAX, ""));
    robot_steps(5);
    TEST_ASSERT_TRUE(robot_stands());
}

static void test_copy_is_acknowledged_and_changes_nothing(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, robot_unix_us() + 100000, ""));
    const struct link_command copy = robot.command;
    robot_steps(120);
    robot.command = copy;
    robot.has_command = true;
    robot_steps(1);
    TEST_ASSERT_TRUE(robot.ack.accepted);
    ASSERT_DUTIES(left_pct);
}

static void test_late_copy_of_a_start_does_not_undo_a_stop(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    const struct link_command copy = robot.command;
    robot_steps(3);
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_STOP, 0, ""));
    robot.command = copy;
    robot.has_command = true;
    robot_steps(5);
    TEST_ASSERT_FALSE(robot.ack.accepted);
    TEST_ASSERT_TRUE(robot_stands());
}

static void test_stop_is_obeyed_however_old(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    TEST_ASSERT_TRUE(robot_tell_as_of(3600000000, FW_VERB_STOP, 0, ""));
    TEST_ASSERT_TRUE(robot_stands());
}

static void test_select_changes_the_table(void)
{
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_SELECT, 0, "diffusing_v2"));
    robot_steps(1);
    ASSERT_DUTIES(((const int8_t[4]){100, 100, 100, 100}));
    TEST_ASSERT_EQUAL_STRING("diffusing_v2", robot.report.behavior);
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_SELECT, 0, "dance"));
    TEST_ASSERT_EQUAL_STRING("no behaviour 'dance'", robot.ack.reason);
    ASSERT_DUTIES(((const int8_t[4]){100, 100, 100, 100}));
}

static void test_tables_of_the_users_own_are_known_by_name(void)
{
    char error[LINES_ERROR_MAX];
    TEST_ASSERT_TRUE(own_tables_add(&robot.own, "ahead", "0,2,100,0", error));
    TEST_ASSERT_TRUE(own_tables_add(&robot.own, "milling", "0,2,-100,0", error));
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, "ahead"));
    robot_steps(1);
    ASSERT_DUTIES(((const int8_t[4]){100, 100, 100, 100}));
    TEST_ASSERT_EQUAL_STRING("ahead", robot.report.behavior);
    // It goes before a built-in one of its name, and may be given anew.
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_SELECT, 0, "milling"));
    robot_steps(1);
    ASSERT_DUTIES(((const int8_t[4]){-100, -100, -100, -100}));
    TEST_ASSERT_TRUE(own_tables_add(&robot.own, "milling", "0,2,100,0", error));
    TEST_ASSERT_EQUAL(2, robot.own.count);
}

static void test_own_tables_that_are_none_are_refused_in_words(void)
{
    char error[LINES_ERROR_MAX];
    TEST_ASSERT_FALSE(own_tables_add(&robot.own, "fast", "0,2,101,0", error));
    TEST_ASSERT_NOT_NULL(strstr(error, "'fast' must be speed,turn"));
    TEST_ASSERT_FALSE(own_tables_add(&robot.own, "", "0,2,100,0", error));
    char longest[LINK_NAME_MAX + 1] = {0};
    memset(longest, 'a', LINK_NAME_MAX);
    TEST_ASSERT_FALSE(own_tables_add(&robot.own, longest, "0,2,100,0", error));
    TEST_ASSERT_NOT_NULL(strstr(error, "1 to 47 characters"));
    longest[LINK_NAME_MAX - 1] = '\0';
    TEST_ASSERT_TRUE(own_tables_add(&robot.own, longest, "0,2,100,0", error));
    for (int i = 1; i < OWN_TABLES_MAX; ++i)
    {
        char name[16];
        snprintf(name, sizeof name, "t%d", i);
        TEST_ASSERT_TRUE(own_tables_add(&robot.own, name, "0,2,100,0", error));
    }
    TEST_ASSERT_FALSE(own_tables_add(&robot.own, "more", "0,2,100,0", error));
    TEST_ASSERT_NOT_NULL(strstr(error, "one too many"));
}

static void test_script_is_played_at_its_times_and_ends_in_a_stop(void)
{
    write_script(
        "t_s,fl_pct,fr_pct,rl_pct,rr_pct\n0,10,20,30,40\n0.05,-50,50,-50,50\n0.1,9,9,9,9\n");
    robot.hand.wait_us = INT64_MAX;  // only the loop's own time-outs wake it
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_SCRIPT, 0, "s.csv"));
    const int64_t begin_us = robot.hand.monotonic_us;
    ASSERT_DUTIES(((const int8_t[4]){10, 20, 30, 40}));
    TEST_ASSERT_EQUAL(FW_MODE_SCRIPT, robot.report.out.mode);
    robot_steps(1);
    TEST_ASSERT_EQUAL_INT64(begin_us + 50000, robot.hand.monotonic_us);
    ASSERT_DUTIES(((const int8_t[4]){-50, 50, -50, 50}));
    robot_steps(1);
    TEST_ASSERT_EQUAL_INT64(begin_us + 100000, robot.hand.monotonic_us);
    TEST_ASSERT_TRUE(robot_stands());
    TEST_ASSERT_TRUE(robot.loop.script_over);
}

static void test_bad_scripts_are_refused_in_words(void)
{
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_SCRIPT, 0, "absent.csv"));
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_SCRIPT, 0, "../../etc/passwd"));
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_SCRIPT, 0, ""));
    write_script("t_s,speed_input,turn_input\n0,500,0\n");
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_SCRIPT, 0, "s.csv"));
    TEST_ASSERT_NOT_NULL(strstr(robot.ack.reason, "line 2"));
    TEST_ASSERT_TRUE(robot_tell(FW_VERB_START, 0, ""));
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_SCRIPT, 0, "s.csv"));
    ASSERT_DUTIES(left_pct);
}

static void test_unknown_verb_is_refused(void)
{
    TEST_ASSERT_FALSE(robot_tell((enum fw_verb)77, 0, ""));
}

static void test_start_is_refused_while_the_battery_is_low(void)
{
    robot.board.pack_mV = 6000;
    robot_steps(30 * 7);
    TEST_ASSERT_FALSE(robot_tell(FW_VERB_START, 0, ""));
    TEST_ASSERT_TRUE(robot_stands());
}

int main(void)
{
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    UNITY_BEGIN();
    RUN_TEST(test_start_and_stop);
    RUN_TEST(test_start_happens_at_its_instant);
    RUN_TEST(test_start_to_come_leaves_a_running_robot_as_it_is);
    RUN_TEST(test_start_that_waits_is_not_moved_by_a_clock_that_is_set);
    RUN_TEST(test_start_with_an_unknown_table_leaves_all_as_it_is);
    RUN_TEST(test_stop_cancels_a_start_that_waits);
    RUN_TEST(test_start_by_a_wrong_clock_is_refused);
    RUN_TEST(test_copy_is_acknowledged_and_changes_nothing);
    RUN_TEST(test_late_copy_of_a_start_does_not_undo_a_stop);
    RUN_TEST(test_stop_is_obeyed_however_old);
    RUN_TEST(test_select_changes_the_table);
    RUN_TEST(test_tables_of_the_users_own_are_known_by_name);
    RUN_TEST(test_own_tables_that_are_none_are_refused_in_words);
    RUN_TEST(test_script_is_played_at_its_times_and_ends_in_a_stop);
    RUN_TEST(test_bad_scripts_are_refused_in_words);
    RUN_TEST(test_unknown_verb_is_refused);
    RUN_TEST(test_start_is_refused_while_the_battery_is_low);
    const int failures = UNITY_END();
    char path[128];
    snprintf(path, sizeof path, "%s/s.csv", folder);
    unlink(path);
    rmdir(folder);
    return failures;
}
