// SPDX-License-Identifier: Apache-2.0
#include "radio.h"

#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "radio/lcm_packet.h"
#include "radio/wire.h"

#define STACK_BYTES (256 * 1024)
// News of networks may be lost.
#define ASK_PERIOD_MS 5000
#define DOUBLE_US 3000000
#define REFUSAL_PERIOD_US 20000

static int64_t monotonic_us(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

// Signed for this run of the program, and made after all of these before.
static bool is_new(struct radio *radio, const struct fw_command *order)
{
    const bool is = order->seal == FW_SEAL_GOOD && order->session == radio->session &&
                    order->made_us > radio->made_us;
    radio->made_us = is ? order->made_us : radio->made_us;
    return is;
}

// Whoever shouts what is not obeyed, or says again what was heard, gets an answer now and then, and
// never fills the way of a stop.
static bool is_worth_an_answer(struct radio *radio, const struct fw_command *order)
{
    if (order->verb == FW_VERB_STOP || is_new(radio, order))
    {
        return true;
    }
    const int64_t now_us = monotonic_us();
    const bool due = now_us >= radio->refusal_us;
    radio->refusal_us = due ? now_us + REFUSAL_PERIOD_US : radio->refusal_us;
    return due;
}

static void pass_on(struct radio *radio, const struct wire_command *heard)
{
    _Static_assert(WIRE_NAME_MAX == LINK_NAME_MAX, "names are copied whole");
    if (heard->robot_id != WIRE_ALL_ROBOTS && heard->robot_id != radio->robot_id)
    {
        return;
    }
    if (!is_worth_an_answer(radio, &heard->order))
    {
        atomic_fetch_add(&radio->ignored_count, 1);
        return;
    }
    struct link_command command = {.order = heard->order};
    memcpy(command.name, heard->name, sizeof command.name);
    (void)send(radio->command_fd, &command, sizeof command, MSG_DONTWAIT | MSG_NOSIGNAL);
}

// A start for another robot is none of ours, though it is signed with a key that is not ours.
static bool is_for_another(const struct radio *radio, const struct lcm_packet *packet)
{
    int32_t robot_id;
    return wire_peek_robot(packet->data, packet->size, &robot_id) && robot_id != radio->robot_id;
}

static void hear(struct radio *radio, const struct lcm_packet *packet)
{
    struct wire_command command;
    int64_t session;
    if (strcmp(packet->channel, radio->link_channel) == 0)
    {
        if (wire_peek_session(packet->data, packet->size, &session) && session != radio->session)
        {
            atomic_store(&radio->double_us, monotonic_us());
        }
        return;
    }
    const bool is_plain = strcmp(packet->channel, WIRE_COMMAND_CHANNEL) == 0;
    const bool is_signed = strcmp(packet->channel, WIRE_SIGNED_CHANNEL) == 0;
    if ((!is_plain && !is_signed) || (is_signed && is_for_another(radio, packet)))
    {
        return;
    }
    if (is_plain ? wire_read_command(packet->data, packet->size, &command)
                 : wire_read_signed(packet->data, packet->size, &radio->key, &command))
    {
        pass_on(radio, &command);
    }
    else
    {
        atomic_fetch_add(&radio->ignored_count, 1);
    }
}

static void *run(void *context)
{
    static uint8_t datagram[MULTICAST_DATAGRAM_MAX];
    struct radio *radio = context;
    struct pollfd fds[] = {{.fd = radio->ear.fd, .events = POLLIN},
                           {.fd = radio->ear.news_fd, .events = POLLIN},
                           {.fd = radio->end_fd, .events = POLLIN}};
    int64_t ask_us = 0;
    while (fds[2].revents == 0)
    {
        (void)poll(fds, 3, ASK_PERIOD_MS);
        if (monotonic_us() >= ask_us)
        {
            multicast_ask(&radio->ear);
            ask_us = monotonic_us() + (int64_t)ASK_PERIOD_MS * 1000;
        }
        multicast_renew(&radio->ear);
        const ssize_t got = multicast_take(&radio->ear, datagram, sizeof datagram);
        struct lcm_packet packet;
        if (got > 0 && lcm_packet_read(datagram, (size_t)got, &packet))
        {
            hear(radio, &packet);
        }
    }
    return NULL;
}

static bool start_thread(struct radio *radio)
{
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes) != 0)
    {
        return false;
    }
    const bool started = pthread_attr_setstacksize(&attributes, STACK_BYTES) == 0 &&
                         pthread_create(&radio->thread, &attributes, run, radio) == 0;
    (void)pthread_attr_destroy(&attributes);
    return started;
}

bool radio_start(struct radio *radio, const struct app_config *config, const struct seal_key *key,
                 int64_t session, int command_fd)
{
    struct in_addr group;
    uint16_t port;
    *radio = (struct radio){.hears = multicast_parse(config->lcm_url, &group, &port),
                            .command_fd = command_fd,
                            .robot_id = config->robot_id,
                            .session = session,
                            .key = *key};
    if (!radio->hears)
    {
        return true;
    }
    (void)snprintf(radio->link_channel, sizeof radio->link_channel, "R%02d_LINK",
                   (int)(config->robot_id % 100));
    radio->end_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (radio->end_fd < 0)
    {
        return false;
    }
    if (!multicast_open(&radio->ear, group, port))
    {
        (void)close(radio->end_fd);
        return false;
    }
    if (!start_thread(radio))
    {
        multicast_close(&radio->ear);
        (void)close(radio->end_fd);
        return false;
    }
    return true;
}

bool radio_hears_double(const struct radio *radio)
{
    const int64_t heard_us = atomic_load(&radio->double_us);
    return heard_us != 0 && monotonic_us() - heard_us < DOUBLE_US;
}

void radio_stop(struct radio *radio)
{
    if (!radio->hears)
    {
        return;
    }
    (void)eventfd_write(radio->end_fd, 1);
    (void)pthread_join(radio->thread, NULL);
    multicast_close(&radio->ear);
    (void)close(radio->end_fd);
}
