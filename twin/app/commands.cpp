// SPDX-License-Identifier: Apache-2.0
#include "commands.h"

#include <cmath>
#include <stdexcept>

#include "swarm/species.h"
#include "turbopi/ack_t.hpp"

namespace twin
{

Commands::Commands(Outlet &outlet, Swarm &swarm, Publisher &publisher,
                   std::shared_ptr<const Script> script, CommandOptions options)
    : outlet_(outlet),
      swarm_(swarm),
      publisher_(publisher),
      options_(std::move(options)),
      robots_(static_cast<size_t>(swarm.Size()))
{
    for (int id = 0; id < swarm.Size(); ++id)
    {
        robots_[static_cast<size_t>(id)].script = script;
        options_.wait ? Stop(id) : Start(id);
    }
    if (lcm::LCM *bus = outlet_.Bus())
        bus->subscribe(options_.channel_prefix + "SWARM_COMMAND", &Commands::OnCommand, this);
}

void Commands::Obey()
{
    if (lcm::LCM *bus = outlet_.Bus())
        while (bus->handleTimeout(0) > 0)
        {
        }
    const int64_t now_us = swarm_.UtimeUs();
    for (int id = 0; id < swarm_.Size(); ++id)
    {
        const Robot &robot = robots_[static_cast<size_t>(id)];
        if (robot.start_pending && now_us >= robot.start_utime_us)
            Start(id);
        else if (robot.running && robot.script && now_us >= robot.script_end_utime_us)
            Stop(id);
    }
}

// Anyone may send, and LCM's decoder throws at a text that says it has less than no characters.
void Commands::OnCommand(const lcm::ReceiveBuffer *buffer, const std::string &)
{
    turbopi::swarm_command_t message;
    try
    {
        if (message.decode(buffer->data, 0, static_cast<int>(buffer->data_size)) < 0)
            return;
    }
    catch (const std::length_error &)
    {
        return;
    }
    const fw_command order{message.utime_us, message.seq, message.verb, message.start_utime_us};
    for (int id = 0; id < swarm_.Size(); ++id)
        if (message.robot_id == -1 || message.robot_id == id)
            Answer(id, order, message.behavior);
}

void Commands::Answer(int id, const fw_command &order, const std::string &name)
{
    Robot &robot = robots_[static_cast<size_t>(id)];
    const int64_t now_us = swarm_.UtimeUs();
    const fw_verdict verdict = fw_command_judge(&robot.inbox, &order, now_us, robot.running);
    turbopi::ack_t ack;
    ack.utime_us = now_us;
    ack.robot_id = id;
    ack.seq = order.seq;
    ack.reason = fw_verdict_str(verdict);
    try
    {
        if (verdict == FW_VERDICT_OBEY)
            ObeyOne(id, order, name);
    }
    catch (const std::exception &error)
    {
        ack.reason = error.what();
    }
    ack.accepted = ack.reason.empty();
    if (ack.accepted)
        fw_command_obeyed(&robot.inbox, &order);
    outlet_.Send(now_us, options_.channel_prefix + RobotName(id) + "_ACK", ack);
}

void Commands::ObeyOne(int id, const fw_command &order, const std::string &name)
{
    switch (static_cast<fw_verb>(order.verb))
    {
        case FW_VERB_STOP: Stop(id); break;
        case FW_VERB_START:
            if (!name.empty())
                Select(id, name);
            StartAt(id, order.start_utime_us);
            break;
        case FW_VERB_SELECT: Select(id, name); break;
        case FW_VERB_SCRIPT:
            swarm_.Play(id, robots_[static_cast<size_t>(id)].script =
                                std::make_shared<Script>(LoadScript(name)));
            StartAt(id, order.start_utime_us);
            break;
    }
}

void Commands::Select(int id, const std::string &name)
{
    const fw_behavior *behavior = FindBehavior(name, options_.own);
    if (!behavior)
        throw std::invalid_argument("no behaviour '" + name + "'");
    swarm_.Select(id, *behavior);
    swarm_.Play(id, robots_[static_cast<size_t>(id)].script = nullptr);
    publisher_.SetBehavior(id, name);
}

Script Commands::LoadScript(const std::string &name) const
{
    if (name.empty() || name.front() == '.' || name.find('/') != std::string::npos)
        throw std::invalid_argument("script must be a file name without folder");
    return Script::Load(options_.script_dir + "/" + name);
}

void Commands::StartAt(int id, int64_t utime_us)
{
    Robot &robot = robots_[static_cast<size_t>(id)];
    robot.start_pending = true;
    robot.start_utime_us = utime_us;
}

void Commands::Start(int id)
{
    Robot &robot = robots_[static_cast<size_t>(id)];
    robot.running = true;
    robot.start_pending = false;
    swarm_.SetRunning(id, true);
    if (robot.script)
    {
        swarm_.Play(id, robot.script);
        robot.script_end_utime_us = swarm_.UtimeUs() + std::llround(robot.script->EndS() * 1e6);
    }
}

void Commands::Stop(int id)
{
    Robot &robot = robots_[static_cast<size_t>(id)];
    robot.running = false;
    robot.start_pending = false;
    swarm_.SetRunning(id, false);
}

}  // namespace twin
