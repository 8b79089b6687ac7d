// SPDX-License-Identifier: Apache-2.0
// Reports to LCM, commands from it. LCM takes heap, threads and time: only the reporter's thread
// calls these.
#ifndef APP_TELEMETRY_H
#define APP_TELEMETRY_H

#include <lcm/lcm.h>

#include "config.h"
#include "link.h"

// Called for every command to this robot.
typedef void telemetry_command_fn(void *context, const struct link_command *command);

struct telemetry
{
    const struct app_config *config;
    telemetry_command_fn *on_command;
    void *context;
    // NULL while there is no network.
    lcm_t *lcm;
    int64_t next_create_us, next_run_us;
    // Messages that LCM did not take.
    uint32_t unsent_count;
};

// @param config and context live as long as telemetry.
void telemetry_init(struct telemetry *telemetry, const struct app_config *config,
                    telemetry_command_fn *on_command, void *context);

// Connects if that is due. May take seconds.
void telemetry_connect(struct telemetry *telemetry, int64_t now_us);

// R<nn>_TELEMETRY, and R<nn>_RUN every 5 s; lost without a network.
void telemetry_publish(struct telemetry *telemetry, const struct link_report *report);
void telemetry_publish_ack(struct telemetry *telemetry, const struct link_ack *ack);

// @return readable when telemetry_handle() has something to do; -1: never.
int telemetry_fd(const struct telemetry *telemetry);
void telemetry_handle(struct telemetry *telemetry);

// Messages to a log file, unlike those to a network, are not to be lost: tells whether any was.
bool telemetry_has_lost_log(const struct telemetry *telemetry);

void telemetry_close(struct telemetry *telemetry);

#endif
