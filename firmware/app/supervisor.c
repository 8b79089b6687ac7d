// SPDX-License-Identifier: Apache-2.0
#include "supervisor.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "devices.h"
#include "notify.h"

// A worker that stands still may take its time: cameras are slow to open.
#define STILL_PATIENCE_MS 15000
// From being asked to end to being killed.
#define END_PATIENCE_MS 1000
#define STOP_TRIES 50
#define STOP_PAUSE_MS 20

struct worker
{
    pid_t pid;
    int heartbeat_fd;
    bool moving;
};

void heartbeat_send(const struct heartbeat *heartbeat, bool moving)
{
    const char beat = moving ? 'm' : 's';
    (void)!write(heartbeat->fd, &beat, 1);
}

static void pause_ms(int32_t duration_ms)
{
    (void)poll(NULL, 0, duration_ms);
}

static bool stop_once(struct app_config *config, const char *board, bool dry_run)
{
    struct loop_devices devices;
    char error[CONFIG_ERROR_MAX];
    if (board != NULL)
    {
        (void)snprintf(config->board, sizeof config->board, "%s", board);
    }
    if (!devices_make_board(config, dry_run, &devices, error))
    {
        return false;
    }
    const enum fw_err err = hal_motors_stop(&devices.motors);
    hal_motors_close(&devices.motors);
    return err == FW_OK;
}

bool stop_board(const struct options *options)
{
    struct app_config config = options->config;
    const bool is_known = strcmp(config.board, "auto") != 0;
    bool line_took_it = false;
    for (int tries = 0; tries < STOP_TRIES; ++tries)
    {
        // A board on I2C that refuses for a while must not be taken for the other one: a serial
        // line takes anything, so it is told as well, and believed only if I2C never answers.
        if (stop_once(&config, is_known ? NULL : "i2c", options->dry_run))
        {
            return true;
        }
        line_took_it = !is_known && stop_once(&config, "uart", options->dry_run);
        pause_ms(STOP_PAUSE_MS);
    }
    if (!line_took_it)
    {
        (void)fprintf(stderr,
                      "turbopi: motor board: does not take a stop: the wheels may turn: "
                      "switch the robot off\n");
    }
    return line_took_it;
}

// SIGTERM, SIGINT and SIGHUP as something to wait for. @return -1 and errno on failure.
static int block_signals(void)
{
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    sigaddset(&signals, SIGHUP);
    return sigprocmask(SIG_BLOCK, &signals, NULL) == 0
               ? signalfd(-1, &signals, SFD_NONBLOCK | SFD_CLOEXEC)
               : -1;
}

// In the child: dies with its parent, after having stopped the wheels.
static _Noreturn void become_worker(const struct options *options, worker_fn *worker, int beat_fd,
                                    pid_t parent, int stop_fd)
{
    (void)prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != parent)
    {
        _exit(1);
    }
    (void)signal(SIGPIPE, SIG_IGN);
    const struct heartbeat heartbeat = {beat_fd};
    exit(worker(options, &heartbeat, stop_fd));
}

static bool start_worker(const struct options *options, worker_fn *run, int stop_fd,
                         struct worker *worker)
{
    int fds[2];
    // Nobody waits for a reader that is late.
    if (pipe2(fds, O_CLOEXEC) != 0 || fcntl(fds[1], F_SETFL, O_NONBLOCK) != 0)
    {
        return false;
    }
    const pid_t parent = getpid();
    (void)fflush(NULL);
    worker->pid = fork();
    if (worker->pid == 0)
    {
        (void)close(fds[0]);
        become_worker(options, run, fds[1], parent, stop_fd);
    }
    (void)close(fds[1]);
    worker->heartbeat_fd = fds[0];
    worker->moving = false;
    if (worker->pid < 0)
    {
        (void)close(fds[0]);
        return false;
    }
    return true;
}

// @return false when the worker's end is closed: it is dead or dying.
static bool read_beats(struct worker *worker)
{
    char beats[64];
    const ssize_t got = read(worker->heartbeat_fd, beats, sizeof beats);
    if (got <= 0)
    {
        return false;
    }
    worker->moving = beats[got - 1] == 'm';
    notify("WATCHDOG=1");
    return true;
}

// Watches until the worker is dead, hangs, or a signal asks to end. @return true if asked to end.
static bool watch(struct worker *worker, int stop_fd, int32_t watchdog_ms)
{
    for (;;)
    {
        struct pollfd fds[] = {{.fd = worker->heartbeat_fd, .events = POLLIN},
                               {.fd = stop_fd, .events = POLLIN}};
        const int ready = poll(fds, 2, worker->moving ? watchdog_ms : STILL_PATIENCE_MS);
        if (ready < 0 && errno == EINTR)
        {
            continue;
        }
        if (fds[1].revents != 0)
        {
            return true;
        }
        if (ready <= 0)
        {
            (void)fprintf(stderr, "turbopi: the program hangs: killed\n");
            (void)kill(worker->pid, SIGKILL);
            return false;
        }
        if (!read_beats(worker))
        {
            return false;
        }
    }
}

static int64_t monotonic_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

// Asks the worker to end, and makes it. Its end of the pipe closes when it is dead.
static void end_worker(const struct worker *worker)
{
    (void)kill(worker->pid, SIGTERM);
    char beats[64];
    struct pollfd alive = {.fd = worker->heartbeat_fd, .events = POLLIN};
    const int64_t end_ms = monotonic_ms() + END_PATIENCE_MS;
    for (int64_t left_ms = END_PATIENCE_MS; left_ms > 0; left_ms = end_ms - monotonic_ms())
    {
        if (poll(&alive, 1, (int)left_ms) > 0 &&
            read(worker->heartbeat_fd, beats, sizeof beats) <= 0)
        {
            return;
        }
    }
    (void)kill(worker->pid, SIGKILL);
}

static int wait_for_end(const struct worker *worker)
{
    int status = 0;
    while (waitpid(worker->pid, &status, 0) < 0 && errno == EINTR)
    {
    }
    (void)close(worker->heartbeat_fd);
    if (WIFSIGNALED(status))
    {
        (void)fprintf(stderr, "turbopi: the program was killed by signal %d\n", WTERMSIG(status));
        return 1;
    }
    return WEXITSTATUS(status);
}

int supervise(struct options *options, worker_fn *run)
{
    // Both processes speak to the same board, whatever it answers later.
    devices_settle_board(&options->config, options->dry_run);
    const int stop_fd = block_signals();
    int code = 1;
    for (bool again = stop_fd >= 0; again;)
    {
        struct worker worker;
        if (!start_worker(options, run, stop_fd, &worker))
        {
            break;
        }
        notify("READY=1");
        notify("WATCHDOG=1");
        const bool asked = watch(&worker, stop_fd, options->config.watchdog_ms);
        if (asked)
        {
            end_worker(&worker);
        }
        code = wait_for_end(&worker);
        // Nothing comes before this: a dead worker's last duties are still on the wheels.
        const bool stopped = stop_board(options);
        code = asked && stopped ? 0 : code;
        again = !asked && code == 1 && options->config.restart_ms >= 0;
        if (again)
        {
            struct pollfd stop = {.fd = stop_fd, .events = POLLIN};
            again = poll(&stop, 1, options->config.restart_ms) == 0;
        }
    }
    notify("STOPPING=1");
    return code;
}
