// SPDX-License-Identifier: Apache-2.0
#include "telemetry.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <turbopi_ack_t.h>
#include <turbopi_link_t.h>
#include <turbopi_run_t.h>
#include <turbopi_signed_ack_t.h>
#include <turbopi_telemetry_t.h>

#include "say.h"

#define CONNECT_PERIOD_US 2000000
#define RUN_PERIOD_US 5000000
#define LINK_PERIOD_US 100000
// One message of a change may be lost: it is said again for a second.
#define CHANGE_PERIOD_US 200000
#define CHANGE_US 1000000
// More than any message takes but run_t.
#define MESSAGE_MAX_BYTES 256

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

void telemetry_init(struct telemetry *telemetry, const struct app_config *config,
                    const struct seal_key *key, int64_t session)
{
    *telemetry =
        (struct telemetry){.config = config, .key = *key, .session = session, .log.file.fd = -1};
}

bool telemetry_has_lost_log(const struct telemetry *telemetry)
{
    return lcm_log_is_meant(telemetry->config->lcm_url) && telemetry->log.file.lost_count > 0;
}

static bool is_connected(const struct telemetry *telemetry)
{
    return telemetry->lcm != NULL || telemetry->log.file.fd >= 0;
}

static void begin_log(struct telemetry *telemetry)
{
    const char *url = telemetry->config->lcm_url;
    const bool is_known = lcm_log_open(&telemetry->log, url);
    if (!is_known && telemetry->next_create_us == 0)
    {
        say("lcm_url: '%s': rows are lost: a log is file://PATH?mode=w, or mode=a to go on", url);
    }
}

// Where what is not taken is counted.
static uint32_t *losses(struct telemetry *telemetry)
{
    return lcm_log_is_meant(telemetry->config->lcm_url) ? &telemetry->log.file.lost_count
                                                        : &telemetry->unsent_count;
}

void telemetry_connect(struct telemetry *telemetry, int64_t now_us)
{
    const char *url = telemetry->config->lcm_url;
    if (is_connected(telemetry) || url[0] == '\0' || now_us < telemetry->next_create_us)
    {
        return;
    }
    if (lcm_log_is_meant(url))
    {
        begin_log(telemetry);
    }
    else
    {
        telemetry->lcm = lcm_create(url);
    }
    telemetry->next_create_us = now_us + CONNECT_PERIOD_US;
}

static void send_bytes(struct telemetry *telemetry, int64_t utime_us, const char *suffix,
                       const uint8_t *bytes, int size)
{
    const struct channel channel = channel_of(telemetry, suffix);
    if (size > 0 && telemetry->log.file.fd >= 0)
    {
        lcm_log_add(&telemetry->log, utime_us, channel.name, bytes, (uint32_t)size);
    }
    else
    {
        const bool taken = size > 0 && telemetry->lcm != NULL &&
                           lcm_publish(telemetry->lcm, channel.name, bytes, (unsigned)size) == 0;
        *losses(telemetry) += !taken;
    }
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
                     "\n# reports: %" PRIu32 " lost, %" PRIu32
                     " unsent; panel %s; commands ignored: %" PRIu32 "\n",
                     report->lost_report_count, telemetry->unsent_count,
                     report->panel_lost ? "lost" : "ok", report->ignored_count);
    char key_name[SEAL_NAME_MAX];
    seal_name(&telemetry->key, key_name);
    used += snprintf(text + used, sizeof text - (size_t)used, "# key: %s\n", key_name);
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
    uint8_t bytes[LCM_LOG_MAX_BYTES];
    send_bytes(telemetry, report->utime_us, "RUN", bytes,
               turbopi_run_t_encode(bytes, 0, sizeof bytes, &run));
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
    uint8_t bytes[MESSAGE_MAX_BYTES];
    send_bytes(telemetry, report->utime_us, "TELEMETRY", bytes,
               turbopi_telemetry_t_encode(bytes, 0, sizeof bytes, &message));
}

// Signs a message that ends in its tag, and sends it.
static void send_signed(struct telemetry *telemetry, int64_t utime_us, const char *suffix,
                        uint8_t *bytes, int size)
{
    if (size > 0)
    {
        seal_sign(&telemetry->key, bytes, (size_t)size);
    }
    send_bytes(telemetry, utime_us, suffix, bytes, size);
}

static void publish_link(struct telemetry *telemetry, const struct link_report *report)
{
    uint8_t bytes[MESSAGE_MAX_BYTES];
    const turbopi_link_t message = {
        .utime_us = report->utime_us,
        .robot_id = telemetry->config->robot_id,
        .session = telemetry->session,
        .session_us = report->session_us,
        .counter = report->counter,
        .mode = report->out.mode,
        .stands = report->stands,
        .armed = (report->status_flags & LINK_STATUS_LATCHED) == 0,
        .link_timeout_ms = report->link_timeout_ms,
        .status_flags = report->status_flags,
    };
    send_signed(telemetry, report->utime_us, "LINK", bytes,
                turbopi_link_t_encode(bytes, 0, sizeof bytes, &message));
}

static void publish_signed_ack(struct telemetry *telemetry, const struct link_ack *ack,
                               char *reason)
{
    uint8_t bytes[MESSAGE_MAX_BYTES];
    const turbopi_signed_ack_t message = {
        .utime_us = ack->utime_us,
        .robot_id = telemetry->config->robot_id,
        .session = telemetry->session,
        .session_us = ack->session_us,
        .command_utime_us = ack->command_utime_us,
        .seq = ack->seq,
        .verb = ack->verb,
        .accepted = ack->accepted,
        .stands = ack->stands,
        .reason = reason,
    };
    send_signed(telemetry, ack->utime_us, "SIGNED_ACK", bytes,
                turbopi_signed_ack_t_encode(bytes, 0, sizeof bytes, &message));
}

// What a robot plays is shown, and logged, as it is now.
static void note_behavior(struct telemetry *telemetry, const struct link_report *report)
{
    if (strncmp(telemetry->behavior, report->behavior, sizeof telemetry->behavior) == 0)
    {
        return;
    }
    const bool is_first = telemetry->behavior[0] == '\0';
    memcpy(telemetry->behavior, report->behavior, sizeof telemetry->behavior);
    telemetry->next_run_us = report->utime_us;
    telemetry->change_end_us = is_first ? 0 : report->session_us + CHANGE_US;
}

void telemetry_publish(struct telemetry *telemetry, const struct link_report *report)
{
    if (!is_connected(telemetry))
    {
        ++*losses(telemetry);
        return;
    }
    note_behavior(telemetry, report);
    if (report->utime_us >= telemetry->next_run_us ||
        report->utime_us < telemetry->next_run_us - RUN_PERIOD_US)
    {
        const bool is_change = report->session_us < telemetry->change_end_us;
        publish_run(telemetry, report);
        telemetry->next_run_us = report->utime_us + (is_change ? CHANGE_PERIOD_US : RUN_PERIOD_US);
    }
    publish_step(telemetry, report);
    if (report->session_us >= telemetry->next_link_us)
    {
        publish_link(telemetry, report);
        telemetry->next_link_us = report->session_us + LINK_PERIOD_US;
    }
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
    if (is_connected(telemetry))
    {
        uint8_t bytes[MESSAGE_MAX_BYTES];
        send_bytes(telemetry, ack->utime_us, "ACK", bytes,
                   turbopi_ack_t_encode(bytes, 0, sizeof bytes, &message));
        publish_signed_ack(telemetry, ack, reason);
    }
}

void telemetry_close(struct telemetry *telemetry)
{
    if (telemetry->lcm != NULL)
    {
        lcm_destroy(telemetry->lcm);
        telemetry->lcm = NULL;
    }
    whole_file_close(&telemetry->log.file);
}
