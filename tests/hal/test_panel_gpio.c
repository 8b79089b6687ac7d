// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/hal_linux/panel_gpio.c and gpio_line_v1.c; line numbers are those of the kit.
#include "hal_linux/panel_gpio.h"

#include "fake_gpiod_v1.h"
#include "unity.h"

// Fixture

static struct panel_gpio driver;
static struct hal_panel panel;

static void make(const char *chip)
{
    const struct panel_gpio_config config = {.chip = chip, .offset = {13, 16, 26, 6}};
    panel = panel_gpio_make(&driver, &config, &hal_sys_kernel);
}

void setUp(void)
{
    memset(fake_lines, 0, sizeof fake_lines);
    fake_chip.open_count = 0;
    fake_busy = NULL;
    fake_gone = false;
    make("/dev/gpiochip0");
}

void tearDown(void)
{
    hal_panel_close(&panel);
    TEST_ASSERT_EQUAL(0, fake_chip.open_count);
}

static bool pressed(void)
{
    bool now = false;
    TEST_ASSERT_EQUAL(FW_OK, hal_panel_read_button(&panel, &now));
    return now;
}

static void show(bool detected, bool running, bool buzzer)
{
    const struct hal_lights lights = {detected, running, buzzer};
    TEST_ASSERT_EQUAL(FW_OK, hal_panel_show(&panel, &lights));
}

// Test

static void test_button_is_pulled_up_and_low_while_pressed(void)
{
    TEST_ASSERT_FALSE(pressed());
    TEST_ASSERT_EQUAL(GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP, fake_lines[13].flags);
    fake_lines[13].value = 0;
    TEST_ASSERT_TRUE(pressed());
}

static void test_each_light_has_its_line(void)
{
    show(true, false, false);
    TEST_ASSERT_EQUAL(1, fake_lines[16].value);
    TEST_ASSERT_EQUAL(0, fake_lines[26].value + fake_lines[6].value);
    show(false, true, true);
    TEST_ASSERT_EQUAL(0, fake_lines[16].value);
    TEST_ASSERT_EQUAL(2, fake_lines[26].value + fake_lines[6].value);
}

static void test_close_switches_all_off(void)
{
    show(true, true, true);
    hal_panel_close(&panel);
    TEST_ASSERT_EQUAL(0, fake_lines[16].value + fake_lines[26].value + fake_lines[6].value);
    TEST_ASSERT_FALSE(fake_lines[6].requested);
}

static void test_absent_chip_and_busy_line_are_errors_that_pass(void)
{
    bool now;
    make("/dev/gpiochip7");
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_panel_read_button(&panel, &now));
    make("/dev/gpiochip0");
    fake_busy = &fake_lines[6];
    TEST_ASSERT_EQUAL(FW_ERR_IO, hal_panel_read_button(&panel, &now));
    TEST_ASSERT_EQUAL(0, fake_chip.open_count);
    fake_busy = NULL;
    TEST_ASSERT_FALSE(pressed());
}

static void test_chip_that_vanishes_is_opened_again(void)
{
    show(true, true, false);
    fake_gone = true;
    const struct hal_lights lights = {0};
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_panel_show(&panel, &lights));
    TEST_ASSERT_EQUAL(0, fake_chip.open_count);
    fake_gone = false;
    show(true, false, false);
    TEST_ASSERT_EQUAL(1, fake_lines[16].value);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_button_is_pulled_up_and_low_while_pressed);
    RUN_TEST(test_each_light_has_its_line);
    RUN_TEST(test_close_switches_all_off);
    RUN_TEST(test_absent_chip_and_busy_line_are_errors_that_pass);
    RUN_TEST(test_chip_that_vanishes_is_opened_again);
    return UNITY_END();
}
