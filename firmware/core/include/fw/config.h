// SPDX-License-Identifier: Apache-2.0
// All that can be set about one robot's decisions.
#ifndef FW_CONFIG_H
#define FW_CONFIG_H

#include <stdint.h>

#include "fw/bit.h"
#include "fw/err.h"
#include "fw/table.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fw_config
{
    // Size of every frame: at most FW_MAX_WIDTH_PX by FW_MAX_HEIGHT_PX, the width even.
    int32_t width_px, height_px;
    // What is looked for in each picture. [1, FW_MAX_BITS]
    int32_t bit_count;
    struct fw_bit bits[FW_MAX_BITS];
    // Of at most as many bits.
    struct fw_table table;
    // Older frames are forgotten, and without a frame the motors stop. > 0
    int64_t frame_timeout_us;
    // Largest duty of any wheel. [0, 100]
    int32_t duty_cap_pct;
};

// 640x480, one bit as fw_bit_default() has it, milling, 200 ms, no cap.
struct fw_config fw_config_default(void);

// @return FW_OK, or the code of an entry that is out of range.
enum fw_err FW_MUST_CHECK fw_config_check(const struct fw_config *config);

#ifdef __cplusplus
}
#endif

#endif
