// SPDX-License-Identifier: Apache-2.0
#include "telemetry.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <turbopi_ack_t.h>
#include <turbopi_run_t.h>
#include <turbopi_swarm_command_t.h>
#include <turbopi_telemetry_t.h>

#define CONNECT_PERIOD_US 2000000
#define RUN_PERIOD_US 5000000
#define COMMAND_CHANNEL "SWARM_COMMAND"
#define ALL_ROBOTS (-1)
// Bytes of a swarm_command_t before its text: type, utime_us, seq, robot_id, verb, start_utime_us
// and the text's length, big-endian.
#define COMMAND_TEXT_AT (8 + 8 + 4 + 4 + 1 + 8 + 4)

struct channel
{
    char name[24];
};

static struct channel channel_of(const struct telemetry *telemetry, const char *suffix)
{
    struct channel channel;
    (void)snprintf(channel.name, sizeof channel.name, "R%02d_%s",
                   (int)(telemetry->config->robot_id % 100), suffix);
    return channel;
}

// LCM's decoder trusts that a text is as long as it says and ends in 0, but anyone may send.
static bool decode_command(const lcm_recv_buf_t *buffer, turbopi_swarm_command_t *message)
{
    const uint8_t *bytes = buffer->data;
    if (buffer->data_size <= COMMAND_TEXT_AT || bytes[buffer->data_size - 1] != 0)
    {
        return false;
    }
    uint32_t length = 0;
    for (int i = 4; i > 0; --i)
    {
        length = length << 8 | bytes[COMMAND_TEXT_AT - i];
    }
    return length == buffer->data_size - COMMAND_TEXT_AT &&
           turbopi_swarm_command_t_decode(bytes, 0, (int)buffer->data_size, message) >= 0;
}

static void pass_on_command(struct telemetry *telemetry, const turbopi_swarm_command_t *message)
{
    if (message->robot_id != ALL_ROBOTS && message->robot_id != telemetry->config->robot_id)
    {
        return;
    }
    struct link_command command = {
        .order =
            {
                .utime_us = message->utime_us,
                .seq = message->seq,
                .verb = message->verb,
                .start_utime_us = message->start_utime_us,
            },
    };
    (void)snprintf(command.name, sizeof command.name, "%s", message->behavior);
    telemetry->on_command(telemetry->context, &command);
}

static void on_swarm_command(const lcm_recv_buf_t *buffer, const char *channel, void *context)
{
    turbopi_swarm_command_t message;
    if (!decode_command(buffer, &message))
    {
        (void)fprintf(stderr, "turbopi: %s: ignored: not a command of this version\n", channel);
        return;
    }
    pass_on_command(context, &message);
    (void)turbopi_swarm_command_t_decode_cleanup(&message);
}

void telemetry_init(struct telemetry *telemetry, const struct app_config *config,
                    telemetry_command_fn *on_command, void *context)
{
    *telemetry = (struct telemetry){.config = config, .on_command = on_command, .context = context};
}

// A log file is written, not heard.
static bool hears_commands(const struct telemetry *telemetry)
{
    return strncmp(telemetry->config->lcm_url, "file:", 5) != 0;
}

bool telemetry_has_lost_log(const struct telemetry *telemetry)
{
    return !hears_commands(telemetry) && telemetry->unsent_count > 0;
}

void telemetry_connect(struct telemetry *telemetry, int64_t now_us)
{
    if (telemetry->lcm != NULL || telemetry->config->lcm_url[0] == '\0' ||
        now_us < telemetry->next_create_us)
    {
        return;
    }
    telemetry->lcm = lcm_create(telemetry->config->lcm_url);
    if (telemetry->lcm != NULL && hears_commands(telemetry) &&
        lcm_subscribe(telemetry->lcm, COMMAND_CHANNEL, on_swarm_command, telemetry) == NULL)
    {
        telemetry_close(telemetry);
    }
    telemetry->next_create_us = now_us + CONNECT_PERIOD_US;
}

static void count(struct telemetry *telemetry, int status)
{
    telemetry->unsent_count += status != 0;
}

// What no message has a field for stands in comments above the configuration.
static void publish_run(struct telemetry *telemetry, const struct link_report *report)
{
    char text[6144];
    int used = snprintf(text, sizeof text,
                        "# frames: %" PRIu32 " taken, %" PRIu32 " dropped, %" PRIu32
                        " damaged\n"
                        "# rejected:",
                        report->camera.taken_count, report->camera.dropped_count,
                        report->camera.damaged_count);
    for (int reason = FW_REJECT_NONE + 1; reason < FW_REJECT_COUNT; ++reason)
    {
        used += snprintf(text + used, sizeof text - (size_t)used, " %" PRIu32 " %s",
                         report->rejected_count[reason], fw_reject_str((enum fw_reject)reason));
    }
    used += snprintf(text + used, sizeof text - (size_t)used,
                     "\n# reports: %" PRIu32 " lost, %" PRIu32 " unsent; panel %s\n",
                     report->lost_report_count, telemetry->unsent_count,
                     report->panel_lost ? "lost" : "ok");
    (void)config_print(telemetry->config, false, text + used, sizeof text - (size_t)used);
    char behavior[LINK_NAME_MAX];
    memcpy(behavior, report->behavior, sizeof behavior);
    const turbopi_run_t run = {
        .utime_us = report->utime_us,
        .robot_id = telemetry->config->robot_id,
        .source = "robot",
        .version = TWINMILL_VERSION,
        .behavior = behavior,
        .config_toml = text,
    };
    count(telemetry,
          turbopi_run_t_publish(telemetry->lcm, channel_of(telemetry, "RUN").name, &run));
}

static void publish_step(struct telemetry *telemetry, const struct link_report *report)
{
    const struct fw_output *out = &report->out;
    turbopi_telemetry_t message = {
        .utime_us = report->utime_us,
        .frame_utime_us = report->frame_utime_us,
        .robot_id = telemetry->config->robot_id,
        .seq = out->seq,
        .frame_seq = (int32_t)out->frame_seq,
        .blob_px = out->blob_px,
        .detected_raw = out->detected_raw,
        .detected = out->detected,
        .mode = out->mode,
        .speed_input = (float)out->speed_input_pct,
        .turn_input = (float)out->turn_input_milli / 1000,
        .battery_V = report->pack_mV == 0 ? NAN : (float)report->pack_mV / 1000,
        .loop_us = report->loop_us,
        .status_flags = report->status_flags,
    };
    memcpy(message.wheel_duty_pct, out->wheel_duty_pct, sizeof message.wheel_duty_pct);
    count(telemetry, turbopi_telemetry_t_publish(
                         telemetry->lcm, channel_of(telemetry, "TELEMETRY").name, &message));
}

void telemetry_publish(struct telemetry *telemetry, const struct link_report *report)
{
    if (telemetry->lcm == NULL)
    {
        ++telemetry->unsent_count;
        return;
    }
    if (report->utime_us >= telemetry->next_run_us ||
        report->utime_us < telemetry->next_run_us - RUN_PERIOD_US)
    {
        publish_run(telemetry, report);
        telemetry->next_run_us = report->utime_us + RUN_PERIOD_US;
    }
    publish_step(telemetry, report);
}

void telemetry_publish_ack(struct telemetry *telemetry, const struct link_ack *ack)
{
    char reason[LINK_REASON_MAX];
    memcpy(reason, ack->reason, sizeof reason);
    const turbopi_ack_t message = {
        .utime_us = ack->utime_us,
        .robot_id = telemetry->config->robot_id,
        .seq = ack->seq,
        .accepted = ack->accepted,
        .reason = reason,
    };
    if (telemetry->lcm != NULL)
    {
        count(telemetry,
              turbopi_ack_t_publish(telemetry->lcm, channel_of(telemetry, "ACK").name, &message));
    }
}

int telemetry_fd(const struct telemetry *telemetry)
{
    return telemetry->lcm != NULL && hears_commands(telemetry) ? lcm_get_fileno(telemetry->lcm)
                                                               : -1;
}

void telemetry_handle(struct telemetry *telemetry)
{
    (void)lcm_handle_timeout(telemetry->lcm, 0);
}

void telemetry_close(struct telemetry *telemetry)
{
    if (telemetry->lcm != NULL)
    {
        lcm_destroy(telemetry->lcm);
        telemetry->lcm = NULL;
    }
}
