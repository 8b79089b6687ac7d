// SPDX-License-Identifier: Apache-2.0
// Makes simulated robots obey swarm_command_t and answer by ack_t as real ones do.
#ifndef APP_COMMANDS_H
#define APP_COMMANDS_H

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "fw/behavior.h"
#include "fw/command.h"
#include "outlet.h"
#include "publisher.h"
#include "swarm/swarm.h"
#include "turbopi/swarm_command_t.hpp"

namespace twin
{

struct CommandOptions
{
    std::string channel_prefix;
    std::string script_dir;            // of the scripts that commands name
    bool wait = false;                 // stand until a start
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
    // As in the robot's program.
    struct Robot
    {
        fw_inbox inbox{};
        bool running = true, start_pending = false;
        int64_t start_utime_us = 0, script_end_utime_us = 0;
        std::shared_ptr<const Script> script;
    };
    void OnCommand(const lcm::ReceiveBuffer *buffer, const std::string &channel);
    void Answer(int id, const fw_command &order, const std::string &name);
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
};

}  // namespace twin

#endif
