// SPDX-License-Identifier: Apache-2.0
// Any text as a configuration: refused in words, or read; what was read is printed and read back.
#include "config.h"
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static char text[16384], again[16384];
    struct app_config config, copy;
    char error[CONFIG_ERROR_MAX] = "";
    char *given = malloc(size + 1);
    CLAIM(given != NULL);
    memcpy(given, data, size);
    given[size] = '\0';
    config_default(&config);
    if (config_parse(&config, "robot.conf", given, error))
    {
        config_default(&copy);
        CLAIM(config_print(&config, true, text, sizeof text) > 0);
        CLAIM(config_parse(&copy, "printed", text, error));
        (void)config_print(&copy, true, again, sizeof again);
        CLAIM(strcmp(text, again) == 0);
        struct fw_config core;
        (void)!config_core(&config, &core);
    }
    else
    {
        CLAIM(strncmp(error, "robot.conf, line ", strlen("robot.conf, line ")) == 0);
    }
    free(given);
    return 0;
}
