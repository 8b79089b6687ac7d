// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/vote.c
#include "fw/vote.h"
#include "support.h"
#include "unity.h"

static struct fw_vote vote;

void setUp(void)
{
    fw_vote_clear(&vote);
}
void tearDown(void) {}

// Fixture

#define SEQUENCE 400

// The definition, from the whole history.
static bool majority(const struct fw_vote_config *config, const bool *bit, const int64_t *utime_us,
                     int newest)
{
    int ones = 0, count = 0;
    for (int i = newest; i >= 0 && newest - i < config->max_frames &&
                         utime_us[newest] - utime_us[i] < config->window_us;
         --i)
    {
        ones += bit[i];
        ++count;
    }
    return 2 * ones > count;
}

// Test

static void test_nothing_seen_yet_is_no(void)
{
    TEST_ASSERT_FALSE(fw_vote_result(&vote));
}

static void test_default_needs_six_of_ten(void)
{
    const struct fw_vote_config config = fw_vote_config_default();
    for (int i = 0; i < 10; ++i)
    {
        fw_vote_push(&vote, &config, false, i);
    }
    for (int i = 10; i < 15; ++i)
    {
        fw_vote_push(&vote, &config, true, i);
        TEST_ASSERT_FALSE(fw_vote_result(&vote));
    }
    fw_vote_push(&vote, &config, true, 15);
    TEST_ASSERT_TRUE(fw_vote_result(&vote));
}

static void test_first_frames_are_a_shorter_list(void)
{
    const struct fw_vote_config config = fw_vote_config_default();
    fw_vote_push(&vote, &config, true, 0);
    TEST_ASSERT_TRUE(fw_vote_result(&vote));
    fw_vote_push(&vote, &config, false, 1);
    TEST_ASSERT_FALSE(fw_vote_result(&vote));
    fw_vote_push(&vote, &config, true, 2);
    TEST_ASSERT_TRUE(fw_vote_result(&vote));
}

static void test_one_frame_is_no_vote_at_all(void)
{
    const struct fw_vote_config config = {.max_frames = 1, .window_us = INT64_MAX};
    for (int i = 0; i < 20; ++i)
    {
        fw_vote_push(&vote, &config, i % 3 == 0, i);
        TEST_ASSERT_EQUAL(i % 3 == 0, fw_vote_result(&vote));
    }
}

static void test_frame_as_old_as_the_window_no_longer_counts(void)
{
    const struct fw_vote_config config = {.max_frames = FW_VOTE_MAX_FRAMES, .window_us = 100};
    fw_vote_push(&vote, &config, true, 0);
    fw_vote_push(&vote, &config, false, 99);
    TEST_ASSERT_EQUAL_INT(2, vote.count);
    fw_vote_push(&vote, &config, false, 100);
    TEST_ASSERT_EQUAL_INT(2, vote.count);
    TEST_ASSERT_EQUAL_INT(0, vote.ones);
}

static void test_random_sequences_agree_with_the_definition(void)
{
    static bool bit[SEQUENCE];
    static int64_t utime_us[SEQUENCE];
    uint32_t state = 3;
    for (int trial = 0; trial < 300; ++trial)
    {
        fw_vote_clear(&vote);
        const struct fw_vote_config config = {
            .max_frames = 1 + (int32_t)(random_next(&state) % FW_VOTE_MAX_FRAMES),
            .window_us = trial % 2 == 0 ? INT64_MAX : 1 + random_next(&state) % 2000};
        for (int i = 0; i < SEQUENCE; ++i)
        {
            bit[i] = random_next(&state) % 2;
            utime_us[i] = (i > 0 ? utime_us[i - 1] : 0) + 1 + random_next(&state) % 60;
            fw_vote_push(&vote, &config, bit[i], utime_us[i]);
            TEST_ASSERT_EQUAL(majority(&config, bit, utime_us, i), fw_vote_result(&vote));
        }
    }
}

static void test_check_takes_the_ends_of_the_range_and_nothing_beyond(void)
{
    struct fw_vote_config config = {.max_frames = 1, .window_us = 1};
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_vote_check(&config));
    config.max_frames = FW_VOTE_MAX_FRAMES;
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_vote_check(&config));
    config.max_frames = FW_VOTE_MAX_FRAMES + 1;
    TEST_ASSERT_EQUAL_INT(FW_ERR_VOTE, fw_vote_check(&config));
    config.max_frames = 0;
    TEST_ASSERT_EQUAL_INT(FW_ERR_VOTE, fw_vote_check(&config));
    config = (struct fw_vote_config){.max_frames = 1, .window_us = 0};
    TEST_ASSERT_EQUAL_INT(FW_ERR_VOTE, fw_vote_check(&config));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_nothing_seen_yet_is_no);
    RUN_TEST(test_default_needs_six_of_ten);
    RUN_TEST(test_first_frames_are_a_shorter_list);
    RUN_TEST(test_one_frame_is_no_vote_at_all);
    RUN_TEST(test_frame_as_old_as_the_window_no_longer_counts);
    RUN_TEST(test_random_sequences_agree_with_the_definition);
    RUN_TEST(test_check_takes_the_ends_of_the_range_and_nothing_beyond);
    return UNITY_END();
}
