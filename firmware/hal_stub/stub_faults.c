// SPDX-License-Identifier: Apache-2.0
#include "hal_stub/stub_faults.h"

#include <stddef.h>

enum fw_err stub_faults_next(struct stub_faults *faults)
{
    if (faults == NULL)
    {
        return FW_OK;
    }
    ++faults->call_count;
    const int32_t past = faults->call_count - faults->fails_at;
    return past >= 0 && past < faults->fails_count ? faults->err : FW_OK;
}
