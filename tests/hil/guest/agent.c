// SPDX-License-Identifier: Apache-2.0
#include "agent.h"

#include <arpa/inet.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/reboot.h>
#include <sys/signalfd.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define PORT_NAME "hil.0"
#define PORT_PATIENCE_MS 10000
#define LCM_GROUP "239.255.76.67"
#define LCM_PORT 7667
#define PACKET_MAX_BYTES 65536
// The guest looks at its clock so often, and says when it could not for so long: whoever emulates
// it had other work.
#define LOOK_MS 10
#define STOOD_STILL_NS 30000000

static int port, board, bus, dead_children;

uint64_t now_ns(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000 + (uint64_t)now.tv_nsec;
}

void complain(const char *what)
{
    (void)fprintf(stderr, "hil agent: %s: %s\n", what, strerror(errno));
}

static _Noreturn void die(const char *what)
{
    complain(what);
    _exit(1);
}

static void receive(void *to, size_t length)
{
    for (size_t got = 0; got < length;)
    {
        const ssize_t more = read(port, (uint8_t *)to + got, length - got);
        if (more < 0 && errno != EINTR)
        {
            die("reading the port");
        }
        if (more == 0)
        {
            (void)poll(NULL, 0, 5);  // the host is not there yet
        }
        got += more > 0 ? (size_t)more : 0;
    }
}

static void send_message(uint8_t type, const void *payload, size_t length)
{
    static uint8_t message[sizeof(struct agent_header) + PACKET_MAX_BYTES];
    const struct agent_header header = {.type = type, .length = (uint32_t)length};
    memcpy(message, &header, sizeof header);
    memcpy(message + sizeof header, payload, length);
    for (size_t sent = 0; sent < sizeof header + length;)
    {
        const ssize_t more = write(port, message + sent, sizeof header + length - sent);
        if (more < 0 && errno != EINTR)
        {
            die("writing the port");
        }
        sent += more > 0 ? (size_t)more : 0;
    }
}

// Words with = before the program's path go into its environment.
static char **take_environment(char **arguments)
{
    while (strchr(*arguments, '=') != NULL)
    {
        (void)putenv(*arguments++);
    }
    return arguments;
}

// @param error what the program has as stderr; -1: the console.
static int spawn(char **arguments, int error)
{
    const pid_t pid = fork();
    if (pid == 0)
    {
        arguments = take_environment(arguments);
        if (error >= 0)
        {
            (void)dup2(error, STDERR_FILENO);
        }
        sigset_t none;
        sigemptyset(&none);
        (void)sigprocmask(SIG_SETMASK, &none, NULL);
        (void)setsid();
        (void)execv(arguments[0], arguments);
        die(arguments[0]);
    }
    return pid;
}

// @return the number that a file holds. The file goes.
static long take_number(const char *path)
{
    long number = -1;
    FILE *file = fopen(path, "r");
    if (file != NULL)
    {
        (void)!fscanf(file, "%ld", &number);
        (void)fclose(file);
        (void)unlink(path);
    }
    return number;
}

static bool has_name(long pid, const char *name)
{
    char path[64], got[32] = "";
    (void)snprintf(path, sizeof path, "/proc/%ld/comm", pid);
    FILE *file = fopen(path, "r");
    const bool has = file != NULL && fscanf(file, "%31s", got) == 1 && strcmp(got, name) == 0;
    if (file != NULL)
    {
        (void)fclose(file);
    }
    return has;
}

// @return the newest child of a process that goes by a name.
static long child_of(const char *pid, const char *name)
{
    char path[64];
    long child = -1, next;
    (void)snprintf(path, sizeof path, "/proc/%s/task/%s/children", pid, pid);
    FILE *children = fopen(path, "r");
    while (children != NULL && fscanf(children, "%ld", &next) == 1)
    {
        child = has_name(next, name) ? next : child;
    }
    if (children != NULL)
    {
        (void)fclose(children);
    }
    errno = ESRCH;
    return child;
}

// A pipe that takes no byte more, and that nobody reads.
static int full_pipe(void)
{
    int fds[2];
    const char bytes[4096] = {0};
    if (pipe(fds) != 0)
    {
        return -1;
    }
    (void)fcntl(fds[1], F_SETFL, O_NONBLOCK);
    while (write(fds[1], bytes, sizeof bytes) > 0)
    {
    }
    (void)fcntl(fds[1], F_SETFL, 0);
    return fds[1];
}

static int write_text(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    const int result = file != NULL && fputs(text, file) >= 0 ? 0 : -1;
    return file != NULL && fclose(file) != 0 ? -1 : result;
}

// A signal, and the processes that get it, one right after the other. Whoever saw another end may
// be done before its own signal comes.
// @return how many got it, or -1 and errno.
static long signal_all(char **word, int count)
{
    const int number = atoi(word[0]);
    long reached = 0;
    for (int i = 1; i < count; ++i)
    {
        const bool got_it = kill(atoi(word[i]), number) == 0;
        if (!got_it && errno != ESRCH)
        {
            return -1;
        }
        reached += got_it;
    }
    return reached;
}

// Commands of words: their number follows from what they are.
static long obey_words(uint8_t type, char **word, int count)
{
    switch (type)
    {
        case 'x': return count > 0 ? spawn(word, -1) : -1;
        case 'y': return count > 0 ? spawn(word, full_pipe()) : -1;
        case 'n': return count == 1 ? take_number(word[0]) : -1;
        case 'w': return count == 2 ? write_text(word[0], word[1]) : -1;
        case 'k': return count > 1 ? signal_all(word, count) : -1;
        case 'd': return count == 2 ? child_of(word[0], word[1]) : -1;
        case 'o': return count == 3 ? camera_open(word[0], atoi(word[1]), atoi(word[2])) : -1;
        case 'c': return count == 3 ? camera_control(word[0], word[1], word[2]) : -1;
        case 'l': return count == 2 ? load_module(word[0], word[1]) : -1;
        case 'u': return count == 1 ? syscall(SYS_delete_module, word[0], O_NONBLOCK) : -1;
        case 'q': return reboot(RB_POWER_OFF);
        default: errno = ENOSYS; return -1;
    }
}

static long obey(uint8_t type, uint8_t *payload, size_t length)
{
    switch (type)
    {
        case 'f': return camera_write(payload, length);
        case 'b': return write(board, payload, length);
        default: break;
    }
    char *words[AGENT_MAX_ARGUMENTS + 1] = {NULL};
    int count = 0;
    for (size_t at = 0; at < length && count < AGENT_MAX_ARGUMENTS;
         at += strlen((char *)payload + at) + 1)
    {
        words[count++] = (char *)payload + at;
    }
    return obey_words(type, words, count);
}

// Does one command and says when it began and what came of it.
static void take_command(void)
{
    static uint8_t payload[2 * 1280 * 1024 + 1];
    struct agent_header header;
    receive(&header, sizeof header);
    if (header.length >= sizeof payload)
    {
        errno = EMSGSIZE;
        die("command");
    }
    receive(payload, header.length);
    payload[header.length] = '\0';
    struct
    {
        int64_t result;
        uint64_t t_ns;
    } answer = {.t_ns = now_ns()};
    answer.result = obey(header.type, payload, header.length);
    answer.result = answer.result < 0 ? -errno : answer.result;
    send_message('a', &answer, sizeof answer);
}

static void report_board(void)
{
    uint8_t event[32];
    while (read(board, event, sizeof event) == sizeof event)
    {
        send_message('h', event, sizeof event);
    }
}

// What the board was told before a packet went out is reported before it, too.
static void report_packet(void)
{
    static uint8_t packet[PACKET_MAX_BYTES];
    const ssize_t length = recv(bus, packet, sizeof packet, MSG_DONTWAIT);
    report_board();
    if (length > 0)
    {
        send_message('t', packet, (size_t)length);
    }
}

// What the board was told before a process ended is reported before its end, too.
static void report_dead_children(void)
{
    struct signalfd_siginfo info;
    (void)!read(dead_children, &info, sizeof info);
    struct
    {
        int32_t pid, status;
        uint64_t t_ns;
    } end;
    int status;
    while ((end.pid = waitpid(-1, &status, WNOHANG)) > 0)
    {
        end.status = status;
        end.t_ns = now_ns();
        report_board();
        send_message('e', &end, sizeof end);
    }
}

static void report_standstill(void)
{
    const uint64_t stood[] = {now_ns(), standstill_take_ns()};
    if (stood[1] > 0)
    {
        send_message('s', stood, sizeof stood);
    }
}

// The port that QEMU gave our name; it comes up late.
static int open_port(void)
{
    for (int waited_ms = 0; waited_ms < PORT_PATIENCE_MS; waited_ms += 50)
    {
        DIR *ports = opendir("/sys/class/virtio-ports");
        for (struct dirent *entry; ports != NULL && (entry = readdir(ports)) != NULL;)
        {
            char path[300], name[16] = "";
            (void)snprintf(path, sizeof path, "/sys/class/virtio-ports/%s/name", entry->d_name);
            FILE *file = fopen(path, "r");
            if (file == NULL)
            {
                continue;
            }
            const char *got = fgets(name, sizeof name, file);
            (void)fclose(file);
            if (got != NULL && strncmp(name, PORT_NAME, strlen(PORT_NAME)) == 0)
            {
                (void)snprintf(path, sizeof path, "/dev/%s", entry->d_name);
                return open(path, O_RDWR | O_CLOEXEC);
            }
        }
        (void)poll(NULL, 0, 50);
    }
    return -1;
}

static int open_bus(void)
{
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), on = 1;
    const struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(LCM_PORT)};
    const struct ip_mreq group = {.imr_multiaddr.s_addr = inet_addr(LCM_GROUP),
                                  .imr_interface.s_addr = htonl(INADDR_LOOPBACK)};
    (void)setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    const bool joined = bind(fd, (const struct sockaddr *)&address, sizeof address) == 0 &&
                        setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) == 0;
    return joined ? fd : -1;
}

static int watch_children(void)
{
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGCHLD);
    (void)sigprocmask(SIG_BLOCK, &signals, NULL);
    return signalfd(-1, &signals, SFD_NONBLOCK | SFD_CLOEXEC);
}

int main(void)
{
    if (getpid() == 1)
    {
        boot_mount();
    }
    boot_load_modules();
    boot_join_multicast_to_lo();
    port = open_port();
    board = open("/dev/hilboard", O_RDWR | O_NONBLOCK | O_CLOEXEC);
    bus = open_bus();
    dead_children = watch_children();
    if (port < 0 || board < 0 || bus < 0 || dead_children < 0 || !standstill_watch())
    {
        die("port, board, bus or a thread");
    }
    send_message('r', "", 0);
    for (;;)
    {
        struct pollfd fds[] = {{.fd = port, .events = POLLIN},
                               {.fd = board, .events = POLLIN},
                               {.fd = bus, .events = POLLIN},
                               {.fd = dead_children, .events = POLLIN}};
        (void)poll(fds, 4, -1);
        report_standstill();
        void (*const take[])(void) = {take_command, report_board, report_packet,
                                      report_dead_children};
        for (int i = 3; i >= 0; --i)
        {
            if (fds[i].revents & POLLIN)
            {
                take[i]();
            }
        }
    }
}
