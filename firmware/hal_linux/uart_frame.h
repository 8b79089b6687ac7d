// SPDX-License-Identifier: Apache-2.0
// Frames of the Raspberry Pi 5 kit's board: AA 55, function, length, data, CRC.
#ifndef HAL_LINUX_UART_FRAME_H
#define HAL_LINUX_UART_FRAME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define UART_FRAME_OVERHEAD 5
#define UART_FRAME_HEADER 4

// CRC-8/MAXIM: polynomial x^8 + x^5 + x^4 + 1, reflected 0x8C, start 0.
uint8_t uart_frame_crc(const uint8_t *bytes, size_t count);

// Puts a frame together. @param frame has room for UART_FRAME_OVERHEAD + count bytes.
// @return bytes of the frame.
size_t uart_frame_make(uint8_t function, const uint8_t *data, uint8_t count, uint8_t *frame);

enum uart_frame_state
{
    // More bytes are needed.
    UART_FRAME_PART,
    // Byte 0 cannot begin a frame: drop it.
    UART_FRAME_BAD,
    UART_FRAME_WHOLE,
};

// Looks at what has arrived. @param count at least 1. @param capacity of the buffer: a longer frame
// is bad.
enum uart_frame_state uart_frame_check(const uint8_t *bytes, size_t count, size_t capacity);

#endif
