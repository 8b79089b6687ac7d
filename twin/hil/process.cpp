// SPDX-License-Identifier: Apache-2.0
#include "process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include "swarm/species.h"

namespace twin
{
namespace
{

constexpr int kPatience_ms = 10000, kEndPatience_ms = 2000, kPoll_ms = 10;
// An answer of the stub board: frames taken so far, then four duties.
constexpr size_t kAnswerBytes = 8;

std::vector<std::string> CommandLine(const FirmwareOptions &options, const CameraSettings &camera,
                                     int robot, int vote_frames, const std::string &socket,
                                     const std::string &behaviors)
{
    const auto set = [](const std::string &key, int value) {
        return key + "=" + std::to_string(value);
    };
    // In simulated time frames are never late; how long they take here does not count.
    std::vector<std::string> words{options.program,
                                   "--config",
                                   "/dev/null",
                                   "--behavior",
                                   options.behavior,
                                   "--camera",
                                   "stub:unix:" + socket,
                                   "--board",
                                   "stub:camera",
                                   "--lcm-url",
                                   "",
                                   "--start"};
    for (const std::string &pair :
         {set("robot_id", robot), set("width_px", camera.width_px),
          set("height_px", camera.height_px), set("vote_frames", vote_frames),
          set("vote_window_ms", 0), set("frame_timeout_ms", kPatience_ms),
          set("watchdog_ms", kPatience_ms), set("restart_ms", -1), std::string("panel=none"),
          "behaviors=" + behaviors})
    {
        words.push_back("--set");
        words.push_back(pair);
    }
    for (size_t i = 0; i < options.bits.size(); ++i)
    {
        words.push_back("--set");
        words.push_back("bit" + std::to_string(i + 1) + "=" + options.bits[i]);
    }
    return words;
}

// A file of the one table, as robots have of the user's own: inputs in thousandths are exact.
void WriteBehavior(const std::string &path, const FirmwareOptions &options)
{
    std::ofstream(path) << options.behavior << " = \"" << TableText(options.table) << "\"\n";
}

}  // namespace

FirmwareSensor::Process::Process(const FirmwareOptions &options, const CameraSettings &camera,
                                 int robot, int vote_frames)
    : name_("robot " + std::to_string(robot) + ", " + options.program)
{
    if (access(options.program.c_str(), X_OK) != 0)
        throw std::runtime_error("--firmware " + options.program +
                                 ": is no program that can be run: build turbopi, or name it");
    try
    {
        Start(options, camera, robot, vote_frames);
        Accept();
    }
    catch (...)
    {
        End();
        throw;
    }
}

FirmwareSensor::Process::~Process()
{
    End();
}

void FirmwareSensor::Process::Fail(const std::string &what) const
{
    throw std::runtime_error(name_ + ": " + what);
}

void FirmwareSensor::Process::Start(const FirmwareOptions &options, const CameraSettings &camera,
                                    int robot, int vote_frames)
{
    std::string folder = (std::filesystem::temp_directory_path() / "twin_hil_XXXXXX").string();
    if (!mkdtemp(folder.data()))
        Fail(std::string("no folder for its socket: ") + std::strerror(errno));
    folder_ = folder;
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string path = folder_ + "/camera";
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    listener_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (bind(listener_, reinterpret_cast<const sockaddr *>(&address), sizeof address) != 0 ||
        listen(listener_, 1) != 0)
        Fail("no socket at " + path + ": " + std::strerror(errno));

    const std::string behaviors = folder_ + "/behaviors.toml";
    WriteBehavior(behaviors, options);
    std::vector<std::string> words =
        CommandLine(options, camera, robot, vote_frames, path, behaviors);
    std::vector<char *> arguments;
    for (std::string &word : words)
        arguments.push_back(word.data());
    arguments.push_back(nullptr);
    pid_ = fork();
    if (pid_ == 0)
    {
        // It ends with the twin, but not by the Ctrl-C that lets the twin end in order.
        setpgid(0, 0);
        prctl(PR_SET_PDEATHSIG, SIGTERM);
        execv(arguments.front(), arguments.data());
        _exit(127);
    }
    if (pid_ < 0)
        Fail(std::string("cannot be started: ") + std::strerror(errno));
}

void FirmwareSensor::Process::Accept()
{
    pollfd waiting{listener_, POLLIN, 0};
    for (int waited_ms = 0; poll(&waiting, 1, kPoll_ms) != 1; waited_ms += kPoll_ms)
    {
        if (waitpid(pid_, nullptr, WNOHANG) == pid_)
        {
            pid_ = -1;
            Fail("has ended before it opened its camera: see its message");
        }
        if (waited_ms >= kPatience_ms)
            Fail("does not open its camera");
    }
    connection_ = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    if (connection_ < 0)
        Fail(std::string("does not open its camera: ") + std::strerror(errno));
}

void FirmwareSensor::Process::Send(std::span<const uint8_t> frame)
{
    while (!frame.empty())
    {
        const ssize_t taken = send(connection_, frame.data(), frame.size(), MSG_NOSIGNAL);
        if (taken < 0 && errno == EINTR)
            continue;
        if (taken < 0)
            Fail("takes no more frames: see its message");
        frame = frame.subspan(static_cast<size_t>(taken));
    }
    ++sent_;
}

void FirmwareSensor::Process::Receive(bool wait_for_last)
{
    for (;;)
    {
        const bool waits = wait_for_last && answered_ < sent_;
        pollfd waiting{connection_, POLLIN, 0};
        const int ready = poll(&waiting, 1, waits ? kPatience_ms : 0);
        if (ready < 0 && errno == EINTR)
            continue;
        if (ready == 0 && waits)
            Fail("gives no answer to a frame");
        if (ready == 0 || (wait_for_last && !waits))
            return;
        uint8_t answer[kAnswerBytes];
        if (recv(connection_, answer, sizeof answer, MSG_WAITALL) != sizeof answer)
            Fail("has ended: see its message");
        answered_ = answer[0] | static_cast<uint32_t>(answer[1]) << 8 |
                    static_cast<uint32_t>(answer[2]) << 16 | static_cast<uint32_t>(answer[3]) << 24;
        std::memcpy(wheel_duty_pct_.data(), answer + 4, wheel_duty_pct_.size());
    }
}

// Asks it to end, and waits; kills it if it does not.
void FirmwareSensor::Process::End()
{
    if (pid_ > 0)
    {
        kill(pid_, SIGTERM);
        int waited_ms = 0;
        while (waitpid(pid_, nullptr, WNOHANG) == 0)
        {
            if (waited_ms >= kEndPatience_ms)
                kill(pid_, SIGKILL);
            poll(nullptr, 0, kPoll_ms);
            waited_ms += kPoll_ms;
        }
        pid_ = -1;
    }
    for (int *fd : {&connection_, &listener_})
        if (*fd >= 0)
            close(std::exchange(*fd, -1));
    std::error_code ignored;
    if (!folder_.empty())
        std::filesystem::remove_all(folder_, ignored);
}

}  // namespace twin
