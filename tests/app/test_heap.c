// SPDX-License-Identifier: Apache-2.0
// The robot's loop takes no heap once it runs, whatever happens: nothing can be exhausted. This
// program's own malloc() counts, so that calls from inside the C library are seen as well.
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "robot.h"

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *block, size_t size);

static int allocation_count;

void *malloc(size_t size)
{
    ++allocation_count;
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    ++allocation_count;
    return __libc_calloc(count, size);
}

void *realloc(void *block, size_t size)
{
    ++allocation_count;
    return __libc_realloc(block, size);
}

// Fixture

static char folder[] = "/tmp/test_heap.XXXXXX";

void setUp(void)
{
    robot_make();
    (void)snprintf(robot.config.script_dir, sizeof robot.config.script_dir, "%s", folder);
    robot.view = VIEW_GREEN;
    robot_boot();
    robot_steps(2);
    allocation_count = 0;
}

void tearDown(void)
{
    robot_free();
}

// Test

static void test_allocations_are_counted(void)
{
    FILE *file = fopen("/dev/null", "r");
    TEST_ASSERT_NOT_NULL(file);
    (void)fclose(file);
    TEST_ASSERT_GREATER_THAN(0, allocation_count);
}

static void test_driving_takes_no_heap(void)
{
    loop_start(&robot.loop);
    for (int i = 0; i < 1000; ++i)
    {
        robot.view = i % 7 < 3 ? VIEW_GREY : VIEW_GREEN;
        robot.panel.pressed = i % 50 > 40;
        robot_steps(1);
    }
    TEST_ASSERT_EQUAL(0, allocation_count);
}

static void test_failures_take_no_heap(void)
{
    loop_start(&robot.loop);
    robot.view = VIEW_UNPLUGGED;
    robot_steps(30);
    robot.view = VIEW_GREEN;
    robot_steps(30);
    robot.faults = (struct stub_faults){
        .fails_at = robot.faults.call_count + 1, .fails_count = 100, .err = FW_ERR_IO};
    robot_steps(100);
    robot.board.pack_mV = 6500;
    robot_steps(300);
    TEST_ASSERT_TRUE(robot_stands() && robot.loop.battery_low);
    TEST_ASSERT_EQUAL(0, allocation_count);
}

static void test_commands_take_no_heap(void)
{
    (void)robot_tell(FW_VERB_SCRIPT, 0, "lap.csv");
    TEST_ASSERT_TRUE(robot.ack.accepted);
    robot_steps(10);
    (void)robot_tell(FW_VERB_STOP, 0, "");
    robot_steps(1);
    (void)robot_tell(FW_VERB_ARM, 0, "");
    (void)robot_tell(FW_VERB_SCRIPT, 0, "none.csv");
    TEST_ASSERT_FALSE(robot.ack.accepted);
    (void)robot_tell(FW_VERB_SELECT, 0, "orbit");
    (void)robot_tell(FW_VERB_SELECT, 0, "dance");
    (void)robot_tell(FW_VERB_START, 0, "");
    robot_steps(10);
    TEST_ASSERT_EQUAL(0, allocation_count);
}

int main(void)
{
    if (mkdtemp(folder) == NULL)
    {
        return 1;
    }
    char path[sizeof folder + 16];
    (void)snprintf(path, sizeof path, "%s/lap.csv", folder);
    FILE *file = fopen(path, "w");
    if (file == NULL || fputs("t_s,speed_input,turn_input\n0,50,0\n9,0,0\n", file) < 0 ||
        fclose(file) != 0)
    {
        return 1;
    }
    UNITY_BEGIN();
    RUN_TEST(test_allocations_are_counted);
    RUN_TEST(test_driving_takes_no_heap);
    RUN_TEST(test_failures_take_no_heap);
    RUN_TEST(test_commands_take_no_heap);
    const int failures = UNITY_END();
    (void)unlink(path);
    (void)rmdir(folder);
    return failures;
}
