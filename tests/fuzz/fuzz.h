// SPDX-License-Identifier: Apache-2.0
// What the fuzzers share: taking numbers out of libFuzzer's bytes, and claims that end the program.
#ifndef TESTS_FUZZ_FUZZ_H
#define TESTS_FUZZ_FUZZ_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// libFuzzer calls this with bytes that it makes up; it must return 0.
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define CLAIM(truth)                                                                    \
    do                                                                                  \
    {                                                                                   \
        if (!(truth))                                                                   \
        {                                                                               \
            (void)fprintf(stderr, "%s:%d: not true: %s\n", __FILE__, __LINE__, #truth); \
            abort();                                                                    \
        }                                                                               \
    } while (0)

struct bytes
{
    const uint8_t *next;
    size_t left;
};

// The next count bytes, little-endian; those past the end are 0.
static inline uint64_t take(struct bytes *in, size_t count)
{
    uint64_t value = 0;
    for (size_t i = 0; i < count && in->left > 0; ++i)
    {
        value |= (uint64_t)*in->next++ << (8 * i);
        --in->left;
    }
    return value;
}

// Takes up to count bytes into a block of just their size, so that a read past it is seen.
// @return the block, which the caller frees. @param taken how many they are.
static inline uint8_t *take_block(struct bytes *in, size_t count, size_t *taken)
{
    *taken = count < in->left ? count : in->left;
    uint8_t *block = malloc(*taken > 0 ? *taken : 1);
    CLAIM(block != NULL);
    memcpy(block, in->next, *taken);
    in->next += *taken;
    in->left -= *taken;
    return block;
}

#endif
