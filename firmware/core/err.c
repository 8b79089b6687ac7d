// SPDX-License-Identifier: Apache-2.0
#include "fw/err.h"

const char *fw_err_str(enum fw_err err)
{
    // No default: a new code without a text does not compile.
    switch (err)
    {
        case FW_OK: return "ok";
        case FW_ERR_FRAME_SIZE:
            return "frame size out of range: width even in 2..1280 px, height in 1..1024 px";
        case FW_ERR_BOX: return "colour box is empty: each of y, u and v needs min <= max";
        case FW_ERR_MIN_BLOB: return "smallest blob out of range: at least 0 px";
        case FW_ERR_VOTE: return "vote out of range: 1 to 64 frames, window above 0 us";
        case FW_ERR_INPUT_RANGE:
            return "input out of range: speed input in -100..100, turn input in -2..2";
        case FW_ERR_FRAME_TIMEOUT: return "frame time-out out of range: above 0 us";
        case FW_ERR_DUTY_CAP: return "duty cap out of range: 0 to 100 percent";
        case FW_ERR_BITS:
            return "bits out of range: 1 to 4, and 2 rows for 1, 4 for 2, 8 for 3, 16 for 4";
        case FW_ERR_NO_DEVICE: return "no such device";
        case FW_ERR_FORMAT: return "device has not the format asked for";
        case FW_ERR_IO: return "device did not take or give the data";
        case FW_ERR_TIMEOUT: return "device did not answer in time";
        case FW_ERR_NOT_ZERO: return "the board says that it turns its wheels after a stop";
        case FW_ERR_FROZEN:
            return "one and the same picture, bit for bit: it is frozen, or covered";
        case FW_ERR_END: return "nothing more to come";
    }
    return "unknown error";
}
