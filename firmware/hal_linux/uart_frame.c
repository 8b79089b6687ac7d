// SPDX-License-Identifier: Apache-2.0
#include "uart_frame.h"

#include <string.h>

uint8_t uart_frame_crc(const uint8_t *bytes, size_t count)
{
    uint8_t crc = 0;
    for (size_t i = 0; i < count; ++i)
    {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; ++bit)
        {
            crc = (uint8_t)(crc & 1 ? (crc >> 1) ^ 0x8C : crc >> 1);
        }
    }
    return crc;
}

size_t uart_frame_make(uint8_t function, const uint8_t *data, uint8_t count, uint8_t *frame)
{
    const uint8_t header[UART_FRAME_HEADER] = {0xAA, 0x55, function, count};
    memcpy(frame, header, sizeof header);
    memcpy(frame + UART_FRAME_HEADER, data, count);
    frame[UART_FRAME_HEADER + count] = uart_frame_crc(frame + 2, 2 + (size_t)count);
    return UART_FRAME_OVERHEAD + (size_t)count;
}

enum uart_frame_state uart_frame_check(const uint8_t *bytes, size_t count, size_t capacity)
{
    if (bytes[0] != 0xAA || (count > 1 && bytes[1] != 0x55))
    {
        return UART_FRAME_BAD;
    }
    if (count < UART_FRAME_HEADER)
    {
        return UART_FRAME_PART;
    }
    const size_t needed = UART_FRAME_OVERHEAD + (size_t)bytes[3];
    if (needed > capacity)
    {
        return UART_FRAME_BAD;
    }
    if (count < needed)
    {
        return UART_FRAME_PART;
    }
    return uart_frame_crc(bytes + 2, needed - 3) == bytes[needed - 1] ? UART_FRAME_WHOLE
                                                                      : UART_FRAME_BAD;
}
