// SPDX-License-Identifier: Apache-2.0
// The robot's program: reads its options, wires its parts, and lets them run.
#include <stdio.h>
#include <string.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include "devices.h"
#include "loop.h"
#include "loop_commands.h"
#include "options.h"
#include "reporter.h"
#include "supervisor.h"

#define EXIT_USAGE 2

static bool asked_to_end(int stop_fd)
{
    struct signalfd_siginfo info;
    return read(stop_fd, &info, sizeof info) == sizeof info;
}

// @return the exit code if the robot cannot run, or -1.
static int prepare(const struct options *options, struct loop *loop,
                   const struct loop_devices *devices, const struct link *link)
{
    const struct app_config *config = &options->config;
    const enum fw_err err = loop_init(loop, config, &options->own, devices, link);
    if (err != FW_OK)
    {
        (void)fprintf(stderr, "turbopi: configuration: %s\n", fw_err_str(err));
        return EXIT_USAGE;
    }
    char error[CONFIG_ERROR_MAX], reason[LINK_REASON_MAX];
    if (!devices_check_recording(config, devices, error))
    {
        (void)fprintf(stderr, "turbopi: %s\n", error);
        return EXIT_USAGE;
    }
    if (config->script[0] != '\0' && !loop_load_script(loop, config->script, reason))
    {
        (void)fprintf(stderr, "turbopi: %s: %s\n", config->script, reason);
        return EXIT_USAGE;
    }
    loop->plays_script = config->script[0] != '\0';
    return -1;
}

// Whoever hangs while the wheels start is to be killed as soon as one who drives.
static void tell_moving(const void *heartbeat)
{
    heartbeat_send(heartbeat, true);
}

static void play(struct loop *loop, const struct options *options,
                 const struct heartbeat *heartbeat, int stop_fd)
{
    const bool once = options->config.script[0] != '\0';
    loop->before_moving = tell_moving;
    loop->before_moving_context = heartbeat;
    while (!asked_to_end(stop_fd) && !loop->camera_over && !(once && loop->script_over))
    {
        loop_step(loop);
        heartbeat_send(heartbeat, loop->moving);
    }
    if (loop->camera_over)
    {
        (void)fprintf(stderr, "turbopi: the recording is over\n");
    }
}

static int work(const struct options *options, const struct heartbeat *heartbeat, int stop_fd)
{
    static struct loop loop;
    static struct reporter reporter;
    struct loop_devices devices;
    struct link link;
    char error[CONFIG_ERROR_MAX];
    if (!devices_make(&options->config, options->dry_run, &devices, error))
    {
        (void)fprintf(stderr, "turbopi: %s\n", error);
        return 1;
    }
    if (reporter_start(&reporter, &options->config, &link) != FW_OK)
    {
        (void)fprintf(stderr, "turbopi: io_tsv: '%s': telemetry or log cannot be opened\n",
                      options->config.io_tsv);
        return EXIT_USAGE;
    }
    int code = prepare(options, &loop, &devices, &link);
    if (code < 0)
    {
        loop.wake_fd = stop_fd;
        if (options->config.autostart)
        {
            loop_start(&loop);
        }
        (void)fprintf(stderr, "turbopi: robot %d, %s: %s\n", (int)options->config.robot_id,
                      options->config.behavior,
                      loop.running ? "started" : "waits for the button or a command");
        play(&loop, options, heartbeat, stop_fd);
        loop_close(&loop);
        code = 0;
    }
    reporter_stop(&reporter);
    return code;
}

static int print_config(const struct app_config *config)
{
    static char text[16384];
    (void)config_print(config, true, text, sizeof text);
    return fputs(text, stdout) == EOF;
}

int main(int argc, char **argv)
{
    static struct options options;
    switch (parse_options(argc, argv, &options))
    {
        case OPTIONS_DONE: return 0;
        case OPTIONS_BAD: return EXIT_USAGE;
        case OPTIONS_PRINT_CONFIG: return print_config(&options.config);
        case OPTIONS_STOP: return stop_board(&options) ? 0 : 1;
        case OPTIONS_RUN: break;
    }
    if (options.dry_run)
    {
        (void)fprintf(stderr, "turbopi: dry run: no motor will move\n");
    }
    return supervise(&options, work);
}
