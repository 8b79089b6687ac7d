// SPDX-License-Identifier: Apache-2.0
#include "reporter.h"

#include <poll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "say.h"

#define STACK_BYTES (256 * 1024)
#define LONGEST_WAIT_MS 500
#define LOG_PERIOD_US 2000000

// From the loop to the thread.
struct message
{
    enum
    {
        MESSAGE_REPORT,
        MESSAGE_ACK,
    } kind;
    union
    {
        struct link_report report;
        struct link_ack ack;
    };
};

static bool send_message(const struct reporter *reporter, const struct message *message)
{
    return send(reporter->loop_fd, message, sizeof *message, MSG_DONTWAIT | MSG_NOSIGNAL) ==
           sizeof *message;
}

static bool send_report(void *context, const struct link_report *report)
{
    const struct message message = {.kind = MESSAGE_REPORT, .report = *report};
    return send_message(context, &message);
}

static void send_ack(void *context, const struct link_ack *ack)
{
    // A lost acknowledgement is asked for again by who wants it.
    const struct message message = {.kind = MESSAGE_ACK, .ack = *ack};
    (void)send_message(context, &message);
}

static bool receive(void *context, struct link_command *command)
{
    const struct reporter *reporter = context;
    return recv(reporter->loop_fd, command, sizeof *command, MSG_DONTWAIT) == sizeof *command;
}

static int64_t monotonic_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

// A log that cannot be opened, as on a card that is full or read-only, is tried again: the robot
// stays on the network all the same.
static void keep_io_tsv(struct reporter *reporter)
{
    const struct app_config *config = reporter->config;
    const int64_t now_us = monotonic_us();
    if (config->io_tsv[0] != '\0' && reporter->io_tsv.fd < 0 && now_us >= reporter->io_tsv_us)
    {
        (void)io_tsv_open(&reporter->io_tsv, config->io_tsv, config->vote_frames);
        reporter->io_tsv_us = now_us + LOG_PERIOD_US;
    }
}

static bool has_lost_rows(const struct reporter *reporter)
{
    return reporter->io_tsv.lost_count > 0 || telemetry_has_lost_log(&reporter->telemetry);
}

static void pass_on(struct reporter *reporter, const struct message *message)
{
    if (message->kind == MESSAGE_ACK)
    {
        telemetry_publish_ack(&reporter->telemetry, &message->ack);
        return;
    }
    struct link_report report = message->report;
    const bool is_double = radio_hears_double(&reporter->radio);
    if (is_double && !reporter->is_double)
    {
        say("another robot of this number is on the network: give one of them another");
    }
    reporter->is_double = is_double;
    report.status_flags |= LINK_STATUS_TELLS_START | (is_double ? LINK_STATUS_DOUBLE : 0);
    report.ignored_count = atomic_load(&reporter->radio.ignored_count);
    report.status_flags |= has_lost_rows(reporter) ? LINK_STATUS_LOG_LOST : 0;
    telemetry_publish(&reporter->telemetry, &report);
    if (reporter->config->io_tsv[0] != '\0')
    {
        io_tsv_add(&reporter->io_tsv, &report);
    }
}

static void *run(void *context)
{
    struct reporter *reporter = context;
    ssize_t got = -1;
    // 0 bytes: the loop's side is closed, and all that it sent has been read.
    while (got != 0)
    {
        telemetry_connect(&reporter->telemetry, monotonic_us());
        keep_io_tsv(reporter);
        struct pollfd report = {.fd = reporter->thread_fd, .events = POLLIN};
        (void)poll(&report, 1, LONGEST_WAIT_MS);
        struct message message;
        got = recv(reporter->thread_fd, &message, sizeof message, MSG_DONTWAIT);
        if (got == sizeof message)
        {
            pass_on(reporter, &message);
        }
    }
    return NULL;
}

static bool start_thread(struct reporter *reporter)
{
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes) != 0)
    {
        return false;
    }
    const bool started = pthread_attr_setstacksize(&attributes, STACK_BYTES) == 0 &&
                         pthread_create(&reporter->thread, &attributes, run, reporter) == 0;
    (void)pthread_attr_destroy(&attributes);
    return started;
}

static void release(struct reporter *reporter)
{
    telemetry_close(&reporter->telemetry);
    whole_file_close(&reporter->io_tsv);
    (void)close(reporter->loop_fd);
    (void)close(reporter->thread_fd);
}

enum fw_err reporter_start(struct reporter *reporter, const struct app_config *config,
                           const struct seal_key *key, struct link *link)
{
    const int64_t session = seal_random();
    int fds[2];
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, fds) != 0)
    {
        return FW_ERR_IO;
    }
    reporter->loop_fd = fds[0];
    reporter->thread_fd = fds[1];
    reporter->config = config;
    reporter->io_tsv = (struct whole_file){.fd = -1};
    reporter->io_tsv_us = 0;
    telemetry_init(&reporter->telemetry, config, key, session);
    bool ok = radio_start(&reporter->radio, config, key, session, reporter->thread_fd);
    if (ok && !start_thread(reporter))
    {
        radio_stop(&reporter->radio);
        ok = false;
    }
    if (!ok)
    {
        release(reporter);
        return FW_ERR_IO;
    }
    *link = (struct link){.context = reporter,
                          .send_report = send_report,
                          .send_ack = send_ack,
                          .receive = receive,
                          .fd = reporter->loop_fd,
                          .session = session};
    seal_name(key, link->key_name);
    return FW_OK;
}

bool reporter_stop(struct reporter *reporter)
{
    radio_stop(&reporter->radio);
    (void)shutdown(reporter->loop_fd, SHUT_WR);
    (void)pthread_join(reporter->thread, NULL);
    release(reporter);
    return !has_lost_rows(reporter);
}
