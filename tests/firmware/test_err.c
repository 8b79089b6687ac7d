// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/err.c
#include <string.h>

#include "fw/err.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

// Test

static void test_every_code_has_its_own_text(void)
{
    for (int a = FW_OK; a <= FW_ERR_END; ++a)
    {
        TEST_ASSERT_TRUE(strcmp(fw_err_str((enum fw_err)a), "unknown error") != 0);
        for (int b = FW_OK; b < a; ++b)
        {
            TEST_ASSERT_TRUE(strcmp(fw_err_str((enum fw_err)a), fw_err_str((enum fw_err)b)) != 0);
        }
    }
}

static void test_number_that_is_no_code_still_has_a_text(void)
{
    TEST_ASSERT_EQUAL_STRING("unknown error", fw_err_str((enum fw_err)(FW_ERR_END + 1)));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_code_has_its_own_text);
    RUN_TEST(test_number_that_is_no_code_still_has_a_text);
    return UNITY_END();
}
