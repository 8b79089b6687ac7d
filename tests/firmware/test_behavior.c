// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/behavior.c
#include <string.h>

#include "fw/behavior.h"
#include "fw/mixing.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

// Fixture

// The authors' programs as published: (speed, direction in degrees, turn positive clockwise).
struct vendor_input
{
    int speed_pct, direction_deg, turn_milli;
};
struct vendor_behavior
{
    const char *name;
    struct vendor_input seen, unseen;
};
static const struct vendor_behavior published[] = {
    {"milling", {100, 90, -500}, {100, 90, 500}},
    {"milling_delay", {100, 90, 0}, {100, 90, -500}},
    {"milling_cmaes", {95, 90, 200}, {95, 90, -900}},
    {"diffusing", {50, 270, 0}, {0, 270, 2000}},
    {"diffusing_v2", {100, 90, 0}, {0, 90, 500}},
    {"disperse", {100, 90, -2000}, {100, 90, 0}},
    {"follow_leader", {75, 90, 0}, {75, 90, -500}},
    {"orbit", {100, 90, 650}, {100, 90, -650}},
    {"shell", {100, 90, 0}, {100, 90, 500}},
};

static void assert_translated(struct vendor_input vendor, struct fw_input ours, const char *name)
{
    const int sign = vendor.direction_deg == 270 ? -1 : 1;
    TEST_ASSERT_EQUAL_INT_MESSAGE(sign * vendor.speed_pct, ours.speed_input_pct, name);
    TEST_ASSERT_EQUAL_INT_MESSAGE(-vendor.turn_milli, ours.turn_input_milli, name);
}

// Test

static void test_every_published_behavior_is_there_with_its_turn_negated(void)
{
    for (size_t i = 0; i < sizeof published / sizeof published[0]; ++i)
    {
        const struct fw_behavior *behavior = fw_behavior_find(published[i].name);
        TEST_ASSERT_NOT_NULL_MESSAGE(behavior, published[i].name);
        assert_translated(published[i].seen, behavior->table.rows[1], published[i].name);
        assert_translated(published[i].unseen, behavior->table.rows[0], published[i].name);
    }
}

// A differential drive's centre of turning sits still only if the mean of the sides is zero.
static void test_self_centering_spins_on_the_spot_against_its_circle(void)
{
    const struct fw_behavior *behavior = fw_behavior_find("self_centering");
    TEST_ASSERT_NOT_NULL(behavior);
    int8_t duty_pct[FW_WHEEL_COUNT];
    fw_mix(&behavior->table.rows[0], duty_pct);
    TEST_ASSERT_EQUAL_INT(0, duty_pct[FW_FRONT_LEFT] + duty_pct[FW_FRONT_RIGHT]);
    TEST_ASSERT_TRUE(behavior->table.rows[1].turn_input_milli > 0);
    TEST_ASSERT_TRUE(behavior->table.rows[0].turn_input_milli < 0);
    // 1.5 rad/s lies below the 1.66 rad/s measured at duty 37 and above the dead band at 26.
    TEST_ASSERT_INT_WITHIN(5, 32, duty_pct[FW_FRONT_LEFT]);
}

static void test_list_is_sorted_and_every_entry_is_found_and_in_range(void)
{
    TEST_ASSERT_NULL(fw_behavior_at(fw_behavior_count()));
    for (size_t i = 0; i < fw_behavior_count(); ++i)
    {
        const struct fw_behavior *behavior = fw_behavior_at(i);
        TEST_ASSERT_EQUAL_PTR(behavior, fw_behavior_find(behavior->name));
        TEST_ASSERT_EQUAL_INT(FW_OK, fw_table_check(&behavior->table));
        if (i > 0)
        {
            TEST_ASSERT_TRUE(strcmp(fw_behavior_at(i - 1)->name, behavior->name) < 0);
        }
    }
}

static void test_find_knows_no_prefix_and_no_other_case(void)
{
    TEST_ASSERT_NULL(fw_behavior_find("mill"));
    TEST_ASSERT_NULL(fw_behavior_find("Milling"));
    TEST_ASSERT_NULL(fw_behavior_find(""));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_every_published_behavior_is_there_with_its_turn_negated);
    RUN_TEST(test_self_centering_spins_on_the_spot_against_its_circle);
    RUN_TEST(test_list_is_sorted_and_every_entry_is_found_and_in_range);
    RUN_TEST(test_find_knows_no_prefix_and_no_other_case);
    return UNITY_END();
}
