// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/hal_linux/motors_i2c.c and board_probe.c. Registers, order and signs are those
// of the vendor's Board.py: motor 1..4 at 31..34, 1 and 3 negated.
#include "hal_linux/motors_i2c.h"

#include <errno.h>
#include <linux/i2c-dev.h>
#include <string.h>

#include "hal_linux/board_probe.h"
#include "hal_stub/stub_clock.h"
#include "unity.h"

// Fixture: a bus with one board of 256 registers, whose address follows the first byte of a write.

static struct
{
    bool present;
    int open_count, transfer_count;
    // Transfers until this many are refused.
    int refused_count;
    int64_t cost_us;
    uint8_t address, chosen, registers[256];
    bool auto_increment;
} bus;

static struct stub_clock hand;
static struct motors_i2c driver;
static struct hal_motors motors;

static int bus_open(const char *path, int flags)
{
    (void)path;
    (void)flags;
    if (!bus.present)
    {
        errno = ENOENT;
        return -1;
    }
    ++bus.open_count;
    return 3;
}

static int bus_close(int fd)
{
    bus.open_count -= fd == 3;
    return 0;
}

static int bus_ioctl(int fd, unsigned long request, void *argument)
{
    (void)fd;
    if (request == I2C_SLAVE)
    {
        bus.address = (uint8_t)(uintptr_t)argument;
    }
    return 0;
}

static bool refused(void)
{
    ++bus.transfer_count;
    hand.monotonic_us += bus.cost_us;
    if (bus.address == 0x7A && bus.refused_count-- <= 0)
    {
        bus.refused_count = 0;
        return false;
    }
    errno = ENXIO;
    return true;
}

static ssize_t bus_write(int fd, const void *bytes, size_t count)
{
    (void)fd;
    if (refused())
    {
        return -1;
    }
    const uint8_t *data = bytes;
    bus.chosen = data[0];
    for (size_t i = 1; i < count; ++i)
    {
        bus.registers[bus.chosen + (bus.auto_increment ? i - 1 : 0)] = data[i];
    }
    return (ssize_t)count;
}

static ssize_t bus_read(int fd, void *bytes, size_t count)
{
    (void)fd;
    if (refused())
    {
        return -1;
    }
    memcpy(bytes, bus.registers + bus.chosen, count);
    return (ssize_t)count;
}

static const struct hal_sys bus_sys = {
    .open = bus_open, .close = bus_close, .ioctl = bus_ioctl, .read = bus_read, .write = bus_write};

static struct motors_i2c_config config(void)
{
    return (struct motors_i2c_config){
        .path = "/dev/i2c-1", .retry_us = 10000, .reads_back = true, .sign = {-1, 1, -1, 1}};
}

static void make(struct motors_i2c_config wanted)
{
    const struct hal_clock clock = stub_clock_make(&hand);
    motors = motors_i2c_make(&driver, &wanted, &clock, &bus_sys);
}

void setUp(void)
{
    memset(&bus, 0, sizeof bus);
    memset(&hand, 0, sizeof hand);
    bus.present = true;
    bus.cost_us = 300;
    make(config());
}

void tearDown(void)
{
    hal_motors_close(&motors);
    TEST_ASSERT_EQUAL(0, bus.open_count);
}

static const int8_t duties_pct[FW_WHEEL_COUNT] = {10, 20, -30, 100};
static const uint8_t wire_bytes[FW_WHEEL_COUNT] = {(uint8_t)-10, 20, 30, 100};

// Test

static void test_single_writes_reach_each_motor_with_its_sign(void)
{
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_write(&motors, duties_pct));
    TEST_ASSERT_EQUAL_HEX8(0x7A, bus.address);
    TEST_ASSERT_EQUAL_HEX8_ARRAY(wire_bytes, bus.registers + 31, 4);
    TEST_ASSERT_EQUAL(4, bus.transfer_count);
}

static void test_burst_writes_the_same_in_one_transfer(void)
{
    struct motors_i2c_config burst = config();
    burst.burst = true;
    make(burst);
    bus.auto_increment = true;
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_write(&motors, duties_pct));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(wire_bytes, bus.registers + 31, 4);
    TEST_ASSERT_EQUAL(1, bus.transfer_count);
}

static void test_signs_are_configurable(void)
{
    struct motors_i2c_config raw = config();
    memcpy(raw.sign, (const int8_t[4]){1, 1, 1, -1}, 4);
    make(raw);
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_write(&motors, duties_pct));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[4]){10, 20, (uint8_t)-30, (uint8_t)-100}),
                                 bus.registers + 31, 4);
}

static void test_refused_transfer_is_tried_again(void)
{
    bus.refused_count = 3;
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_write(&motors, duties_pct));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(wire_bytes, bus.registers + 31, 4);
}

// The promise is about time, not about a number of tries: one transfer more than retry_us.
static void test_tries_end_in_time_whatever_a_transfer_takes(void)
{
    for (int64_t cost_us = 100; cost_us <= 30000; cost_us *= 3)
    {
        bus.cost_us = cost_us;
        bus.refused_count = 1000000;
        const int64_t begin_us = hand.monotonic_us;
        TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_motors_write(&motors, duties_pct));
        TEST_ASSERT_LESS_OR_EQUAL_INT64(10000 + cost_us, hand.monotonic_us - begin_us);
    }
}

static void test_stop_reaches_the_wheels_after_a_refusing_one(void)
{
    memset(bus.registers + 31, 50, 4);
    struct motors_i2c_config hasty = config();
    hasty.retry_us = 0;
    make(hasty);
    // Without retries the first wheel's zero is refused; the others' are not.
    bus.refused_count = 1;
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_motors_stop(&motors));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(((const uint8_t[4]){50, 0, 0, 0}), bus.registers + 31, 4);
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_stop(&motors));
    TEST_ASSERT_EACH_EQUAL_HEX8(0, bus.registers + 31, 4);
}

static void test_bus_that_vanished_is_opened_again(void)
{
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_write(&motors, duties_pct));
    bus.refused_count = 1000000;
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_motors_stop(&motors));
    bus.present = false;
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_motors_stop(&motors));
    bus.present = true;
    bus.refused_count = 0;
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_stop(&motors));
}

static void test_battery_is_two_bytes_after_a_transfer_that_chooses_it(void)
{
    const struct hal_battery battery = motors_i2c_battery(&driver);
    bus.chosen = 99;
    bus.registers[0] = 0x1C, bus.registers[1] = 0x1E;  // 7708
    int32_t pack_mV = 0;
    TEST_ASSERT_EQUAL(FW_OK, hal_battery_read(&battery, &pack_mV));
    TEST_ASSERT_EQUAL(7708, pack_mV);
    TEST_ASSERT_EQUAL(2, bus.transfer_count);
    bus.refused_count = 1000000;
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_battery_read(&battery, &pack_mV));
    TEST_ASSERT_EQUAL(7708, pack_mV);
}

// The registers are read back, each by itself; another program may choose its own in between.
static void test_stop_is_confirmed_by_the_registers(void)
{
    memset(bus.registers + 31, 50, 4);
    TEST_ASSERT_EQUAL(FW_ERR_NOT_ZERO, hal_motors_confirm(&motors));
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_stop(&motors));
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_confirm(&motors));
    for (int wheel = 0; wheel < FW_WHEEL_COUNT; ++wheel)
    {
        bus.registers[31 + wheel] = 1;
        TEST_ASSERT_EQUAL(FW_ERR_NOT_ZERO, hal_motors_confirm(&motors));
        bus.registers[31 + wheel] = 0;
    }
    bus.refused_count = 1000000;
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_motors_confirm(&motors));
}

static void test_board_whose_registers_cannot_be_read_confirms_by_taking(void)
{
    struct motors_i2c_config trusting = config();
    trusting.reads_back = false;
    make(trusting);
    memset(bus.registers + 31, 50, 4);
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_confirm(&motors));
    TEST_ASSERT_EQUAL(0, bus.transfer_count);
}

static void test_probe_tells_the_boards_apart_and_moves_nothing(void)
{
    struct motors_uart uart;
    struct hal_clock clock = stub_clock_make(&hand);
    struct motors_uart_config uart_config = {.path = "/dev/ptmx"};
    enum board_kind kind = BOARD_UART;
    memset(bus.registers, 50, sizeof bus.registers);

    (void)motors_uart_make(&uart, &uart_config, &clock);
    TEST_ASSERT_EQUAL(FW_OK, board_probe(&driver, &uart, &kind));
    TEST_ASSERT_EQUAL(BOARD_I2C, kind);
    TEST_ASSERT_EACH_EQUAL_HEX8(50, bus.registers, 256);

    // A line that opens and says nothing is no board: test_motors_uart.c has one that speaks.
    bus.refused_count = 1000000;
    hand.wait_us = 10000;
    const struct hal_motors uart_motors = motors_uart_make(&uart, &uart_config, &clock);
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, board_probe(&driver, &uart, &kind));
    TEST_ASSERT_EQUAL(BOARD_I2C, kind);
    hal_motors_close(&uart_motors);

    uart_config.path = "/nowhere";
    (void)motors_uart_make(&uart, &uart_config, &clock);
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, board_probe(&driver, &uart, &kind));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_single_writes_reach_each_motor_with_its_sign);
    RUN_TEST(test_burst_writes_the_same_in_one_transfer);
    RUN_TEST(test_signs_are_configurable);
    RUN_TEST(test_refused_transfer_is_tried_again);
    RUN_TEST(test_tries_end_in_time_whatever_a_transfer_takes);
    RUN_TEST(test_stop_reaches_the_wheels_after_a_refusing_one);
    RUN_TEST(test_bus_that_vanished_is_opened_again);
    RUN_TEST(test_battery_is_two_bytes_after_a_transfer_that_chooses_it);
    RUN_TEST(test_stop_is_confirmed_by_the_registers);
    RUN_TEST(test_board_whose_registers_cannot_be_read_confirms_by_taking);
    RUN_TEST(test_probe_tells_the_boards_apart_and_moves_nothing);
    return UNITY_END();
}
