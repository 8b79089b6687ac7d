// SPDX-License-Identifier: Apache-2.0
// Any bytes from the motor board's serial line: a voltage is believed only from a whole frame.
// The linker's --wrap=read gives the driver these bytes instead of the line's.
#include <errno.h>
#include <unistd.h>

#include "fuzz.h"
#include "hal_linux/clock_linux.h"
#include "hal_linux/motors_uart.h"
#include "uart_frame.h"

static struct bytes line;
static int line_fd = -1;

ssize_t __real_read(int fd, void *bytes, size_t count);
ssize_t __wrap_read(int fd, void *bytes, size_t count);

// At most 64 bytes at a time, as from a line.
ssize_t __wrap_read(int fd, void *bytes, size_t count)
{
    if (fd != line_fd)
    {
        return __real_read(fd, bytes, count);
    }
    if (line.left == 0)
    {
        errno = EAGAIN;
        return -1;
    }
    const size_t most = count < line.left ? count : line.left;
    const size_t given = most < 64 ? most : 64;
    memcpy(bytes, line.next, given);
    line.next += given;
    line.left -= given;
    return (ssize_t)given;
}

// Some frame that reports this voltage is among the bytes.
static int was_sent(const uint8_t *data, size_t size, int32_t pack_mV)
{
    for (size_t i = 0; i + 8 <= size; ++i)
    {
        const uint8_t *frame = data + i;
        if (memcmp(frame, "\xAA\x55\0\3\4", 5) == 0 && frame[5] + 256 * frame[6] == pack_mV &&
            frame[7] == uart_frame_crc(frame + 2, 5))
        {
            return 1;
        }
    }
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    // A pseudo-terminal: the driver wants to set its speed.
    const struct motors_uart_config config = {.path = "/dev/ptmx", .sign = {-1, 1, -1, 1}};
    const struct hal_clock clock = clock_linux();
    struct motors_uart board;
    const struct hal_motors motors = motors_uart_make(&board, &config, &clock);
    const struct hal_battery battery = motors_uart_battery(&board);
    // The first read opens the line, on which nobody speaks yet.
    int32_t nothing_mV = -1;
    CLAIM(hal_battery_read(&battery, &nothing_mV) == FW_ERR_TIMEOUT);
    line_fd = board.fd;
    line = (struct bytes){data, size};
    while (line.left > 0)
    {
        int32_t pack_mV = -1;
        const size_t left = line.left;
        if (hal_battery_read(&battery, &pack_mV) == FW_OK)
        {
            CLAIM(was_sent(data, size, pack_mV));
        }
        CLAIM(line.left < left);
    }
    line_fd = -1;
    hal_motors_close(&motors);
    return 0;
}
