// SPDX-License-Identifier: Apache-2.0
// Any bytes as a camera's Motion-JPEG picture: refused, or decoded into just the room that it has.
#include "fuzz.h"
#include "hal_linux/mjpg.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct bytes in = {data, size};
    const int width_px = 2 + 2 * (int)(take(&in, 1) % 64);
    const int height_px = 1 + (int)(take(&in, 1) % 64);
    size_t length;
    uint8_t *jpeg = take_block(&in, size, &length);
    uint8_t *yuyv = malloc(2 * (size_t)width_px * (size_t)height_px);
    CLAIM(yuyv != NULL);
    if (mjpg_to_yuyv(jpeg, length, width_px, height_px, yuyv) == FW_OK)
    {
        for (int i = 0; i < 2 * width_px * height_px; ++i)
        {
            // Studio range, and every byte was written.
            CLAIM(yuyv[i] >= 16 && yuyv[i] <= 240);
        }
    }
    free(yuyv);
    free(jpeg);
    return 0;
}
