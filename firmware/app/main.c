// SPDX-License-Identifier: Apache-2.0
// The robot's program: reads its options, wires its parts, and lets them run.
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "devices.h"
#include "loop.h"
#include "loop_commands.h"
#include "loop_link.h"
#include "options.h"
#include "priority.h"
#include "radio/seal.h"
#include "reporter.h"
#include "say.h"
#include "stop_command.h"
#include "supervisor.h"

#define EXIT_USAGE 2

// @return the exit code if the robot cannot run, or -1.
static int prepare(const struct options *options, struct loop *loop,
                   const struct loop_devices *devices, const struct link *link)
{
    const struct app_config *config = &options->config;
    const enum fw_err err = loop_init(loop, config, &options->own, devices, link);
    if (err != FW_OK)
    {
        say("configuration: %s", fw_err_str(err));
        return EXIT_USAGE;
    }
    char error[CONFIG_ERROR_MAX], reason[LINK_REASON_MAX];
    if (!devices_check_recording(config, devices, error))
    {
        say("%s", error);
        return EXIT_USAGE;
    }
    if (config->script[0] != '\0' && !loop_load_script(loop, config->script, reason))
    {
        say("%s: %s", config->script, reason);
        return EXIT_USAGE;
    }
    loop->plays_script = config->script[0] != '\0';
    return -1;
}

static void play(struct loop *loop, const struct options *options, int stop_fd)
{
    const bool once = options->config.script[0] != '\0';
    while (supervisor_asked_to_end(stop_fd) == 0 && !loop->camera_over &&
           !(once && loop->script_over && !loop_link_is_held(loop)))
    {
        loop_step(loop);
    }
}

// @return the exit code: 1 if the wheels may turn, which is then the supervisor's business.
static int end(struct loop *loop, struct watch *watch)
{
    if (!loop_close(loop))
    {
        return 1;
    }
    watch->driver_pid = 0;
    if (loop->camera_over)
    {
        say("the recording is over");
    }
    return 0;
}

// Without a key the robot is driven by its button, and stopped by anybody.
static struct seal_key load_key(const struct app_config *config)
{
    struct seal_key key;
    char error[SEAL_ERROR_MAX];
    if (!seal_load(config->key_file, &key, error) && config->lcm_url[0] != '\0')
    {
        say("%s: over the network only a stop is obeyed", error);
    }
    return key;
}

// Without a person: only where a stop would have outlived the last run, and did not.
static bool is_started(const struct options *options, const struct loop *loop)
{
    const bool keeps_stops = latch_works(&loop->operator_link.latch);
    return !loop->filter.latched && !loop->watch->reloaded &&
           (options->starts || (options->config.autostart && keeps_stops));
}

static int drive(const struct options *options, struct watch *watch, int stop_fd)
{
    static struct loop loop;
    static struct reporter reporter;
    struct loop_devices devices = {0};
    struct link link;
    char error[CONFIG_ERROR_MAX];
    priority_take(PRIORITY_DRIVES);
    if (!devices_make(&options->config, options->dry_run, &devices, error))
    {
        say("%s", error);
        return 1;
    }
    const struct seal_key key = load_key(&options->config);
    if (reporter_start(&reporter, &options->config, &key, &link) != FW_OK)
    {
        say("the radio cannot be opened: %s", strerror(errno));
        return 1;
    }
    int code = prepare(options, &loop, &devices, &link);
    if (code < 0)
    {
        loop.wake_fd = stop_fd;
        loop.watch = watch;
        loop.may_move = watch->may_move;
        loop.filter.latched = loop.filter.latched || watch->latched;
        if (is_started(options, &loop))
        {
            loop_start(&loop);
        }
        say("robot %d, %s: %s", (int)options->config.robot_id, options->config.behavior,
            loop.running          ? "started"
            : loop.filter.latched ? "was stopped: waits for the button or to be armed"
                                  : "waits for the button or a command");
        play(&loop, options, stop_fd);
        code = end(&loop, watch);
    }
    if (!reporter_stop(&reporter))
    {
        say("rows of a log are lost, see above");
        code = code == 0 ? SUPERVISOR_EXIT_LOG_LOST : code;
    }
    return code;
}

static void say_remark(const struct app_config *config)
{
    const char *remark = config_remark(config);
    if (remark != NULL)
    {
        say("configuration: %s: no wheel ever turns", remark);
    }
}

static int print_config(const struct app_config *config)
{
    say_remark(config);
    static char text[16384];
    (void)config_print(config, true, text, sizeof text);
    return fputs(text, stdout) == EOF;
}

// Else the board could be opened as number 2, and get the messages.
static void take_standard_files(void)
{
    int fd;
    while ((fd = open("/dev/null", O_RDWR)) >= 0 && fd <= STDERR_FILENO)
    {
    }
    (void)close(fd);
}

int main(int argc, char **argv)
{
    static struct options options;
    take_standard_files();
    switch (parse_options(argc, argv, &options))
    {
        case OPTIONS_DONE: return 0;
        case OPTIONS_BAD: return EXIT_USAGE;
        case OPTIONS_PRINT_CONFIG: return print_config(&options.config);
        case OPTIONS_STOP: return stop_command(&options);
        case OPTIONS_RUN: break;
    }
    say_remark(&options.config);
    if (options.dry_run)
    {
        say("dry run: no motor will move");
    }
    return supervise(&options, drive);
}
