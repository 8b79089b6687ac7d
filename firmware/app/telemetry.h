// SPDX-License-Identifier: Apache-2.0
// Reports and answers to LCM, which never hears anything here: see radio.h. It takes heap, threads
// and time: only the reporter's thread calls these.
#ifndef APP_TELEMETRY_H
#define APP_TELEMETRY_H

#include <lcm/lcm.h>

#include "config.h"
#include "lcm_log.h"
#include "link.h"
#include "radio/seal.h"

struct telemetry
{
    const struct app_config *config;
    struct seal_key key;
    int64_t session;
    // NULL while there is no network, or where a log takes its place.
    lcm_t *lcm;
    struct lcm_log log;
    int64_t next_create_us, next_run_us, next_link_us;
    // What the newest R<nn>_RUN said is played, and until when that is told often.
    char behavior[LINK_NAME_MAX];
    int64_t change_end_us;
    // Messages that no network took; the log counts its own.
    uint32_t unsent_count;
};

// @param config lives as long as telemetry. @param session as in link.h.
void telemetry_init(struct telemetry *telemetry, const struct app_config *config,
                    const struct seal_key *key, int64_t session);

// Connects if that is due. May take seconds.
void telemetry_connect(struct telemetry *telemetry, int64_t now_us);

// R<nn>_TELEMETRY, R<nn>_LINK ten times a second, R<nn>_RUN every 5 s, and at once where it plays
// something else; lost without a network.
void telemetry_publish(struct telemetry *telemetry, const struct link_report *report);
void telemetry_publish_ack(struct telemetry *telemetry, const struct link_ack *ack);

// Messages to a log file, unlike those to a network, are not to be lost: tells whether any was.
bool telemetry_has_lost_log(const struct telemetry *telemetry);

void telemetry_close(struct telemetry *telemetry);

#endif
