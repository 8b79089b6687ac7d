// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/app/reporter.c: the loop never waits for the network.
#include "reporter.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <turbopi_signed_command_t.h>
#include <turbopi_swarm_command_t.h>
#include <unistd.h>

#include "radio/wire.h"

#include "unity.h"

// Fixture

static struct app_config config;
static struct reporter reporter;
static struct link to_loop;
static const struct seal_key no_key;

void setUp(void)
{
    config_default(&config);
    strcpy(config.lcm_url, "");
}

void tearDown(void) {}

static int64_t now_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

// Of this process alone: the same tests may run beside it.
static int port(void)
{
    return 20000 + getpid() % 10000;
}

static void pause_ms(int duration_ms)
{
    (void)nanosleep(&(struct timespec){.tv_nsec = duration_ms * 1000000L}, NULL);
}

struct datagram
{
    uint8_t bytes[512];
    size_t size;
};

// A whole LCM message of one packet: "LC02", number, channel, data.
static uint8_t *address_to(struct datagram *datagram, const char *channel)
{
    memcpy(datagram->bytes, "LC02\0\0\0\1", 8);
    memcpy(datagram->bytes + 8, channel, strlen(channel) + 1);
    datagram->size = 8 + strlen(channel) + 1;
    return datagram->bytes + datagram->size;
}

static struct datagram make_stop(void)
{
    struct datagram datagram;
    uint8_t *data = address_to(&datagram, WIRE_COMMAND_CHANNEL);
    const turbopi_swarm_command_t order = {
        .robot_id = WIRE_ALL_ROBOTS, .verb = FW_VERB_STOP, .behavior = ""};
    datagram.size += (size_t)turbopi_swarm_command_t_encode(data, 0, 256, &order);
    return datagram;
}

static struct datagram make_start(const struct seal_key *key, int64_t session)
{
    struct datagram datagram;
    uint8_t inner[128], *data = address_to(&datagram, WIRE_SIGNED_CHANNEL);
    const turbopi_swarm_command_t order = {.verb = FW_VERB_START, .behavior = ""};
    turbopi_signed_command_t message = {.session = session, .made_us = 1, .command = inner};
    message.command_size = turbopi_swarm_command_t_encode(inner, 0, sizeof inner, &order);
    const int size = turbopi_signed_command_t_encode(data, 0, 256, &message);
    seal_sign(key, data, (size_t)size);
    datagram.size += (size_t)size;
    return datagram;
}

// To this machine alone, some at a time so that the socket holds them.
static void say_again_and_again(const struct datagram *datagram, int count)
{
    const struct sockaddr_in here = {.sin_family = AF_INET,
                                     .sin_port = htons((uint16_t)port()),
                                     .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const int fd = socket(AF_INET, SOCK_DGRAM, 0);
    for (int i = 0; i < count; ++i)
    {
        (void)sendto(fd, datagram->bytes, datagram->size, 0, (const struct sockaddr *)&here,
                     sizeof here);
        if (i % 20 == 19)
        {
            pause_ms(2);
        }
    }
    (void)close(fd);
}

// Test

// The loop is slower than who repeats, as fast as the radio takes it, a start that was signed.
static void test_commands_said_again_do_not_fill_the_way_of_a_stop(void)
{
    struct seal_key key = {.present = true};
    (void)snprintf(config.lcm_url, sizeof config.lcm_url, "udpm://239.255.76.67:%d?ttl=0", port());
    TEST_ASSERT_EQUAL(FW_OK, reporter_start(&reporter, &config, &key, &to_loop));
    const struct datagram start = make_start(&key, to_loop.session), stop = make_stop();
    say_again_and_again(&start, 2000);
    pause_ms(100);
    say_again_and_again(&stop, 20);
    pause_ms(100);
    int starts = 0, stops = 0;
    for (struct link_command heard; to_loop.receive(to_loop.context, &heard);)
    {
        starts += heard.order.verb == FW_VERB_START && heard.order.seal == FW_SEAL_GOOD;
        stops += heard.order.verb == FW_VERB_STOP;
    }
    reporter_stop(&reporter);
    TEST_ASSERT_GREATER_THAN(0, starts);
    TEST_ASSERT_GREATER_THAN(0, stops);
}

// Ten minutes of steps at once: what the thread cannot take is lost, and the caller goes on.
static void test_flood_of_reports_is_dropped_and_told_to_the_loop(void)
{
    TEST_ASSERT_EQUAL(FW_OK, reporter_start(&reporter, &config, &no_key, &to_loop));
    const struct link_report report = {.utime_us = 1};
    int taken = 0, lost = 0;
    const int64_t begin_us = now_us();
    for (int i = 0; i < 18000; ++i)
    {
        const bool ok = to_loop.send_report(to_loop.context, &report);
        taken += ok;
        lost += !ok;
    }
    TEST_ASSERT_LESS_THAN_INT64(5000000, now_us() - begin_us);
    TEST_ASSERT_EQUAL(18000, taken + lost);
    TEST_ASSERT_GREATER_THAN(100, taken);
    struct link_command command;
    TEST_ASSERT_FALSE(to_loop.receive(to_loop.context, &command));
    reporter_stop(&reporter);
}

// A second's reports fit even if the thread is not run meanwhile.
static void test_second_of_reports_fits(void)
{
    TEST_ASSERT_EQUAL(FW_OK, reporter_start(&reporter, &config, &no_key, &to_loop));
    const struct link_report report = {.utime_us = 1};
    for (int i = 0; i < 30; ++i)
    {
        TEST_ASSERT_TRUE(to_loop.send_report(to_loop.context, &report));
    }
    reporter_stop(&reporter);
    // Without a bus all of them are counted as unsent.
    TEST_ASSERT_EQUAL(30, reporter.telemetry.unsent_count);
}

// As on a card that is read-only or full, which may end: a folder that is there only later.
static void test_log_that_cannot_be_opened_is_lost_and_begun_later(void)
{
    char folder[32] = "/tmp/test_reporter.XXXXXX", heading[8] = "";
    TEST_ASSERT_TRUE(mkdtemp(folder) != NULL && rmdir(folder) == 0);
    (void)snprintf(config.io_tsv, sizeof config.io_tsv, "%s/io.tsv", folder);
    TEST_ASSERT_EQUAL(FW_OK, reporter_start(&reporter, &config, &no_key, &to_loop));
    const struct link_report report = {.utime_us = 1};
    TEST_ASSERT_TRUE(to_loop.send_report(to_loop.context, &report));
    pause_ms(100);
    TEST_ASSERT_EQUAL(0, mkdir(folder, 0700));
    for (int i = 0; i < 30 && access(config.io_tsv, F_OK) != 0; ++i)
    {
        TEST_ASSERT_TRUE(to_loop.send_report(to_loop.context, &report));
        pause_ms(100);
    }
    TEST_ASSERT_FALSE(reporter_stop(&reporter));
    FILE *log = fopen(config.io_tsv, "r");
    TEST_ASSERT_TRUE(log != NULL && fgets(heading, sizeof heading, log) != NULL);
    TEST_ASSERT_EQUAL_STRING("time_ns", heading);
    TEST_ASSERT_EQUAL(0, fclose(log));
    TEST_ASSERT_TRUE(unlink(config.io_tsv) == 0 && rmdir(folder) == 0);
}

// In a file, how often some bytes stand.
static int count_in(const char *path, const char *word)
{
    static char text[1 << 20];
    FILE *file = fopen(path, "r");
    TEST_ASSERT_NOT_NULL(file);
    const size_t size = fread(text, 1, sizeof text, file);
    TEST_ASSERT_EQUAL(0, fclose(file));
    int count = 0;
    for (size_t i = 0; i + strlen(word) <= size; ++i)
    {
        count += memcmp(text + i, word, strlen(word)) == 0;
    }
    return count;
}

static void publish_steps(struct telemetry *telemetry, struct link_report *report, int count)
{
    for (int i = 0; i < count; ++i)
    {
        report->utime_us += 33000;
        report->session_us += 33000;
        telemetry_publish(telemetry, report);
    }
}

// Who looks on saw for up to 5 s what was chosen before; and one message may be lost.
static void test_what_is_played_is_told_as_soon_as_it_changes_and_again(void)
{
    char path[32] = "/tmp/test_reporter.XXXXXX";
    TEST_ASSERT_EQUAL(0, close(mkstemp(path)));
    (void)snprintf(config.lcm_url, sizeof config.lcm_url, "file://%s?mode=w", path);
    config.robot_id = 1;
    struct telemetry telemetry;
    struct link_report report = {.utime_us = 1000000, .session_us = 1, .behavior = "milling"};
    telemetry_init(&telemetry, &config, &no_key, 1);
    telemetry_connect(&telemetry, 1);
    publish_steps(&telemetry, &report, 60);
    TEST_ASSERT_EQUAL(1, count_in(path, "R01_RUN"));
    (void)snprintf(report.behavior, sizeof report.behavior, "diffusing_v2");
    publish_steps(&telemetry, &report, 1);
    TEST_ASSERT_EQUAL(2, count_in(path, "R01_RUN"));
    TEST_ASSERT_EQUAL(1, count_in(path, "diffusing_v2"));
    publish_steps(&telemetry, &report, 60);
    TEST_ASSERT_GREATER_OR_EQUAL(4, count_in(path, "diffusing_v2"));
    telemetry_close(&telemetry);
    TEST_ASSERT_EQUAL(0, unlink(path));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_commands_said_again_do_not_fill_the_way_of_a_stop);
    RUN_TEST(test_flood_of_reports_is_dropped_and_told_to_the_loop);
    RUN_TEST(test_second_of_reports_fits);
    RUN_TEST(test_log_that_cannot_be_opened_is_lost_and_begun_later);
    RUN_TEST(test_what_is_played_is_told_as_soon_as_it_changes_and_again);
    return UNITY_END();
}
