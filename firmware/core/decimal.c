// SPDX-License-Identifier: Apache-2.0
#include "decimal.h"

#include <string.h>

#define MAX_DIGITS 18
#define MAX_VALUE 1000000000000000
#define MAX_EXPONENT 1000

struct reader
{
    const char *next;
    const char *end;
};

static bool skip(struct reader *in, char wanted)
{
    const bool found = in->next < in->end && *in->next == wanted;
    in->next += found;
    return found;
}

static bool at_digit(const struct reader *in)
{
    return in->next < in->end && *in->next >= '0' && *in->next <= '9';
}

// mantissa * 10^exponent.
struct decimal
{
    int64_t mantissa;
    int exponent;
    int digit_count;
};

// Digits past the 18th leading ones are beyond any rounding that matters: only their place counts.
static void read_digits(struct reader *in, bool after_point, struct decimal *number)
{
    for (; at_digit(in); ++in->next)
    {
        const bool kept = number->mantissa < MAX_VALUE * 100;
        if (kept)
        {
            number->mantissa = number->mantissa * 10 + (*in->next - '0');
        }
        // A kept digit after the point, or a dropped one before it, moves the point.
        number->exponent += (kept ? 0 : 1) - (after_point ? 1 : 0);
        number->digit_count = 1;
    }
}

static bool read_exponent(struct reader *in, struct decimal *number)
{
    if (!skip(in, 'e') && !skip(in, 'E'))
    {
        return true;
    }
    const bool negative = skip(in, '-');
    if (!negative)
    {
        skip(in, '+');
    }
    int exponent = 0;
    const char *begin = in->next;
    for (; at_digit(in); ++in->next)
    {
        exponent = exponent < MAX_EXPONENT ? exponent * 10 + (*in->next - '0') : exponent;
    }
    number->exponent += negative ? -exponent : exponent;
    return in->next > begin;
}

int64_t fw_decimal_round(int64_t value, int places)
{
    int64_t divisor = 1;
    for (int i = 0; i < places; ++i)
    {
        divisor *= 10;
    }
    const int64_t rest = value % divisor;
    const int64_t away = value < 0 ? -1 : 1;
    return value / divisor + (rest * away >= divisor - rest * away ? away : 0);
}

static bool scale(const struct decimal *number, int places, int64_t *value)
{
    int64_t scaled = number->mantissa;
    int shift = number->exponent + places;
    for (; shift > 0 && scaled != 0; --shift)
    {
        if (scaled > MAX_VALUE)
        {
            return false;
        }
        scaled *= 10;
    }
    if (shift < 0)
    {
        scaled = -shift <= MAX_DIGITS ? fw_decimal_round(scaled, -shift) : 0;
    }
    *value = scaled;
    return scaled <= MAX_VALUE;
}

bool fw_decimal_parse(const char *text, size_t length, int places, int64_t *value)
{
    struct reader in = {text, text + length};
    struct decimal number = {0};
    const bool negative = skip(&in, '-');
    read_digits(&in, false, &number);
    if (skip(&in, '.'))
    {
        read_digits(&in, true, &number);
    }
    int64_t scaled = 0;
    if (number.digit_count == 0 || !read_exponent(&in, &number) || in.next != in.end ||
        !scale(&number, places, &scaled))
    {
        return false;
    }
    *value = negative ? -scaled : scaled;
    return true;
}

int fw_decimal_list(const char *text, const int places[2], int64_t *values, int most)
{
    for (int count = 0; count < most; ++count)
    {
        const size_t length = strcspn(text, ",");
        if (!fw_decimal_parse(text, length, places[count % 2], &values[count]))
        {
            return 0;
        }
        text += length;
        if (*text++ == '\0')
        {
            return count + 1;
        }
    }
    return 0;
}
