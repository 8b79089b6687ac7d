// SPDX-License-Identifier: Apache-2.0
#include "config.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "config_keys.h"
#include "fw/behavior.h"

void config_default(struct app_config *config)
{
    const struct fw_config core = fw_config_default();
    const struct fw_bit bit = core.bits[0];
    *config = (struct app_config){
        .behavior = "milling",
        .behaviors = CONFIG_BEHAVIORS,
        .y_min = bit.box.y_min,
        .y_max = bit.box.y_max,
        .u_min = bit.box.u_min,
        .u_max = bit.box.u_max,
        .v_min = bit.box.v_min,
        .v_max = bit.box.v_max,
        .min_blob_px = bit.min_blob_px,
        .vote_frames = bit.vote.max_frames,
        .bits = {"all"},
        .frame_timeout_ms = (int32_t)(core.frame_timeout_us / 1000),
        .duty_cap_pct = core.duty_cap_pct,
        .camera = "/dev/video0",
        .width_px = core.width_px,
        .height_px = core.height_px,
        .rate_Hz = 30,
        .frozen_ms = 2000,
        .board = "auto",
        .i2c_device = "/dev/i2c-1",
        .uart_device = "/dev/ttyAMA0",
        .board_confirms = true,
        .board_retry_ms = 10,
        .sign = {-1, 1, -1, 1},
        // 3.45 V a cell, where the authors' robots switch themselves off.
        .battery_low_mV = 6900,
        .panel = "gpio",
        .gpio_chip = "auto",
        .button_line = 13,
        .detected_line = 16,
        .running_line = 26,
        .buzzer_line = 6,
        .script_dir = "/etc/turbopi/scripts",
        .lcm_url = "udpm://239.255.76.67:7667?ttl=0",
        .key_file = "/etc/turbopi/key",
        .run_dir = "/run/turbopi",
        .link_timeout_ms = 2000,
        .watchdog_ms = 300,
        .restart_ms = 1000,
    };
}

static const char *text_after(const char *text)
{
    return text + strlen(text) + 1;
}

static const struct config_key *find_key(const char *name)
{
    const char *of_key = config_texts;
    for (size_t i = 0; i < config_key_count; ++i)
    {
        if (strcmp(of_key, name) == 0)
        {
            return &config_keys[i];
        }
        of_key = text_after(text_after(of_key));
    }
    return NULL;
}

static bool set_integer(const struct config_key *key, const char *name, const char *value,
                        int32_t *field, char *error)
{
    char *end;
    errno = 0;
    const long number = strtol(value, &end, 10);
    if (errno != 0 || end == value || *end != '\0' || number < key->min || number > key->max)
    {
        (void)snprintf(error, CONFIG_ERROR_MAX,
                       "%s: '%s': must be a whole number in %" PRId32 "..%" PRId32, name, value,
                       key->min, key->max);
        return false;
    }
    *field = (int32_t)number;
    return true;
}

static bool set_bool(const char *name, const char *value, bool *field, char *error)
{
    if (strcmp(value, "true") != 0 && strcmp(value, "false") != 0)
    {
        (void)snprintf(error, CONFIG_ERROR_MAX, "%s: '%s': must be true or false", name, value);
        return false;
    }
    *field = strcmp(value, "true") == 0;
    return true;
}

// Texts that a TOML string could not hold as they are, are refused.
static bool set_text(const char *name, const char *value, char *field, char *error)
{
    for (const char *c = value; *c != '\0'; ++c)
    {
        if ((unsigned char)*c < ' ' || *c == '"' || *c == '\\')
        {
            (void)snprintf(error, CONFIG_ERROR_MAX,
                           "%s: must hold no quote, backslash or control character", name);
            return false;
        }
    }
    if (strlen(value) >= CONFIG_TEXT_MAX)
    {
        (void)snprintf(error, CONFIG_ERROR_MAX, "%s: too long: at most %d characters", name,
                       CONFIG_TEXT_MAX - 1);
        return false;
    }
    strcpy(field, value);
    return true;
}

bool config_set(struct app_config *config, const char *key, const char *value,
                char error[CONFIG_ERROR_MAX])
{
    const struct config_key *found = find_key(key);
    if (found == NULL)
    {
        (void)snprintf(error, CONFIG_ERROR_MAX,
                       "'%.60s' is no key: turbopi --print-config lists them all", key);
        return false;
    }
    char *field = (char *)config + found->offset;
    switch ((enum key_kind)found->kind)
    {
        case KEY_INTEGER: return set_integer(found, key, value, (int32_t *)(void *)field, error);
        case KEY_BOOL: return set_bool(key, value, (bool *)field, error);
        case KEY_TEXT: return set_text(key, value, field, error);
    }
    return false;
}

static bool take(void *context, const char *key, const char *value, char *error)
{
    return config_set(context, key, value, error);
}

bool config_parse(struct app_config *config, const char *name, const char *text,
                  char error[CONFIG_ERROR_MAX])
{
    return lines_parse(name, text, take, config, error);
}

bool config_load(struct app_config *config, const char *path, char error[CONFIG_ERROR_MAX])
{
    return lines_load(path, take, config, error);
}

bool config_load_what_can_be(struct app_config *config, const char *path)
{
    static char text[16384];
    char error[CONFIG_ERROR_MAX];
    // A pipe would make who opens it wait.
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    const bool is_absent = fd < 0 && errno == ENOENT;
    const ssize_t length = fd < 0 ? -1 : read(fd, text, sizeof text - 1);
    bool is_whole = length >= 0 ? length < (ssize_t)sizeof text - 1 : is_absent;
    if (fd >= 0)
    {
        (void)close(fd);
    }
    text[length > 0 ? length : 0] = '\0';
    is_whole = is_whole && memchr(text, '\0', sizeof text) == text + (length > 0 ? length : 0);
    char *rest = text;
    for (char *line; (line = strsep(&rest, "\n")) != NULL;)
    {
        is_whole = lines_parse(path, line, take, config, error) && is_whole;
    }
    return is_whole;
}

static int print_value(const struct app_config *config, const struct config_key *key,
                       const char *name, char *text, size_t size)
{
    const char *field = (const char *)config + key->offset;
    switch ((enum key_kind)key->kind)
    {
        case KEY_INTEGER:
            return snprintf(text, size, "%s = %" PRId32 "\n", name,
                            *(const int32_t *)(const void *)field);
        case KEY_BOOL:
            return snprintf(text, size, "%s = %s\n", name, *(const bool *)field ? "true" : "false");
        case KEY_TEXT: return snprintf(text, size, "%s = \"%s\"\n", name, field);
    }
    return 0;
}

size_t config_print(const struct app_config *config, bool with_docs, char *text, size_t size)
{
    size_t used = 0;
    const char *doc, *name = config_texts;
    for (size_t i = 0; i < config_key_count; ++i, name = text_after(doc))
    {
        char entry[2 * CONFIG_ERROR_MAX];
        doc = text_after(name);
        int length = with_docs ? snprintf(entry, sizeof entry, "# %s\n", doc) : 0;
        length += print_value(config, &config_keys[i], name, entry + length,
                              sizeof entry - (size_t)length);
        if (used + (size_t)length >= size)
        {
            break;
        }
        memcpy(text + used, entry, (size_t)length);
        used += (size_t)length;
    }
    text[used] = '\0';
    return used;
}

const char *config_remark(const struct app_config *config)
{
    int turns = 0;
    for (int wheel = 0; wheel < FW_WHEEL_COUNT; ++wheel)
    {
        turns |= config->sign[wheel];
    }
    if (config->duty_cap_pct == 0)
    {
        return "duty_cap_pct = 0";
    }
    return turns == 0 ? "all signs = 0" : NULL;
}

// Bits without a gap: the first that is empty is the end.
static enum fw_err set_bits(const struct app_config *config, struct fw_config *core)
{
    const struct fw_bit usual = {
        .box = {(uint8_t)config->y_min, (uint8_t)config->y_max, (uint8_t)config->u_min,
                (uint8_t)config->u_max, (uint8_t)config->v_min, (uint8_t)config->v_max},
        .min_blob_px = config->min_blob_px,
        .vote = {config->vote_frames, fw_vote_window_us(config->vote_window_ms)},
    };
    const enum fw_err err = fw_bit_check(&usual);
    for (int i = 0; err == FW_OK && i < FW_MAX_BITS; ++i)
    {
        const char *text = config->bits[i];
        core->bits[i] = usual;
        if (text[0] != '\0' && (i > core->bit_count || !fw_bit_parse(text, &core->bits[i])))
        {
            return FW_ERR_BITS;
        }
        core->bit_count += text[0] != '\0';
    }
    return err;
}

enum fw_err config_core(const struct app_config *config, struct fw_config *core)
{
    struct fw_table table;
    const struct fw_behavior *behavior = fw_behavior_find(config->behavior);
    if (config->table[0] == '\0' && behavior != NULL)
    {
        table = behavior->table;
    }
    else if (!fw_table_parse(config->table, &table))
    {
        return FW_ERR_INPUT_RANGE;
    }
    *core = (struct fw_config){
        .width_px = config->width_px,
        .height_px = config->height_px,
        .table = table,
        .frame_timeout_us = (int64_t)config->frame_timeout_ms * 1000,
        .duty_cap_pct = config->duty_cap_pct,
    };
    const enum fw_err err = set_bits(config, core);
    return err != FW_OK ? err : fw_config_check(core);
}
