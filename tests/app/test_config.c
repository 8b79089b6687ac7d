// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/app/config.c, config_keys.c and io_tsv.c
#include "config.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "../firmware/support.h"
#include "config_keys.h"
#include "fw/behavior.h"
#include "io_tsv.h"
#include "unity.h"

// Fixture

static struct app_config config;
static char error[CONFIG_ERROR_MAX];

void setUp(void)
{
    config_default(&config);
    error[0] = '\0';
}

void tearDown(void) {}

static bool parse(const char *text)
{
    return config_parse(&config, "robot.conf", text, error);
}

// Test

static void test_defaults_are_the_cores(void)
{
    struct fw_config core;
    const struct fw_config expected = fw_config_default();
    TEST_ASSERT_EQUAL(FW_OK, config_core(&config, &core));
    TEST_ASSERT_EQUAL(expected.width_px, core.width_px);
    TEST_ASSERT_EQUAL(expected.height_px, core.height_px);
    TEST_ASSERT_EQUAL_MEMORY(&expected.bits[0].box, &core.bits[0].box, sizeof core.bits[0].box);
    TEST_ASSERT_EQUAL(1, core.bit_count);
    TEST_ASSERT_EQUAL(expected.bits[0].min_blob_px, core.bits[0].min_blob_px);
    TEST_ASSERT_EQUAL(expected.bits[0].vote.max_frames, core.bits[0].vote.max_frames);
    TEST_ASSERT_EQUAL_INT64(expected.bits[0].vote.window_us, core.bits[0].vote.window_us);
    TEST_ASSERT_EQUAL_MEMORY(&expected.table, &core.table, sizeof core.table);
    TEST_ASSERT_EQUAL_INT64(expected.frame_timeout_us, core.frame_timeout_us);
    TEST_ASSERT_EQUAL(expected.duty_cap_pct, core.duty_cap_pct);
}

static void test_every_default_is_in_its_own_range(void)
{
    static char text[16384], again_text[16384];
    struct app_config again = {0};
    const size_t length = config_print(&config, true, text, sizeof text);
    TEST_ASSERT_EQUAL(strlen(text), length);
    TEST_ASSERT_TRUE_MESSAGE(config_parse(&again, "printed", text, error), error);
    (void)config_print(&again, true, again_text, sizeof again_text);
    TEST_ASSERT_EQUAL_STRING(text, again_text);
}

static void test_values_comments_and_quotes(void)
{
    TEST_ASSERT_TRUE_MESSAGE(parse("# a robot\n\n robot_id=7 # seven\r\nbehavior = \"orbit\"\n"
                                   "camera = /dev/camera#2 # front\ni2c_burst = true\nsign_fl = 1\n"
                                   "lcm_url = \"\"  # silent\nio_tsv = \"a # b\""),
                             error);
    TEST_ASSERT_EQUAL(7, config.robot_id);
    TEST_ASSERT_EQUAL_STRING("orbit", config.behavior);
    TEST_ASSERT_EQUAL_STRING("/dev/camera#2", config.camera);
    TEST_ASSERT_TRUE(config.i2c_burst);
    TEST_ASSERT_EQUAL(1, config.sign[FW_FRONT_LEFT]);
    TEST_ASSERT_EQUAL_STRING("", config.lcm_url);
    TEST_ASSERT_EQUAL_STRING("a # b", config.io_tsv);
}

static void test_core_gets_what_was_set(void)
{
    struct fw_config core;
    TEST_ASSERT_TRUE(
        parse("behavior = orbit\nvote_frames = 64\nvote_window_ms = 150\n"
              "frame_timeout_ms = 100\nduty_cap_pct = 60\nu_max = 100\n"));
    TEST_ASSERT_EQUAL(FW_OK, config_core(&config, &core));
    TEST_ASSERT_EQUAL(64, core.bits[0].vote.max_frames);
    TEST_ASSERT_EQUAL_INT64(150000, core.bits[0].vote.window_us);
    TEST_ASSERT_EQUAL_INT64(100000, core.frame_timeout_us);
    TEST_ASSERT_EQUAL(60, core.duty_cap_pct);
    TEST_ASSERT_EQUAL(100, core.bits[0].box.u_max);
    TEST_ASSERT_EQUAL_MEMORY(&fw_behavior_find("orbit")->table, &core.table, sizeof core.table);
    TEST_ASSERT_TRUE(parse("behavior = found_3\ntable = \"-7,1.25,80,0\"\n"));
    TEST_ASSERT_EQUAL(FW_OK, config_core(&config, &core));
    TEST_ASSERT_EQUAL(-7, core.table.rows[0].speed_input_pct);
    TEST_ASSERT_EQUAL(1250, core.table.rows[0].turn_input_milli);
    TEST_ASSERT_TRUE(parse("table = 1,2,3\n"));
    TEST_ASSERT_EQUAL(FW_ERR_INPUT_RANGE, config_core(&config, &core));
    TEST_ASSERT_TRUE(parse("behavior = orbit\ntable = \"\"\n"));
    TEST_ASSERT_TRUE(parse("u_min = 101\n"));
    TEST_ASSERT_EQUAL(FW_ERR_BOX, config_core(&config, &core));
}

static void test_a_configuration_by_which_no_wheel_turns_is_remarked(void)
{
    TEST_ASSERT_NULL(config_remark(&config));
    TEST_ASSERT_TRUE(parse("sign_fl = 0\nsign_fr = 0\nsign_rl = 0\n"));
    TEST_ASSERT_NULL(config_remark(&config));
    TEST_ASSERT_TRUE(parse("sign_rr = 0\n"));
    TEST_ASSERT_EQUAL_STRING("all signs = 0", config_remark(&config));
    TEST_ASSERT_TRUE(parse("sign_rr = -1\nduty_cap_pct = 1\n"));
    TEST_ASSERT_NULL(config_remark(&config));
    TEST_ASSERT_TRUE(parse("duty_cap_pct = 0\n"));
    TEST_ASSERT_EQUAL_STRING("duty_cap_pct = 0", config_remark(&config));
}

// Without keys of their own bits are those of the keys before there were several.
static void test_bits_are_the_usual_one_but_for_what_they_state(void)
{
    struct fw_config core;
    TEST_ASSERT_TRUE_MESSAGE(parse("vote_frames = 5\nbit1 = left\n"
                                   "bit2 = \"right,40,235,0,124,165,255,20,3\"\n"
                                   "table = 1,0,2,0,3,0,4,0\n"),
                             error);
    TEST_ASSERT_EQUAL(FW_OK, config_core(&config, &core));
    TEST_ASSERT_EQUAL(2, core.bit_count);
    TEST_ASSERT_EQUAL(FW_SECTOR_LEFT, core.bits[0].sector);
    TEST_ASSERT_EQUAL(5, core.bits[0].vote.max_frames);
    TEST_ASSERT_EQUAL(300, core.bits[0].min_blob_px);
    TEST_ASSERT_EQUAL(FW_SECTOR_RIGHT, core.bits[1].sector);
    TEST_ASSERT_EQUAL(165, core.bits[1].box.v_min);
    TEST_ASSERT_EQUAL(20, core.bits[1].min_blob_px);
    TEST_ASSERT_EQUAL(3, core.bits[1].vote.max_frames);
    TEST_ASSERT_EQUAL(4, core.table.rows[3].speed_input_pct);
    const char *const wrong[] = {"bit2 = \"\"\n", "bit2 = middle\n", "bit2 = \"\"\nbit3 = all\n",
                                 "bit1 = \"\"\nbit2 = all\n"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; ++i)
    {
        TEST_ASSERT_TRUE(parse(wrong[i]));
        TEST_ASSERT_EQUAL_MESSAGE(FW_ERR_BITS, config_core(&config, &core), wrong[i]);
    }
}

static void test_mistakes_name_file_line_key_and_what_is_allowed(void)
{
    TEST_ASSERT_FALSE(parse("robot_id = 3\nrobot_id = 100\n"));
    TEST_ASSERT_EQUAL_STRING("robot.conf, line 2: robot_id: '100': must be a whole number in 0..99",
                             error);
    TEST_ASSERT_EQUAL(3, config.robot_id);
    const char *const mistakes[] = {"speed = 3",        "robot_id",
                                    "robot_id =",       "robot_id = 1.5",
                                    "robot_id = 1 2",   "robot_id = 0x1",
                                    "autostart = yes",  "camera = \"/dev/video0",
                                    "camera = \"a\" b", "= 3",
                                    "camera = a\tb\"c", "robot_id = 99999999999999999999"};
    for (size_t i = 0; i < sizeof mistakes / sizeof mistakes[0]; ++i)
    {
        TEST_ASSERT_FALSE_MESSAGE(parse(mistakes[i]), mistakes[i]);
        TEST_ASSERT_NOT_NULL(strstr(error, "robot.conf, line 1: "));
    }
}

static void test_long_lines_and_texts_are_refused(void)
{
    char text[400] = "camera = ";
    memset(text + 9, 'x', 300);
    TEST_ASSERT_FALSE(parse(text));
    text[9 + CONFIG_TEXT_MAX] = '\0';
    TEST_ASSERT_FALSE(parse(text));
    text[9 + CONFIG_TEXT_MAX - 1] = '\0';
    TEST_ASSERT_TRUE(parse(text));
}

// Whatever the bytes: it returns, a failure has a sentence, and a success still prints and reads.
static void test_any_bytes_are_read_or_refused(void)
{
    static const char alphabet[] = "=\n\r \t\"#\\robt_id0129-camer\x01\xFF";
    uint32_t random = 7;
    for (int round = 0; round < 20000; ++round)
    {
        char text[64];
        const size_t length = random_next(&random) % sizeof text;
        for (size_t i = 0; i < length; ++i)
        {
            text[i] = alphabet[random_next(&random) % (sizeof alphabet - 1)];
        }
        text[length == sizeof text ? length - 1 : length] = '\0';
        error[0] = '\0';
        TEST_ASSERT_TRUE(parse(text) || error[0] != '\0');
    }
}

// A log in a temporary file, and its text.

static char log_path[] = "/tmp/test_config.XXXXXX";

static void open_log(struct whole_file *log)
{
    strcpy(log_path, "/tmp/test_config.XXXXXX");
    const int fd = mkstemp(log_path);
    TEST_ASSERT_TRUE(fd >= 0 && close(fd) == 0 && io_tsv_open(log, log_path, 10));
}

static const char *close_log(struct whole_file *log)
{
    static char text[4096];
    whole_file_close(log);
    FILE *file = fopen(log_path, "r");
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    unlink(log_path);
    return text;
}

// The authors' header and their milling, (100, 90, -0.5) when seen: left, clockwise negative.
static void test_io_tsv_speaks_the_authors_language(void)
{
    struct link_report report = {.utime_us = 1700000000123456};
    struct whole_file log = {.fd = -1};
    report.out.detected_raw = 1;
    report.out.speed_input_pct = 100;
    report.out.turn_input_milli = 500;
    open_log(&log);
    io_tsv_add(&log, &report);
    report.out.detected = 1;
    report.out.speed_input_pct = -50;
    report.out.turn_input_milli = 0;
    io_tsv_add(&log, &report);
    TEST_ASSERT_EQUAL_STRING(
        "time_ns\tdetected [0, 1]\tsmoothed_detected [0, 1] (10)\tmoves [(v, d, w), ...]\n"
        "1700000000123456000\t1\t0\t[(100, 90, -0.5)]\n"
        "1700000000123456000\t1\t1\t[(50, 270, 0)]\n",
        close_log(&log));
}

// A file that may not grow takes a part of a row, as a full disk does: the part is taken back.
static void test_io_tsv_loses_whole_rows_and_counts_them(void)
{
    struct link_report report = {.utime_us = 1700000000123456};
    struct whole_file log = {.fd = -1};
    struct rlimit limit, none;
    signal(SIGXFSZ, SIG_IGN);
    TEST_ASSERT_EQUAL(0, getrlimit(RLIMIT_FSIZE, &none));
    open_log(&log);
    limit = none;
    limit.rlim_cur = 150;
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_FSIZE, &limit));
    for (int i = 0; i < 10; ++i)
    {
        io_tsv_add(&log, &report);
    }
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_FSIZE, &none));
    TEST_ASSERT_TRUE(log.is_failing);
    const uint32_t lost_count = log.lost_count;
    io_tsv_add(&log, &report);
    TEST_ASSERT_EQUAL(lost_count, log.lost_count);
    uint32_t rows = 0;
    for (char *rest = (char *)(intptr_t)close_log(&log), *row; (row = strsep(&rest, "\n")) != NULL;)
    {
        rows += strncmp(row, "1700000000123456000\t0\t0\t[(0, 90, 0)]", 40) == 0;
        TEST_ASSERT_TRUE(row[0] == '1' || row[0] == 't' || row[0] == '\0');
    }
    TEST_ASSERT_EQUAL(11, rows + lost_count);
    TEST_ASSERT_GREATER_THAN(1, rows);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_defaults_are_the_cores);
    RUN_TEST(test_every_default_is_in_its_own_range);
    RUN_TEST(test_values_comments_and_quotes);
    RUN_TEST(test_core_gets_what_was_set);
    RUN_TEST(test_a_configuration_by_which_no_wheel_turns_is_remarked);
    RUN_TEST(test_bits_are_the_usual_one_but_for_what_they_state);
    RUN_TEST(test_mistakes_name_file_line_key_and_what_is_allowed);
    RUN_TEST(test_long_lines_and_texts_are_refused);
    RUN_TEST(test_any_bytes_are_read_or_refused);
    RUN_TEST(test_io_tsv_speaks_the_authors_language);
    RUN_TEST(test_io_tsv_loses_whole_rows_and_counts_them);
    return UNITY_END();
}
