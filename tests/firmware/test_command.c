// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/command.c
#include "fw/command.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

// Fixture

#define NOW_US INT64_C(1700000000000000)
#define SESSION INT64_C(77)
#define SESSION_US INT64_C(60000000)

static const struct fw_command_filter fresh = {.session = SESSION};

// A command as its operator signs it just now.
static struct fw_command order(enum fw_verb verb, int64_t counter, int32_t seq)
{
    return (struct fw_command){.utime_us = NOW_US,
                               .seq = seq,
                               .verb = (int8_t)verb,
                               .seal = FW_SEAL_GOOD,
                               .session = SESSION,
                               .made_us = SESSION_US,
                               .counter = counter};
}

static enum fw_verdict judge(const struct fw_command_filter *filter,
                             const struct fw_command *command)
{
    return fw_command_judge(filter, command, NOW_US, SESSION_US, false);
}

static enum fw_verdict judge_start(int64_t ahead_us)
{
    struct fw_command start = order(FW_VERB_START, 1, 1);
    start.start_utime_us = NOW_US + ahead_us;
    return judge(&fresh, &start);
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
    const struct fw_command_filter filters[] = {
        {0}, fresh, {.session = SESSION, .counter = INT64_MAX, .latched = true}};
    for (size_t i = 0; i < sizeof filters / sizeof filters[0]; ++i)
    {
        for (int8_t seal = FW_SEAL_NONE; seal <= FW_SEAL_NO_KEY; ++seal)
        {
            const struct fw_command stop = {
                .utime_us = INT64_MIN, .seq = -1, .verb = FW_VERB_STOP, .seal = seal};
            TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, judge(&filters[i], &stop));
        }
    }
}

static void test_nothing_but_a_stop_is_obeyed_without_the_right_signature(void)
{
    static const struct
    {
        enum fw_seal seal;
        enum fw_verdict verdict;
    } cases[] = {{FW_SEAL_NONE, FW_VERDICT_UNSIGNED},
                 {FW_SEAL_WRONG, FW_VERDICT_FORGED},
                 {FW_SEAL_NO_KEY, FW_VERDICT_NO_KEY},
                 {(enum fw_seal)9, FW_VERDICT_UNSIGNED}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i)
    {
        for (int verb = FW_VERB_START; verb <= FW_VERB_HOLD; ++verb)
        {
            struct fw_command command = order((enum fw_verb)verb, 1, 1);
            command.seal = (int8_t)cases[i].seal;
            TEST_ASSERT_EQUAL(cases[i].verdict, judge(&fresh, &command));
        }
    }
}

static void test_command_of_another_session_is_refused(void)
{
    struct fw_command start = order(FW_VERB_START, 1, 1);
    start.session = SESSION + 1;
    TEST_ASSERT_EQUAL(FW_VERDICT_SESSION, judge(&fresh, &start));
    // A robot without a session obeys none, not even one that names none.
    const struct fw_command_filter none = {0};
    start.session = 0;
    TEST_ASSERT_EQUAL(FW_VERDICT_SESSION, judge(&none, &start));
}

static void test_command_is_void_after_3_s(void)
{
    struct fw_command start = order(FW_VERB_START, 1, 1);
    start.made_us = SESSION_US - 3000000;
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, judge(&fresh, &start));
    --start.made_us;
    TEST_ASSERT_EQUAL(FW_VERDICT_EXPIRED, judge(&fresh, &start));
    start.made_us = SESSION_US + 1000001;
    TEST_ASSERT_EQUAL(FW_VERDICT_EXPIRED, judge(&fresh, &start));
    start.made_us = INT64_MIN;
    TEST_ASSERT_EQUAL(FW_VERDICT_EXPIRED, judge(&fresh, &start));
    start.made_us = INT64_MAX;
    TEST_ASSERT_EQUAL(FW_VERDICT_EXPIRED, judge(&fresh, &start));
}

static void test_copy_is_known_by_counter_number_and_verb(void)
{
    struct fw_command_filter filter = fresh;
    const struct fw_command start = order(FW_VERB_START, 8, 5);
    fw_command_obeyed(&filter, &start, SESSION_US);
    TEST_ASSERT_EQUAL(FW_VERDICT_COPY, judge(&filter, &start));
    const struct fw_command other_number = order(FW_VERB_START, 8, 6);
    const struct fw_command other_verb = order(FW_VERB_SELECT, 8, 5);
    const struct fw_command older = order(FW_VERB_START, 7, 5);
    TEST_ASSERT_EQUAL(FW_VERDICT_OLD, judge(&filter, &other_number));
    TEST_ASSERT_EQUAL(FW_VERDICT_OLD, judge(&filter, &other_verb));
    TEST_ASSERT_EQUAL(FW_VERDICT_OLD, judge(&filter, &older));
    const struct fw_command newer = order(FW_VERB_START, 9, 6);
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, judge(&filter, &newer));
    // A copy is known for longer than it would be obeyed.
    struct fw_command late = start;
    late.made_us = SESSION_US - 5000000;
    TEST_ASSERT_EQUAL(FW_VERDICT_COPY, judge(&filter, &late));
}

static void test_stop_holds_until_armed(void)
{
    struct fw_command_filter filter = fresh;
    const struct fw_command start = order(FW_VERB_START, 1, 1);
    const struct fw_command stop = {.verb = FW_VERB_STOP};
    fw_command_obeyed(&filter, &start, SESSION_US);
    fw_command_obeyed(&filter, &stop, SESSION_US - 1);
    struct fw_command again = order(FW_VERB_START, 2, 2);
    TEST_ASSERT_EQUAL(FW_VERDICT_LATCHED, judge(&filter, &start));  // the copy, too
    TEST_ASSERT_EQUAL(FW_VERDICT_LATCHED, judge(&filter, &again));
    again.verb = FW_VERB_SCRIPT;
    TEST_ASSERT_EQUAL(FW_VERDICT_LATCHED, judge(&filter, &again));
    const struct fw_command arm = order(FW_VERB_ARM, 3, 3);
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, judge(&filter, &arm));
    fw_command_obeyed(&filter, &arm, SESSION_US);
    TEST_ASSERT_EQUAL(FW_VERDICT_OLD, judge(&filter, &again));
    again = order(FW_VERB_START, 4, 4);
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, judge(&filter, &again));
}

// Somebody may keep an operator's commands back, and let them through after the stop.
static void test_arming_that_was_said_before_the_stop_does_not_undo_it(void)
{
    struct fw_command_filter filter = fresh;
    const struct fw_command stop = {.verb = FW_VERB_STOP};
    struct fw_command arm = order(FW_VERB_ARM, 1, 1);
    arm.made_us = SESSION_US - 100000;
    fw_command_obeyed(&filter, &stop, SESSION_US - 50000);
    TEST_ASSERT_EQUAL(FW_VERDICT_EXPIRED, judge(&filter, &arm));
    arm.made_us = SESSION_US - 40000;
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, judge(&filter, &arm));
}

// It says only that the operator is there, in whatever order it comes.
static void test_word_that_the_operator_is_there_has_no_order(void)
{
    struct fw_command_filter filter = {.session = SESSION, .counter = 100};
    const struct fw_command hold = order(FW_VERB_HOLD, 0, 0);
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY, judge(&filter, &hold));
    fw_command_obeyed(&filter, &hold, SESSION_US);
    TEST_ASSERT_EQUAL_INT64(100, filter.counter);
}

static void test_script_is_for_robots_that_stand(void)
{
    const struct fw_command script = order(FW_VERB_SCRIPT, 1, 1);
    TEST_ASSERT_EQUAL(FW_VERDICT_RUNNING,
                      fw_command_judge(&fresh, &script, NOW_US, SESSION_US, true));
    TEST_ASSERT_EQUAL(FW_VERDICT_OBEY,
                      fw_command_judge(&fresh, &script, NOW_US, SESSION_US, false));
}

static void test_unknown_verb_is_refused(void)
{
    struct fw_command command = order(FW_VERB_START, 1, 1);
    command.verb = FW_VERB_HOLD + 1;
    TEST_ASSERT_EQUAL(FW_VERDICT_UNKNOWN, judge(&fresh, &command));
    command.verb = -1;
    TEST_ASSERT_EQUAL(FW_VERDICT_UNKNOWN, judge(&fresh, &command));
}

static void test_every_refusal_has_words_and_nothing_else_has(void)
{
    for (int verdict = FW_VERDICT_OBEY; verdict <= FW_VERDICT_LATCHED; ++verdict)
    {
        const bool refuses = verdict > FW_VERDICT_COPY;
        TEST_ASSERT_EQUAL(refuses, fw_verdict_str((enum fw_verdict)verdict)[0] != '\0');
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_start_is_obeyed_from_2_s_late_to_600_s_ahead);
    RUN_TEST(test_stop_is_always_obeyed);
    RUN_TEST(test_nothing_but_a_stop_is_obeyed_without_the_right_signature);
    RUN_TEST(test_command_of_another_session_is_refused);
    RUN_TEST(test_command_is_void_after_3_s);
    RUN_TEST(test_copy_is_known_by_counter_number_and_verb);
    RUN_TEST(test_stop_holds_until_armed);
    RUN_TEST(test_arming_that_was_said_before_the_stop_does_not_undo_it);
    RUN_TEST(test_word_that_the_operator_is_there_has_no_order);
    RUN_TEST(test_script_is_for_robots_that_stand);
    RUN_TEST(test_unknown_verb_is_refused);
    RUN_TEST(test_every_refusal_has_words_and_nothing_else_has);
    return UNITY_END();
}
