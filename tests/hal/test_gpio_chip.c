// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/hal_linux/gpio_chip.c. Labels and numbers are what gpiodetect shows on a Pi 4,
// and on a Pi 5 before and after Linux 6.6.45, which moved its header from gpiochip4 to gpiochip0.
#include "hal_linux/gpio_chip.h"

#include <errno.h>
#include <linux/gpio.h>
#include <stdio.h>
#include <string.h>

#include "unity.h"

#define CHIPS 16

// Fixture: chips by number, NULL where there is none.

static const char *labels[CHIPS];
static int refusal, open_count;
static char path[GPIO_CHIP_PATH_MAX];

static int fake_open(const char *name, int flags)
{
    int number;
    (void)flags;
    TEST_ASSERT_EQUAL(1, sscanf(name, "/dev/gpiochip%d", &number));
    if (number >= CHIPS || labels[number] == NULL || refusal != 0)
    {
        errno = number >= CHIPS || labels[number] == NULL ? ENOENT : refusal;
        return -1;
    }
    ++open_count;
    return 100 + number;
}

static int fake_close(int fd)
{
    (void)fd;
    --open_count;
    return 0;
}

static int fake_ioctl(int fd, unsigned long request, void *argument)
{
    struct gpiochip_info *info = argument;
    TEST_ASSERT_EQUAL(GPIO_GET_CHIPINFO_IOCTL, request);
    memcpy(info->label, labels[fd - 100], strnlen(labels[fd - 100], sizeof info->label));
    return 0;
}

static const struct hal_sys sys = {.open = fake_open, .close = fake_close, .ioctl = fake_ioctl};

void setUp(void)
{
    memset(labels, 0, sizeof labels);
    refusal = 0;
}

void tearDown(void)
{
    TEST_ASSERT_EQUAL(0, open_count);
}

static void expect(const char *wanted, const char *expected)
{
    TEST_ASSERT_EQUAL(FW_OK, gpio_chip_find(&sys, wanted, path));
    TEST_ASSERT_EQUAL_STRING(expected, path);
}

// Test

static void test_header_of_a_pi_4_is_found(void)
{
    labels[0] = "pinctrl-bcm2711";
    labels[1] = "raspberrypi-exp-gpio";
    expect("auto", "/dev/gpiochip0");
}

static void test_header_of_a_pi_5_is_found_wherever_the_kernel_puts_it(void)
{
    labels[0] = "gpio-brcmstb@107d508500";
    labels[4] = "pinctrl-rp1";
    expect("auto", "/dev/gpiochip4");
    memset(labels, 0, sizeof labels);
    labels[0] = "pinctrl-rp1";
    labels[10] = "gpio-brcmstb@107d508500";
    expect("auto", "/dev/gpiochip0");
}

static void test_any_chip_is_found_by_its_label(void)
{
    labels[0] = "pinctrl-bcm2711";
    labels[1] = "raspberrypi-exp-gpio";
    expect("raspberrypi-exp-gpio", "/dev/gpiochip1");
}

static void test_no_such_chip_and_no_permission_are_told_apart(void)
{
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, gpio_chip_find(&sys, "auto", path));
    labels[0] = "gpio-brcmstb@107d508500";
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, gpio_chip_find(&sys, "auto", path));
    refusal = EACCES;
    TEST_ASSERT_EQUAL(FW_ERR_IO, gpio_chip_find(&sys, "auto", path));
}

static void test_label_that_fills_its_field_is_no_overrun(void)
{
    labels[0] = "a label of thirty-two characters";
    TEST_ASSERT_EQUAL(32, strlen(labels[0]));
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, gpio_chip_find(&sys, labels[0], path));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_header_of_a_pi_4_is_found);
    RUN_TEST(test_header_of_a_pi_5_is_found_wherever_the_kernel_puts_it);
    RUN_TEST(test_any_chip_is_found_by_its_label);
    RUN_TEST(test_no_such_chip_and_no_permission_are_told_apart);
    RUN_TEST(test_label_that_fills_its_field_is_no_overrun);
    return UNITY_END();
}
