// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/hal_linux/motors_uart.c and uart_frame.c, on a pseudo-terminal.
#include "hal_linux/motors_uart.h"

#include <fcntl.h>
#include <poll.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include "hal_linux/clock_linux.h"
#include "uart_frame.h"
#include "unity.h"

// Fixture: the test holds the board's end of the line.

static int board_fd;
static struct motors_uart driver;
static struct hal_motors motors;
static struct hal_battery battery;
// How often the line still has bytes to send when it is asked: a pseudo terminal never has.
static int asked_while_sending;

int __real_ioctl(int fd, unsigned long request, ...);
int __wrap_ioctl(int fd, unsigned long request, ...);

int __wrap_ioctl(int fd, unsigned long request, ...)
{
    va_list arguments;
    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    if (request == TIOCOUTQ && asked_while_sending > 0)
    {
        --asked_while_sending;
        *(int *)argument = 27;
        return 0;
    }
    return __real_ioctl(fd, request, argument);
}

void setUp(void)
{
    asked_while_sending = 0;
    board_fd = posix_openpt(O_RDWR | O_NOCTTY);
    TEST_ASSERT_TRUE(board_fd >= 0 && grantpt(board_fd) == 0 && unlockpt(board_fd) == 0);
    static char path[64];
    strcpy(path, ptsname(board_fd));
    const struct motors_uart_config config = {
        .path = path, .retry_us = 10000, .sign = {-1, 1, -1, 1}, .must_be_heard = true};
    const struct hal_clock clock = clock_linux();
    motors = motors_uart_make(&driver, &config, &clock);
    battery = motors_uart_battery(&driver);
}

void tearDown(void)
{
    hal_motors_close(&motors);
    if (board_fd >= 0)
    {
        close(board_fd);
    }
}

static void board_sends(const uint8_t *bytes, size_t count)
{
    TEST_ASSERT_EQUAL(count, write(board_fd, bytes, count));
}

// Reads until the battery is known: the line's two ends are joined by the kernel, in its own time.
static enum fw_err read_battery(int32_t *pack_mV)
{
    enum fw_err err = FW_ERR_TIMEOUT;
    for (int tries = 0; tries < 100 && err == FW_ERR_TIMEOUT; ++tries)
    {
        usleep(1000);
        err = hal_battery_read(&battery, pack_mV);
    }
    return err;
}

// Test

// The check value of CRC-8/MAXIM-DOW in the catalogue of parametrised CRC algorithms is 0xA1.
static void test_crc_has_its_published_check_value(void)
{
    TEST_ASSERT_EQUAL_HEX8(0xA1, uart_frame_crc((const uint8_t *)"123456789", 9));
}

// 10, 20, -30 and 100 percent with the left wheels negated, as IEEE 754 single precision.
static void test_duties_are_one_frame_of_floats(void)
{
    static const uint8_t expected[] = {
        0xAA, 0x55, 0x03, 0x16, 0x05, 0x04,  //
        0x00, 0x00, 0x00, 0x20, 0xC1,        // 0: -10
        0x01, 0x00, 0x00, 0xA0, 0x41,        // 1: 20
        0x02, 0x00, 0x00, 0xF0, 0x41,        // 2: 30
        0x03, 0x00, 0x00, 0xC8, 0x42,        // 3: 100
    };
    const int8_t duties_pct[FW_WHEEL_COUNT] = {10, 20, -30, 100};
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_write(&motors, duties_pct));
    uint8_t got[64];
    TEST_ASSERT_EQUAL(sizeof expected + 1, read(board_fd, got, sizeof got));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(expected, got, sizeof expected);
    TEST_ASSERT_EQUAL_HEX8(uart_frame_crc(expected + 2, sizeof expected - 2), got[sizeof expected]);
}

// Bytes that a terminal would change or swallow must arrive as they are.
static void test_line_is_raw_and_fast(void)
{
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_stop(&motors));
    struct termios line;
    TEST_ASSERT_EQUAL(0, tcgetattr(driver.fd, &line));
    TEST_ASSERT_EQUAL(0, line.c_lflag & (ICANON | ECHO | ISIG));
    TEST_ASSERT_EQUAL(0, line.c_oflag & OPOST);
    if (cfgetospeed(&line) == B0)
    {
        TEST_IGNORE_MESSAGE(
            "the speed is not kept here: emulation of user programs does not know it");
    }
    TEST_ASSERT_EQUAL(B1000000, cfgetospeed(&line));
}

static void test_battery_is_unknown_until_the_board_reports_it(void)
{
    int32_t pack_mV = -1;
    TEST_ASSERT_EQUAL(FW_ERR_TIMEOUT, hal_battery_read(&battery, &pack_mV));
    TEST_ASSERT_EQUAL(-1, pack_mV);
    // 7708 mV behind noise, half a header, a frame with a wrong CRC and a key's frame.
    uint8_t frame[16];
    board_sends((const uint8_t *)"\x00\xAA\xAA\x55\x00\x03\x04\xFF\xFF\x00", 10);
    board_sends(frame, uart_frame_make(6, (const uint8_t *)"\x01\x20", 2, frame));
    const size_t count = uart_frame_make(0, (const uint8_t *)"\x04\x1C\x1E", 3, frame);
    board_sends(frame, 5);
    board_sends(frame + 5, count - 5);
    TEST_ASSERT_EQUAL(FW_OK, read_battery(&pack_mV));
    TEST_ASSERT_EQUAL(7708, pack_mV);
}

static void test_board_that_falls_silent_is_gone(void)
{
    uint8_t frame[16];
    int32_t pack_mV = 0;
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_open(&motors));
    board_sends(frame, uart_frame_make(0, (const uint8_t *)"\x04\x1C\x1E", 3, frame));
    TEST_ASSERT_EQUAL(FW_OK, read_battery(&pack_mV));
    driver.heard_us -= 3000000;
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_battery_read(&battery, &pack_mV));
    board_sends(frame, uart_frame_make(0, (const uint8_t *)"\x04\x1C\x1E", 3, frame));
    int tries = 0;
    while (hal_battery_read(&battery, &pack_mV) != FW_OK && ++tries < 100)
    {
        usleep(1000);
    }
    TEST_ASSERT_LESS_THAN(100, tries);
    driver.heard_us -= 3000000;
    driver.config.must_be_heard = false;
    TEST_ASSERT_EQUAL(FW_OK, hal_battery_read(&battery, &pack_mV));
}

static void test_endless_noise_neither_blocks_nor_fools(void)
{
    uint8_t noise[1024];
    memset(noise, 0xAA, sizeof noise);
    board_sends(noise, sizeof noise);
    int32_t pack_mV = -1;
    for (int i = 0; i < 50; ++i)
    {
        TEST_ASSERT_EQUAL(FW_ERR_TIMEOUT, hal_battery_read(&battery, &pack_mV));
    }
}

// The line's two ends are joined by the kernel, in its own time.
static enum fw_err confirm_soon(void)
{
    enum fw_err err = FW_ERR_TIMEOUT;
    for (int tries = 0; tries < 100 && err == FW_ERR_TIMEOUT; ++tries)
    {
        usleep(1000);
        err = hal_motors_confirm(&motors);
    }
    return err;
}

// The board answers nothing: a stop counts while the board is heard. An echo is no board.
static void test_stop_is_confirmed_while_the_board_is_heard(void)
{
    uint8_t frame[64];
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_stop(&motors));
    TEST_ASSERT_EQUAL(FW_ERR_TIMEOUT, hal_motors_confirm(&motors));
    const ssize_t echo = read(board_fd, frame, sizeof frame);
    TEST_ASSERT_GREATER_THAN(0, echo);
    board_sends(frame, (size_t)echo);
    TEST_ASSERT_EQUAL(FW_ERR_TIMEOUT, confirm_soon());
    board_sends(frame, uart_frame_make(7, (const uint8_t *)"\x01\x02", 2, frame));
    TEST_ASSERT_EQUAL(FW_OK, confirm_soon());
    driver.heard_us -= 3000000;
    TEST_ASSERT_EQUAL(FW_ERR_TIMEOUT, hal_motors_confirm(&motors));
    driver.config.must_be_heard = false;
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_confirm(&motors));
}

// A serial line sends 27 bytes in 270 us, one on USB later: who asks at once is too early.
static void test_stop_is_confirmed_when_it_has_left(void)
{
    uint8_t frame[64];
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_stop(&motors));
    board_sends(frame, uart_frame_make(7, (const uint8_t *)"\x01\x02", 2, frame));
    TEST_ASSERT_EQUAL(FW_OK, confirm_soon());
    asked_while_sending = 4;
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_confirm(&motors));
    TEST_ASSERT_EQUAL(0, asked_while_sending);
    asked_while_sending = 1000000;
    TEST_ASSERT_EQUAL(FW_ERR_TIMEOUT, hal_motors_confirm(&motors));
}

// The rest of a frame whose writer was killed is missing: the board takes it from the next one.
static void test_stop_arrives_after_a_part_of_a_frame(void)
{
    uint8_t bytes[128];
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_open(&motors));
    TEST_ASSERT_EQUAL(10, write(driver.fd, "\xAA\x55\x03\x16\x05\x04\0\0\0\xC8", 10));
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_stop(&motors));
    size_t count = 0, at = 0, whole = 0;
    for (struct pollfd line = {.fd = board_fd, .events = POLLIN};
         count < 10 + 2 * 27 && poll(&line, 1, 1000) > 0;)
    {
        const ssize_t more = read(board_fd, bytes + count, sizeof bytes - count);
        TEST_ASSERT_GREATER_THAN(0, more);
        count += (size_t)more;
    }
    while (at + UART_FRAME_HEADER < count)
    {
        // A board that knows no better than to skip a frame whose check is wrong.
        const size_t size = UART_FRAME_OVERHEAD + (size_t)bytes[at + 3];
        const bool is_frame = bytes[at] == 0xAA && bytes[at + 1] == 0x55;
        whole += is_frame && uart_frame_check(bytes + at, count - at, 64) == UART_FRAME_WHOLE;
        at += is_frame ? size : 1;
    }
    TEST_ASSERT_GREATER_THAN(0, whole);
}

static void test_probe_believes_a_frame_and_nothing_else(void)
{
    uint8_t frame[16];
    board_sends((const uint8_t *)"\xAA\x55 hello", 8);
    TEST_ASSERT_EQUAL(FW_ERR_TIMEOUT, motors_uart_probe(&driver));
    board_sends(frame, uart_frame_make(0, (const uint8_t *)"\x04\x1C\x1E", 3, frame));
    TEST_ASSERT_EQUAL(FW_OK, motors_uart_probe(&driver));
}

static void test_line_that_vanishes_is_an_error(void)
{
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_stop(&motors));
    close(board_fd);
    board_fd = -1;
    TEST_ASSERT_NOT_EQUAL(FW_OK, hal_motors_stop(&motors));
    TEST_ASSERT_NOT_EQUAL(FW_OK, hal_motors_stop(&motors));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_crc_has_its_published_check_value);
    RUN_TEST(test_duties_are_one_frame_of_floats);
    RUN_TEST(test_line_is_raw_and_fast);
    RUN_TEST(test_battery_is_unknown_until_the_board_reports_it);
    RUN_TEST(test_board_that_falls_silent_is_gone);
    RUN_TEST(test_endless_noise_neither_blocks_nor_fools);
    RUN_TEST(test_stop_is_confirmed_while_the_board_is_heard);
    RUN_TEST(test_stop_is_confirmed_when_it_has_left);
    RUN_TEST(test_stop_arrives_after_a_part_of_a_frame);
    RUN_TEST(test_probe_believes_a_frame_and_nothing_else);
    RUN_TEST(test_line_that_vanishes_is_an_error);
    return UNITY_END();
}
