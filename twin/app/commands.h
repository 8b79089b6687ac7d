// SPDX-License-Identifier: Apache-2.0
// Makes simulated robots obey swarm_command_t and signed_command_t and answer as real ones do.
#ifndef APP_COMMANDS_H
#define APP_COMMANDS_H

#include <chrono>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "fw/behavior.h"
#include "fw/command.h"
#include "outlet.h"
#include "publisher.h"
#include "radio.h"
#include "swarm/swarm.h"

namespace twin
{

struct CommandOptions
{
    std::string channel_prefix;
    std::string script_dir;            // of the scripts that commands name
    bool wait = false;                 // stand until a start
    seal_key key{};                    // the operator's
    std::span<const fw_behavior> own;  // tables that commands can name beside the firmware's
};

class Commands
{
public:
    // `script`: what all robots play at the start, or nullptr. All others live as long as this.
    Commands(Outlet &outlet, Swarm &swarm, Publisher &publisher,
             std::shared_ptr<const Script> script, CommandOptions options);

    // Before every Swarm::Decide(): obeys what was heard, and starts and stops that are due.
    void Obey();

private:
    // As in the robot's program. Whether a command is fresh, and the operator heard, is a matter
    // of real time, whatever the pace of the simulation.
    struct Robot
    {
        fw_command_filter filter{};
        seal_key key{};
        int64_t heard_us = 0;
        int32_t link_timeout_ms = 0;
        bool link_lost = false;
        bool running = true, start_pending = false;
        int64_t start_utime_us = 0, script_end_utime_us = 0;
        std::shared_ptr<const Script> script;
    };
    void OnCommand(const wire_command &command);
    void Answer(int id, const fw_command &order, const std::string &name);
    void SendAck(int id, const fw_command &order, const std::string &reason);
    void Remember(int id, const fw_command &order);
    void WatchLink(int id);
    void PublishLinks();
    int32_t StatusFlags(int id) const;
    int64_t SessionUs() const;
    // Throws std::exception with the reason if the robot cannot.
    void ObeyOne(int id, const fw_command &order, const std::string &name);
    void Select(int id, const std::string &behavior);
    void StartAt(int id, int64_t utime_us);
    void Start(int id);
    void Stop(int id);
    Script LoadScript(const std::string &name) const;

    Outlet &outlet_;
    Swarm &swarm_;
    Publisher &publisher_;
    CommandOptions options_;
    std::vector<Robot> robots_;
    std::unique_ptr<Radio> radio_;  // nullptr without a bus
    std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
    int64_t next_link_us_ = 0;
};

}  // namespace twin

#endif
