// SPDX-License-Identifier: Apache-2.0
// Decides on, or copies, one frame from a file so many times: for an emulator that counts what is
// executed. Usage: count FRAME decide|copy COUNT
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "decision.h"

int main(int argc, char **argv)
{
    static uint8_t frame[BENCH_FRAME_BYTES];
    FILE *file = argc == 4 ? fopen(argv[1], "rb") : NULL;
    if (file == NULL || fread(frame, 1, sizeof frame, file) != sizeof frame)
    {
        (void)fprintf(stderr, "count: give a file with a frame, decide or copy, and how often\n");
        return 2;
    }
    (void)fclose(file);
    const int count = atoi(argv[3]);
    int seen = 0;
    if (strcmp(argv[2], "copy") == 0)
    {
        return bench_copy_ns(frame, 1, count) < 0;
    }
    return bench_decide_ns(frame, 1, count, &seen) < 0;
}
