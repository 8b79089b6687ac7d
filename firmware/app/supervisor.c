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
#include <unistd.h>

#include "devices.h"
#include "guard.h"
#include "instance.h"
#include "lcm_log.h"
#include "notify.h"
#include "priority.h"
#include "say.h"
#include "stopper.h"

#define TICK_MS 20
// A driver whose wheels stand may take its time: cameras are slow to open.
#define STILL_PATIENCE_MS 15000
// From being asked to end to being killed, once the wheels stand.
#define END_PATIENCE_MS 1000
// For a board that does not confirm a stop. A driver is then started again all the same: it goes
// on telling the board, and the operator.
#define STOP_PATIENCE_MS 1000
// For a program that is ending to give the board back.
#define HELD_PATIENCE_MS 2000
#define NOTIFY_PERIOD_US 500000
#define START_PATIENCE_US 2000000
#define HELP_PERIOD_US 100000

struct crew
{
    struct options *options;
    driver_fn *drive;
    struct watch *watch;
    struct stopper stopper;
    int signal_fd;
    // 0: none.
    pid_t driver, guard;
    int driver_status;
    // Of the board that is this program's own; -1: none.
    int board_fd;
    // A program with a terminal ends with it; without one SIGHUP reads the configuration anew.
    bool has_terminal;
    // The signal that asked to end; 0: none did. And whether one asked to read the configuration.
    int asked_by;
    bool reloads;
    // When either came; 0: neither did.
    int64_t asked_us;
    int64_t notified_us, guard_tried_us, help_us;
};

// Signals that end or suspend a program, as something to wait for: a suspended one could not stop
// the wheels. @return -1 and errno on failure.
static int block_signals(void)
{
    const int numbers[] = {SIGTERM, SIGINT,  SIGHUP,  SIGQUIT, SIGTSTP,
                           SIGTTIN, SIGTTOU, SIGUSR1, SIGUSR2, SIGCHLD};
    sigset_t signals;
    sigemptyset(&signals);
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; ++i)
    {
        sigaddset(&signals, numbers[i]);
    }
    return sigprocmask(SIG_BLOCK, &signals, NULL) == 0
               ? signalfd(-1, &signals, SFD_NONBLOCK | SFD_CLOEXEC)
               : -1;
}

static bool asks_to_end(uint32_t number)
{
    return number == SIGTERM || number == SIGINT || number == SIGQUIT || number == SIGTSTP;
}

int supervisor_asked_to_end(int stop_fd)
{
    struct signalfd_siginfo info;
    int number = 0;
    while (read(stop_fd, &info, sizeof info) == sizeof info)
    {
        number = asks_to_end(info.ssi_signo) ? (int)info.ssi_signo : number;
    }
    return number;
}

// In the child: dies with its parent, after having stopped the wheels.
static _Noreturn void become_driver(struct crew *crew, pid_t parent)
{
    stopper_close(&crew->stopper);
    (void)prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != parent)
    {
        _exit(1);
    }
    crew->watch->driver_pid = getpid();
    exit(crew->drive(crew->options, crew->watch, crew->signal_fd));
}

static bool start_driver(struct crew *crew)
{
    const pid_t parent = getpid();
    // It has this long for its first own beat: what it found moving, it did not set in motion.
    crew->watch->beat_us[WATCH_DRIVER] = watch_now_us() + START_PATIENCE_US;
    crew->driver = fork();
    if (crew->driver == 0)
    {
        become_driver(crew, parent);
    }
    return crew->driver > 0;
}

static void keep_guard(struct crew *crew)
{
    const int64_t now_us = watch_now_us();
    if (crew->guard > 0 && waitpid(crew->guard, NULL, WNOHANG) == crew->guard)
    {
        crew->guard = 0;
    }
    if (crew->guard > 0 || now_us - crew->guard_tried_us < STOP_PATIENCE_MS * 1000)
    {
        return;
    }
    if (crew->guard_tried_us != 0)
    {
        say("the guard is gone: another is started");
    }
    crew->guard_tried_us = now_us;
    const pid_t parent = getpid();
    crew->guard = fork();
    if (crew->guard == 0)
    {
        stopper_close(&crew->stopper);
        guard_run(crew->options, crew->watch, parent);
    }
}

// One that hangs is waited for no longer than a hundred ticks: it dies as soon as it can.
static void end_guard(struct crew *crew)
{
    if (crew->guard > 0)
    {
        (void)kill(crew->guard, SIGKILL);
        for (int i = 0; i < 100 && waitpid(crew->guard, NULL, WNOHANG) == 0; ++i)
        {
            (void)poll(NULL, 0, 1);
        }
    }
    crew->guard = 0;
    crew->guard_tried_us = 0;
    crew->watch->beat_us[WATCH_GUARD] = 0;
}

static void reap_driver(struct crew *crew)
{
    if (crew->driver > 0 && waitpid(crew->driver, &crew->driver_status, WNOHANG) == crew->driver)
    {
        crew->driver = 0;
        crew->watch->driver_pid = 0;
    }
}

static void note_signals(struct crew *crew)
{
    struct signalfd_siginfo info;
    while (read(crew->signal_fd, &info, sizeof info) == sizeof info)
    {
        const bool hangs_up = info.ssi_signo == SIGHUP;
        const bool ends = asks_to_end(info.ssi_signo) || (hangs_up && crew->has_terminal);
        crew->reloads = crew->reloads || (hangs_up && !ends);
        crew->asked_by = ends && crew->asked_by == 0 ? (int)info.ssi_signo : crew->asked_by;
        if ((ends || hangs_up) && crew->asked_us == 0)
        {
            crew->asked_us = watch_now_us();
        }
    }
}

// What is done at all times, whatever else goes on; then a short wait, or none if a signal comes.
static void tick(struct crew *crew)
{
    watch_beat(crew->watch, WATCH_SUPERVISOR);
    keep_guard(crew);
    if (!crew->watch->needs_help)
    {
        stopper_hold(&crew->stopper);
    }
    if (watch_now_us() - crew->notified_us > NOTIFY_PERIOD_US)
    {
        notify("WATCHDOG=1");
        crew->notified_us = watch_now_us();
    }
    struct pollfd signals = {.fd = crew->signal_fd, .events = POLLIN};
    (void)poll(&signals, 1, TICK_MS);
    note_signals(crew);
    reap_driver(crew);
}

static int64_t asked_ms(const struct crew *crew)
{
    return crew->asked_us != 0 ? (watch_now_us() - crew->asked_us) / 1000 : -1;
}

// @return why the driver has to be killed, or NULL.
static const char *must_end(const struct crew *crew)
{
    const bool may_move = crew->watch->may_move;
    const int32_t watchdog_ms = crew->options->config.watchdog_ms;
    const int64_t silent_ms = watch_silent_ms(crew->watch, WATCH_DRIVER);
    return silent_ms > (may_move ? watchdog_ms : STILL_PATIENCE_MS)      ? "hangs"
           : asked_ms(crew) > (may_move ? watchdog_ms : END_PATIENCE_MS) ? "does not end"
                                                                         : NULL;
}

// A driver that cannot reach the board may be the only one that cannot.
static void help_driver(struct crew *crew)
{
    const int64_t now_us = watch_now_us();
    if (crew->watch->needs_help && now_us >= crew->help_us)
    {
        (void)stopper_stop(&crew->stopper);
        crew->help_us = now_us + HELP_PERIOD_US;
    }
}

// Until the driver has ended or has to be made to. @return why it has to, or NULL.
static const char *watch_driver(struct crew *crew)
{
    bool told = false;
    const char *why = NULL;
    while (crew->driver > 0 && why == NULL)
    {
        tick(crew);
        // Number 0 would be everybody in this process group.
        if (crew->asked_us != 0 && !told && crew->driver > 0)
        {
            (void)kill(crew->driver, SIGTERM);
            told = true;
        }
        help_driver(crew);
        why = must_end(crew);
    }
    return why;
}

// Until nobody is left who could write to the board, and it has confirmed a stop; for the second
// no longer than the patience. @return true if it has.
static bool put_to_rest(struct crew *crew)
{
    const int64_t begin_us = watch_now_us();
    bool stopped = false, complained = false;
    do
    {
        if (crew->driver > 0)
        {
            crew->watch->driver_pid = crew->driver;
        }
        stopped = stopper_end_driver(&crew->stopper, crew->watch);
        reap_driver(crew);
        if (!stopped || crew->driver > 0)
        {
            tick(crew);
        }
        const bool is_late = (watch_now_us() - begin_us) / 1000 > STOP_PATIENCE_MS;
        if (is_late && !stopped && !complained)
        {
            say("motor board: does not confirm a stop: THE WHEELS MAY TURN: switch the robot off");
            complained = true;
        }
        if (is_late && crew->driver == 0)
        {
            break;
        }
    } while (!stopped || crew->driver > 0);
    return stopped;
}

// Tells what has happened, now that the wheels stand. @return the exit code of the driver.
static int tell_end(const struct crew *crew, const char *why)
{
    if (why != NULL)
    {
        say("the driving process %s: killed", why);
        return 1;
    }
    if (WIFSIGNALED(crew->driver_status))
    {
        say("the driving process was killed by signal %d", WTERMSIG(crew->driver_status));
        return 1;
    }
    return WEXITSTATUS(crew->driver_status);
}

static void pause_for(struct crew *crew, int32_t duration_ms)
{
    const int64_t end_us = watch_now_us() + (int64_t)duration_ms * 1000;
    while (crew->asked_us == 0 && watch_now_us() < end_us)
    {
        tick(crew);
    }
}

// A driver does not move before the guard was heard: without this its first frames were lost.
static void wait_for_guard(struct crew *crew)
{
    const int64_t end_us = watch_now_us() + START_PATIENCE_US;
    keep_guard(crew);
    while (crew->watch->beat_us[WATCH_GUARD] == 0 && watch_now_us() < end_us)
    {
        tick(crew);
    }
}

// The board that this program had before is given back for another.
static bool try_board(struct crew *crew, const char *path, pid_t *holder)
{
    const int fd = instance_take(path, holder);
    if (fd >= 0 && crew->board_fd >= 0)
    {
        (void)close(crew->board_fd);
    }
    crew->board_fd = fd >= 0 ? fd : crew->board_fd;
    return fd >= 0 || *holder == getpid();
}

// Waits for a program that is ending to let go of the board. @return false if another keeps it.
static bool take_board(struct crew *crew)
{
    const char *path = devices_board_path(&crew->options->config, crew->options->dry_run);
    const int64_t end_us = watch_now_us() + HELD_PATIENCE_MS * 1000;
    pid_t holder = 0;
    bool taken = path == NULL || try_board(crew, path, &holder);
    while (!taken && crew->asked_by == 0 && watch_now_us() < end_us)
    {
        (void)poll(NULL, 0, TICK_MS);
        note_signals(crew);
        taken = try_board(crew, path, &holder);
    }
    if (!taken)
    {
        char who[INSTANCE_WHO_MAX] = "another program";
        if (holder > 0)
        {
            instance_describe(holder, who);
        }
        say("motor board %s: %s has it: end that first; nothing was moved", path, who);
    }
    return taken;
}

static void warn_of_vendor(const struct options *options)
{
    char who[INSTANCE_WHO_MAX];
    if (devices_board_path(&options->config, options->dry_run) != NULL && instance_vendor(who))
    {
        say("%s runs, too, and may move the wheels or hold camera and lines: stop and disable it",
            who);
    }
}

// The configuration as it is now, or, if that is wrong, as it was.
static void reload(struct crew *crew)
{
    static struct options fresh;
    struct options *options = crew->options;
    crew->reloads = false;
    crew->asked_us = 0;
    if (parse_options(options->argc, options->argv, &fresh) != OPTIONS_RUN)
    {
        say("the configuration stays as it was");
        return;
    }
    if (lcm_log_is_same(fresh.config.lcm_url, options->config.lcm_url))
    {
        lcm_log_keep(fresh.config.lcm_url);
    }
    *options = fresh;
    say("the configuration was read anew");
}

// Finds the board and makes it this program's own. @return false to end, with the exit code.
static bool settle(struct crew *crew, int *code)
{
    char error[CONFIG_ERROR_MAX], told[CONFIG_ERROR_MAX] = "";
    bool found = false;
    *code = 1;
    while (crew->asked_by == 0 && !found)
    {
        if (crew->reloads)
        {
            reload(crew);
        }
        found = devices_settle_board(&crew->options->config, crew->options->dry_run, error);
        if (found)
        {
            break;
        }
        if (strcmp(told, error) != 0)
        {
            say("%s", error);
            memcpy(told, error, sizeof told);
        }
        if (crew->options->config.restart_ms < 0)
        {
            return false;
        }
        notify("WATCHDOG=1");
        struct pollfd signals = {.fd = crew->signal_fd, .events = POLLIN};
        (void)poll(&signals, 1, crew->options->config.restart_ms);
        note_signals(crew);
    }
    if (found && !take_board(crew))
    {
        *code = SUPERVISOR_EXIT_HELD;
        return false;
    }
    *code = found ? 1 : 0;
    return found;
}

// One life of the driver. @return true if another follows.
static bool drive_once(struct crew *crew, int *code)
{
    if (!start_driver(crew))
    {
        say("no process can be started: %s", strerror(errno));
        return false;
    }
    lcm_log_keep(crew->options->config.lcm_url);
    const char *why = watch_driver(crew);
    // Nothing comes before this: a dead driver's last duties are still on the wheels.
    const bool stopped = put_to_rest(crew);
    *code = tell_end(crew, why);
    if (crew->asked_by != 0)
    {
        *code = !stopped ? 1 : *code == SUPERVISOR_EXIT_LOG_LOST ? *code : 0;
        return false;
    }
    if (crew->reloads)
    {
        return true;
    }
    if (*code != 1 || crew->options->config.restart_ms < 0)
    {
        return false;
    }
    pause_for(crew, crew->options->config.restart_ms);
    *code = stopped ? 0 : 1;
    return crew->asked_by == 0;
}

static void tell_signal(const struct crew *crew)
{
    if (crew->asked_by == SIGTSTP || crew->asked_by == SIGQUIT)
    {
        say("ended, not suspended: who is suspended cannot stop the wheels");
    }
}

// All that a driver needs. @return false to end, with the exit code.
static bool prepare(struct crew *crew, int *code)
{
    if (!settle(crew, code))
    {
        return false;
    }
    (void)put_to_rest(crew);
    wait_for_guard(crew);
    warn_of_vendor(crew->options);
    return true;
}

// After the driver has ended. While wheels may turn, those who know the board go on.
static bool prepare_anew(struct crew *crew, int *code)
{
    crew->watch->reloaded = true;
    if (crew->watch->may_move)
    {
        say("no stop is confirmed: the configuration stays as it was");
        crew->reloads = false;
        crew->asked_us = 0;
        return true;
    }
    end_guard(crew);
    stopper_close(&crew->stopper);
    return prepare(crew, code);
}

static bool has_terminal(void)
{
    const int fd = open("/dev/tty", O_RDONLY | O_NOCTTY | O_CLOEXEC);
    if (fd >= 0)
    {
        (void)close(fd);
    }
    return fd >= 0;
}

int supervise(struct options *options, driver_fn *drive)
{
    struct crew crew = {
        .options = options,
        .drive = drive,
        .board_fd = -1,
        .has_terminal = has_terminal(),
        .stopper = {.config = &options->config, .dry_run = options->dry_run},
    };
    crew.signal_fd = block_signals();
    crew.watch = watch_make();
    priority_take(PRIORITY_WATCHES);
    int code = 1;
    if (crew.signal_fd < 0 || crew.watch == NULL || !say_never_wait())
    {
        say("cannot start: %s", strerror(errno));
        return code;
    }
    notify("READY=1");
    notify("WATCHDOG=1");
    bool goes_on = prepare(&crew, &code);
    while (goes_on && crew.asked_by == 0)
    {
        goes_on = drive_once(&crew, &code) && (!crew.reloads || prepare_anew(&crew, &code));
    }
    tell_signal(&crew);
    // While wheels may turn the guard goes on; else nobody needs it, hanging or not.
    if (!crew.watch->may_move)
    {
        end_guard(&crew);
    }
    notify("STOPPING=1");
    return code;
}
