// SPDX-License-Identifier: Apache-2.0
// All that can be set about the robot's program. config.c has the one list of keys.
#ifndef APP_CONFIG_H
#define APP_CONFIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fw/config.h"
#include "fw/err.h"
#include "fw/mixing.h"
#include "lines.h"

// A table of 16 rows, each as in -100,-1.999 with a comma after it, fits.
#define CONFIG_TEXT_MAX 208
#define CONFIG_ERROR_MAX LINES_ERROR_MAX
// Where tables of the user's own are; this file alone need not be there.
#define CONFIG_BEHAVIORS "/etc/turbopi/behaviors.toml"

struct app_config
{
    int32_t robot_id;
    char behavior[CONFIG_TEXT_MAX], table[CONFIG_TEXT_MAX], behaviors[CONFIG_TEXT_MAX];
    bool autostart;

    int32_t y_min, y_max, u_min, u_max, v_min, v_max;
    int32_t min_blob_px;
    int32_t vote_frames, vote_window_ms;
    char bits[FW_MAX_BITS][CONFIG_TEXT_MAX];
    int32_t frame_timeout_ms, duty_cap_pct;

    char camera[CONFIG_TEXT_MAX];
    int32_t width_px, height_px, rate_Hz, exposure_100us, white_balance_K, frozen_ms;

    char board[CONFIG_TEXT_MAX];
    char i2c_device[CONFIG_TEXT_MAX], uart_device[CONFIG_TEXT_MAX];
    bool i2c_burst;
    bool board_confirms;
    int32_t board_retry_ms;
    int32_t sign[FW_WHEEL_COUNT];
    int32_t battery_low_mV;

    char panel[CONFIG_TEXT_MAX], gpio_chip[CONFIG_TEXT_MAX];
    int32_t button_line, detected_line, running_line, buzzer_line;

    char script[CONFIG_TEXT_MAX], script_dir[CONFIG_TEXT_MAX];
    char lcm_url[CONFIG_TEXT_MAX], io_tsv[CONFIG_TEXT_MAX];
    char key_file[CONFIG_TEXT_MAX], run_dir[CONFIG_TEXT_MAX];
    int32_t link_timeout_ms;
    int32_t watchdog_ms, restart_ms;
};

void config_default(struct app_config *config);

// Sets one key from text. @param error on failure one sentence without the key's origin.
// @return false if the key is unknown or the value does not fit; then config is untouched.
bool config_set(struct app_config *config, const char *key, const char *value,
                char error[CONFIG_ERROR_MAX]);

// Sets every key of a text: see lines.h.
// @param name of the text, for the error. @return as config_set(); then config may be half set.
bool config_parse(struct app_config *config, const char *name, const char *text,
                  char error[CONFIG_ERROR_MAX]);

// The same from a file.
bool config_load(struct app_config *config, const char *path, char error[CONFIG_ERROR_MAX]);

// Sets what can be understood of a file, and leaves the rest as it is.
// @return false if anything but an absent default file was left out.
bool config_load_what_can_be(struct app_config *config, const char *path);

// Writes all keys as lines that config_parse() reads back, valid TOML as well.
// @param with_docs a comment above each key. @return bytes written, without the final 0; the text
// ends early if size is too small.
size_t config_print(const struct app_config *config, bool with_docs, char *text, size_t size);

// @return what it is in a configuration that is right by which no wheel ever turns; else NULL.
const char *config_remark(const struct app_config *config);

// The part that the core decides by. @return FW_OK, or why the core refuses it.
enum fw_err FW_MUST_CHECK config_core(const struct app_config *config, struct fw_config *core);

#endif
