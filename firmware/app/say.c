// SPDX-License-Identifier: Apache-2.0
#include "say.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <unistd.h>

#define LINE_MAX_BYTES 512
// For a reader that takes nothing, after the last who could speak has ended.
#define LAST_WORDS_MS 1000

static _Atomic int lost_count;

// Waits until the reader takes something. @return false if it does not, and nobody speaks any more.
static bool reader_takes(int from, int reader)
{
    struct pollfd fds[] = {{.fd = reader, .events = POLLOUT}, {.fd = from}};
    for (;;)
    {
        (void)poll(fds, 2, -1);
        if (fds[0].revents != 0)
        {
            return true;
        }
        if (fds[1].revents & POLLHUP)
        {
            return poll(fds, 1, LAST_WORDS_MS) > 0;
        }
    }
}

// Ends when the last process that holds the other end of the pipe does.
static _Noreturn void relay(int from, int reader)
{
    sigset_t all;
    sigfillset(&all);
    (void)sigprocmask(SIG_BLOCK, &all, NULL);
    // killall turbopi spares it.
    (void)prctl(PR_SET_NAME, "stderr-relay");
    char bytes[PIPE_BUF];
    ssize_t got;
    while ((got = read(from, bytes, sizeof bytes)) > 0)
    {
        for (ssize_t sent = 0; sent < got;)
        {
            const ssize_t more =
                reader_takes(from, reader) ? write(reader, bytes + sent, (size_t)(got - sent)) : -1;
            if (more < 0 && errno != EAGAIN)
            {
                _exit(0);
            }
            sent += more > 0 ? more : 0;
        }
    }
    _exit(0);
}

bool say_never_wait(void)
{
    int fds[2];
    if (pipe2(fds, O_CLOEXEC) != 0)
    {
        return false;
    }
    // Who reads no more is no reason to die, nor is a file that may not grow.
    (void)signal(SIGPIPE, SIG_IGN);
    (void)signal(SIGXFSZ, SIG_IGN);
    const pid_t pid = fork();
    if (pid == 0)
    {
        (void)close(fds[1]);
        relay(fds[0], STDERR_FILENO);
    }
    const bool ok = pid > 0 && fcntl(fds[1], F_SETFL, O_NONBLOCK) == 0 &&
                    dup2(fds[1], STDERR_FILENO) == STDERR_FILENO;
    (void)close(fds[0]);
    (void)close(fds[1]);
    return ok;
}

// @return false if it was not taken.
static bool put(const char *line, int length)
{
    return write(STDERR_FILENO, line, (size_t)length) == length;
}

void say(const char *format, ...)
{
    char line[LINE_MAX_BYTES] = "turbopi: ";
    const int name_length = (int)strlen(line);
    va_list arguments;
    va_start(arguments, format);
    int length =
        vsnprintf(line + name_length, sizeof line - (size_t)name_length, format, arguments);
    va_end(arguments);
    length = name_length + (length < 0 ? 0 : length);
    length = length < LINE_MAX_BYTES - 1 ? length : LINE_MAX_BYTES - 2;
    line[length++] = '\n';
    if (lost_count > 0)
    {
        char gap[64];
        const int gap_length =
            snprintf(gap, sizeof gap, "turbopi: (%d messages before are lost)\n", lost_count);
        lost_count = put(gap, gap_length) ? 0 : lost_count;
    }
    lost_count += !put(line, length);
}
