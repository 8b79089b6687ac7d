// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/command.c
#include "fw/command.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

// Fixture

#define NOW_US INT64_C(1700000000000000)

static struct fw_command order(enum fw_verb verb, int64_t utime_us, int32_t seq)
{
    return (struct fw_command){.utime_us = utime_us, .seq = seq, .verb = (int8_t)verb};
}

static enum fw_verdict judge_start(int64_t ahead_us)
{
    const struct fw_inbox empty = {0};
    struct fw_command start = order(FW_VERB_START, NOW_US, 1);
    start.start_utime_us = NOW_US + ahead_us;
    return fw_command_judge(&empty, &start, NOW_US, false);
}

// Test

// The protocol's words: more than 2 s late or 600 s ahead is refused.
static void test_start_is_obeyed_from_2_s_late_to_600_s_ahead(void)
{
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, judge_start(-2000000));
    TEST_ASSERT_EQUAL(FW_VERDICT_CLOCK, judge_start(-2000001));
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, judge_start(600000000));
    TEST_ASSERT_EQUAL(FW_VERDICT_CLOCK, judge_start(600000001));
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, judge_start(-NOW_US));
    TEST_ASSERT_EQUAL(FW_VERDICT_CLOCK, judge_start(INT64_MAX - NOW_US));
    TEST_ASSERT_EQUAL(FW_VERDICT_CLOCK, judge_start(INT64_MIN + 1));
}

static void test_stop_is_always_obeyed(void)
{
    const struct fw_inbox inbox = {.obeyed_utime_us = NOW_US, .obeyed_seq = 5};
    for (int64_t age_us = -1000000; age_us <= 1000000; age_us += 500000)
    {
        const struct fw_command stop = order(FW_VERB_STOP, NOW_US - age_us, 5);
        TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, fw_command_judge(&inbox, &stop, NOW_US, true));
    }
}

static void test_copy_is_known_by_stamp_and_number(void)
{
    const struct fw_inbox inbox = {.obeyed_utime_us = NOW_US, .obeyed_seq = 5};
    const struct fw_command copy = order(FW_VERB_START, NOW_US, 5);
    const struct fw_command other = order(FW_VERB_START, NOW_US, 6);
    const struct fw_command old = order(FW_VERB_START, NOW_US - 1, 5);
    TEST_ASSERT_EQUAL(FW_VERDICT_COPY, fw_command_judge(&inbox, &copy, NOW_US, true));
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, fw_command_judge(&inbox, &other, NOW_US, true));
    TEST_ASSERT_EQUAL(FW_VERDICT_OLD, fw_command_judge(&inbox, &old, NOW_US, true));
}

static void test_late_stop_does_not_let_older_starts_in(void)
{
    struct fw_inbox inbox = {.obeyed_utime_us = NOW_US, .obeyed_seq = 5};
    const struct fw_command stop = order(FW_VERB_STOP, NOW_US - 10, 4);
    fw_command_obeyed(&inbox, &stop);
    const struct fw_command start = order(FW_VERB_START, NOW_US - 5, 3);
    TEST_ASSERT_EQUAL(FW_VERDICT_OLD, fw_command_judge(&inbox, &start, NOW_US, false));
}

static void test_script_is_refused_while_running_and_unknown_verbs_always(void)
{
    const struct fw_inbox empty = {0};
    const struct fw_command script = order(FW_VERB_SCRIPT, NOW_US, 1);
    TEST_ASSERT_EQUAL(FW_VERDICT_RUNNING, fw_command_judge(&empty, &script, NOW_US, true));
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, fw_command_judge(&empty, &script, NOW_US, false));
    for (int verb = -128; verb <= 127; ++verb)
    {
        const struct fw_command any = {.utime_us = NOW_US, .seq = 1, .verb = (int8_t)verb};
        TEST_ASSERT_EQUAL(verb < 0 || verb > 3,
                          fw_command_judge(&empty, &any, NOW_US, false) == FW_VERDICT_UNKNOWN);
    }
}

static void test_every_refusal_has_a_reason(void)
{
    for (int verdict = FW_VERDICT_OBEY; verdict <= FW_VERDICT_RUNNING; ++verdict)
    {
        TEST_ASSERT_EQUAL(verdict > FW_VERDICT_COPY, fw_verdict_str(verdict)[0] != '\0');
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_start_is_obeyed_from_2_s_late_to_600_s_ahead);
    RUN_TEST(test_stop_is_always_obeyed);
    RUN_TEST(test_copy_is_known_by_stamp_and_number);
    RUN_TEST(test_late_stop_does_not_let_older_starts_in);
    RUN_TEST(test_script_is_refused_while_running_and_unknown_verbs_always);
    RUN_TEST(test_every_refusal_has_a_reason);
    return UNITY_END();
}
