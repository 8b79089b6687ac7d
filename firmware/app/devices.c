// SPDX-License-Identifier: Apache-2.0
#include "devices.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "hal_linux/board_probe.h"
#include "hal_linux/camera_v4l2.h"
#include "hal_linux/clock_linux.h"
#include "hal_linux/panel_gpio.h"
#include "hal_stub/stub_board.h"
#include "hal_stub/stub_camera.h"
#include "hal_stub/stub_panel.h"
#include "instance.h"

#define STUB_PACK_MV 8000

// The stub board may answer through it.
static struct stub_camera stub_camera;

// @return what follows the prefix, or NULL.
static const char *after(const char *text, const char *prefix)
{
    const size_t length = strlen(prefix);
    return strncmp(text, prefix, length) == 0 ? text + length : NULL;
}

static void use_i2c(struct motors_i2c *board, const struct hal_motors *motors,
                    struct loop_devices *devices)
{
    devices->motors = *motors;
    devices->battery = motors_i2c_battery(board);
    devices->board = "i2c";
}

static void use_uart(struct motors_uart *board, const struct hal_motors *motors,
                     struct loop_devices *devices)
{
    devices->motors = *motors;
    devices->battery = motors_uart_battery(board);
    devices->board = "uart";
}

// `where`: a file that records, "camera" to answer through the camera's socket, or NULL.
static void use_stub(const char *where, struct stub_board *board, struct loop_devices *devices)
{
    const bool answers = where != NULL && strcmp(where, "camera") == 0;
    *board = (struct stub_board){.record_path = answers ? NULL : where,
                                 .clock = devices->clock,
                                 .answers_to = answers ? &stub_camera : NULL,
                                 .pack_mV = STUB_PACK_MV};
    devices->motors = stub_board_motors(board);
    devices->battery = stub_board_battery(board);
}

static bool use_board(const struct app_config *config, struct board_drivers *drivers,
                      struct loop_devices *devices, char *error)
{
    struct motors_i2c *i2c = &drivers->i2c;
    struct motors_uart *uart = &drivers->uart;
    struct motors_i2c_config i2c_config = {.path = config->i2c_device,
                                           .burst = config->i2c_burst,
                                           .reads_back = config->board_confirms,
                                           .retry_us = config->board_retry_ms * 1000};
    struct motors_uart_config uart_config = {.path = config->uart_device,
                                             .must_be_heard = config->board_confirms,
                                             .retry_us = config->board_retry_ms * 1000};
    for (int wheel = 0; wheel < FW_WHEEL_COUNT; ++wheel)
    {
        i2c_config.sign[wheel] = uart_config.sign[wheel] = (int8_t)config->sign[wheel];
    }
    const struct hal_motors i2c_motors =
        motors_i2c_make(i2c, &i2c_config, &devices->clock, &hal_sys_kernel);
    const struct hal_motors uart_motors = motors_uart_make(uart, &uart_config, &devices->clock);
    enum board_kind kind = strcmp(config->board, "uart") == 0 ? BOARD_UART : BOARD_I2C;
    if (strcmp(config->board, "auto") == 0)
    {
        const enum fw_err err = board_probe(i2c, uart, &kind);
        if (err != FW_OK)
        {
            (void)snprintf(error, CONFIG_ERROR_MAX,
                           "motor board: none answers at %.80s, and none is heard at %.80s: is the "
                           "robot switched on, and I2C enabled? If you know which it is, set board",
                           config->i2c_device, config->uart_device);
            hal_motors_close(&i2c_motors);
            hal_motors_close(&uart_motors);
            return false;
        }
    }
    else if (strcmp(config->board, "i2c") != 0 && strcmp(config->board, "uart") != 0)
    {
        (void)snprintf(error, CONFIG_ERROR_MAX,
                       "board: '%.100s': must be auto, i2c, uart, stub, stub:FILE or stub:camera",
                       config->board);
        return false;
    }
    if (kind == BOARD_I2C)
    {
        use_i2c(i2c, &i2c_motors, devices);
    }
    else
    {
        use_uart(uart, &uart_motors, devices);
    }
    return true;
}

bool devices_make_board(const struct app_config *config, bool dry_run,
                        struct board_drivers *drivers, struct loop_devices *devices,
                        char error[CONFIG_ERROR_MAX])
{
    devices->clock = clock_linux();
    const char *where = after(config->board, "stub:");
    if (dry_run || where != NULL || strcmp(config->board, "stub") == 0)
    {
        use_stub(dry_run ? NULL : where, &drivers->stub, devices);
        return true;
    }
    return use_board(config, drivers, devices, error);
}

const char *devices_board_path(const struct app_config *config, bool dry_run)
{
    const char *file = after(config->board, "stub:");
    if (dry_run || (file != NULL && strcmp(file, "camera") == 0))
    {
        return NULL;
    }
    return file != NULL                         ? file
           : strcmp(config->board, "i2c") == 0  ? config->i2c_device
           : strcmp(config->board, "uart") == 0 ? config->uart_device
                                                : NULL;
}

bool devices_settle_board(struct app_config *config, bool dry_run, char error[CONFIG_ERROR_MAX])
{
    struct board_drivers drivers;
    struct loop_devices devices = {0};
    if (!devices_make_board(config, dry_run, &drivers, &devices, error))
    {
        return false;
    }
    if (strcmp(config->board, "auto") == 0 && devices.board != NULL)
    {
        (void)snprintf(config->board, sizeof config->board, "%s", devices.board);
    }
    hal_motors_close(&devices.motors);
    return true;
}

static void use_camera(const struct app_config *config, struct loop_devices *devices)
{
    static struct camera_v4l2 v4l2;
    const char *socket_path = after(config->camera, "stub:unix:");
    const char *file_path = after(config->camera, "stub:");
    const struct stub_camera_config stub_config = {
        .path = socket_path != NULL ? socket_path : file_path,
        .width_px = config->width_px,
        .height_px = config->height_px,
        .rate_Hz = config->rate_Hz,
    };
    if (socket_path != NULL)
    {
        devices->camera = stub_camera_socket(&stub_camera, &stub_config, &devices->clock, NULL);
    }
    else if (file_path != NULL)
    {
        devices->camera = stub_camera_file(&stub_camera, &stub_config, &devices->clock, NULL);
    }
    else
    {
        const struct camera_v4l2_config v4l2_config = {
            .path = config->camera,
            .width_px = config->width_px,
            .height_px = config->height_px,
            .rate_Hz = config->rate_Hz,
            .exposure_100us = config->exposure_100us,
            .white_balance_K = config->white_balance_K,
        };
        devices->camera = camera_v4l2_make(&v4l2, &v4l2_config, &devices->clock, &hal_sys_kernel);
    }
}

bool devices_check_recording(const struct app_config *config, const struct loop_devices *devices,
                             char error[CONFIG_ERROR_MAX])
{
    const char *path = after(config->camera, "stub:");
    if (path == NULL || after(path, "unix:") != NULL)
    {
        return true;
    }
    struct hal_camera_format format;
    const enum fw_err err = hal_camera_open(&devices->camera, &format);
    hal_camera_close(&devices->camera);
    if (err == FW_ERR_FORMAT)
    {
        (void)snprintf(error, CONFIG_ERROR_MAX,
                       "camera: '%.100s': holds no whole number of YUYV frames of %dx%d: set "
                       "width_px and height_px to their size",
                       path, (int)config->width_px, (int)config->height_px);
    }
    else if (err != FW_OK)
    {
        (void)snprintf(error, CONFIG_ERROR_MAX, "camera: '%.100s': the file cannot be read", path);
    }
    return err == FW_OK;
}

static bool use_panel(const struct app_config *config, bool dry_run, struct loop_devices *devices,
                      char *error)
{
    static struct panel_gpio gpio;
    static struct stub_panel none;
    if (dry_run || strcmp(config->panel, "none") == 0)
    {
        devices->panel = stub_panel_make(&none);
        return true;
    }
    if (strcmp(config->panel, "gpio") != 0)
    {
        (void)snprintf(error, CONFIG_ERROR_MAX, "panel: '%.100s': must be gpio or none",
                       config->panel);
        return false;
    }
    const struct panel_gpio_config gpio_config = {
        .chip = config->gpio_chip,
        .offset = {[PANEL_GPIO_BUTTON] = (unsigned)config->button_line,
                   [PANEL_GPIO_DETECTED] = (unsigned)config->detected_line,
                   [PANEL_GPIO_RUNNING] = (unsigned)config->running_line,
                   [PANEL_GPIO_BUZZER] = (unsigned)config->buzzer_line},
    };
    devices->panel = panel_gpio_make(&gpio, &gpio_config, &hal_sys_kernel);
    return true;
}

static const char *path_of(const struct app_config *config, enum loop_part part)
{
    const char *board = devices_board_path(config, false);
    return part == LOOP_CAMERA  ? config->camera
           : part == LOOP_PANEL ? config->gpio_chip
           : board != NULL      ? board
                                : config->board;
}

// Called after the wheels were stopped: looking for who has a device takes a while.
static void explain(const struct app_config *config, enum loop_part part, enum fw_err err,
                    char reason[LOOP_REASON_MAX])
{
    char who[INSTANCE_WHO_MAX];
    const char *path = path_of(config, part);
    const bool is_busy = hal_sys_last_error() == EBUSY && instance_user_of(path, who);
    const bool is_told =
        err == FW_ERR_NOT_ZERO || err == FW_ERR_FROZEN || hal_sys_reason()[0] == '\0';
    (void)snprintf(reason, LOOP_REASON_MAX, "%.100s: %s%s%s", path,
                   is_told ? fw_err_str(err) : hal_sys_reason(), is_busy ? ": " : "",
                   is_busy ? who : "");
}

bool devices_make(const struct app_config *config, bool dry_run, struct loop_devices *devices,
                  char error[CONFIG_ERROR_MAX])
{
    static struct board_drivers drivers;
    if (!devices_make_board(config, dry_run, &drivers, devices, error) ||
        !use_panel(config, dry_run, devices, error))
    {
        return false;
    }
    use_camera(config, devices);
    devices->config = config;
    devices->dry_run = dry_run;
    devices->explain = explain;
    devices->camera_is_live = after(config->camera, "stub:") == NULL;
    return true;
}
