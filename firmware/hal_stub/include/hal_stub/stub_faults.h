// SPDX-License-Identifier: Apache-2.0
// Counts the calls that stub devices answer, and makes chosen ones fail.
#ifndef HAL_STUB_STUB_FAULTS_H
#define HAL_STUB_STUB_FAULTS_H

#include <stdint.h>

#include "fw/err.h"

// Shared by the devices of one robot; all zero: nothing fails.
struct stub_faults
{
    // Calls so far.
    int32_t call_count;
    // The failing calls, counted from 1, and with what they fail.
    int32_t fails_at, fails_count;
    enum fw_err err;
};

// Counts one call. @param faults NULL: never fails. @return FW_OK, or what the call fails with.
enum fw_err FW_MUST_CHECK stub_faults_next(struct stub_faults *faults);

#endif
