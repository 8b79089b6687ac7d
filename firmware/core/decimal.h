// SPDX-License-Identifier: Apache-2.0
// Decimal text to integers, so that no number depends on a machine's floating point.
#ifndef FW_DECIMAL_H
#define FW_DECIMAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Reads all of the text as a number such as -12, 0.5, .5 or 1e-3, times 10 to the power `places`,
// rounded to the nearest integer, halves away from zero.
// @param places [0, 6]
// @return false, and value untouched, if the text is no number or its result is beyond 1e15.
bool fw_decimal_parse(const char *text, size_t length, int places, int64_t *value);

// Reads numbers between commas. @param places of the first, the third and so on; of the others.
// @return how many; 0, if the text is anything else or holds more than `most`.
int fw_decimal_list(const char *text, const int places[2], int64_t *values, int most);

// value / 10^places, rounded like above. @param places [0, 18]
int64_t fw_decimal_round(int64_t value, int places);

#endif
