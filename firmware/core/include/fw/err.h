// SPDX-License-Identifier: Apache-2.0
// The error codes of the whole firmware; every function that can fail returns one.
#ifndef FW_ERR_H
#define FW_ERR_H

#ifdef __cplusplus
extern "C" {
#endif

#define FW_MUST_CHECK __attribute__((warn_unused_result))

enum fw_err
{
    FW_OK = 0,
    // Configuration of the core.
    FW_ERR_FRAME_SIZE,
    FW_ERR_BOX,
    FW_ERR_MIN_BLOB,
    FW_ERR_VOTE,
    FW_ERR_INPUT_RANGE,
    FW_ERR_FRAME_TIMEOUT,
    FW_ERR_DUTY_CAP,
    FW_ERR_BITS,
    // Devices, which only the hardware layer touches.
    FW_ERR_NO_DEVICE,
    FW_ERR_FORMAT,
    FW_ERR_IO,
    FW_ERR_TIMEOUT,
    FW_ERR_NOT_ZERO,
    FW_ERR_FROZEN,
    FW_ERR_END,
};

// Says what went wrong and what is allowed, as the end of a sentence. Never NULL.
const char *fw_err_str(enum fw_err err);

#ifdef __cplusplus
}
#endif

#endif
