// SPDX-License-Identifier: Apache-2.0
#include "commands.h"

#include <cmath>
#include <stdexcept>

#include "swarm/species.h"
#include "turbopi/ack_t.hpp"
#include "turbopi/link_t.hpp"
#include "turbopi/signed_ack_t.hpp"
#include "turbopi/telemetry_t.hpp"

namespace twin
{
namespace
{

constexpr int64_t kLinkPeriod_us = 100'000;
constexpr int32_t kLinkTimeout_ms = 2000;  // as the robot's, unless a start says otherwise

}  // namespace

Commands::Commands(Outlet &outlet, Swarm &swarm, Publisher &publisher,
                   std::shared_ptr<const Script> script, CommandOptions options)
    : outlet_(outlet),
      swarm_(swarm),
      publisher_(publisher),
      options_(std::move(options)),
      robots_(static_cast<size_t>(swarm.Size()))
{
    std::vector<seal_key> keys;
    for (int id = 0; id < swarm.Size(); ++id)
    {
        Robot &robot = robots_[static_cast<size_t>(id)];
        robot.script = script;
        robot.key = seal_derive(&options_.key, id);
        robot.filter.session = outlet_.BusUrl().empty() ? 0 : seal_random();
        keys.push_back(robot.key);
        options_.wait ? Stop(id) : Start(id);
    }
    if (!outlet_.BusUrl().empty())
        radio_ = std::make_unique<Radio>(outlet_.BusUrl(), options_.channel_prefix, keys);
}

int64_t Commands::SessionUs() const
{
    const auto passed = std::chrono::steady_clock::now() - begin_;
    return std::chrono::duration_cast<std::chrono::microseconds>(passed).count();
}

void Commands::Obey()
{
    if (radio_)
    {
        radio_->Hear([this](const wire_command &command) { OnCommand(command); });
        PublishLinks();
    }
    const int64_t now_us = swarm_.UtimeUs();
    for (int id = 0; id < swarm_.Size(); ++id)
    {
        WatchLink(id);
        const Robot &robot = robots_[static_cast<size_t>(id)];
        if (robot.start_pending && now_us >= robot.start_utime_us)
            Start(id);
        else if (robot.running && robot.script && now_us >= robot.script_end_utime_us)
            Stop(id);
    }
}

void Commands::OnCommand(const wire_command &command)
{
    for (int id = 0; id < swarm_.Size(); ++id)
        if (command.robot_id == WIRE_ALL_ROBOTS || command.robot_id == id)
            Answer(id, command.order, command.name);
}

void Commands::Answer(int id, const fw_command &order, const std::string &name)
{
    Robot &robot = robots_[static_cast<size_t>(id)];
    const fw_verdict verdict =
        fw_command_judge(&robot.filter, &order, swarm_.UtimeUs(), SessionUs(), robot.running);
    std::string reason = fw_verdict_str(verdict);
    try
    {
        if (verdict == FW_VERDICT_OBEY)
        {
            ObeyOne(id, order, name);
            Remember(id, order);
        }
    }
    catch (const std::exception &error)
    {
        reason = error.what();
    }
    if (order.verb != FW_VERB_HOLD)
        SendAck(id, order, reason);
}

void Commands::Remember(int id, const fw_command &order)
{
    Robot &robot = robots_[static_cast<size_t>(id)];
    fw_command_obeyed(&robot.filter, &order, SessionUs());
    if (order.verb == FW_VERB_STOP)
        return;
    robot.heard_us = SessionUs();
    if (order.verb == FW_VERB_START || order.verb == FW_VERB_SCRIPT)
    {
        robot.link_timeout_ms =
            order.link_timeout_ms >= 0 ? order.link_timeout_ms : kLinkTimeout_ms;
        robot.link_lost = false;
    }
}

void Commands::WatchLink(int id)
{
    Robot &robot = robots_[static_cast<size_t>(id)];
    const bool drives = robot.running || robot.start_pending;
    if (drives && robot.link_timeout_ms > 0 &&
        SessionUs() - robot.heard_us > int64_t{robot.link_timeout_ms} * 1000)
    {
        Stop(id);
        robot.link_lost = true;
    }
}

void Commands::SendAck(int id, const fw_command &order, const std::string &reason)
{
    const Robot &robot = robots_[static_cast<size_t>(id)];
    const std::string name = options_.channel_prefix + RobotName(id);
    turbopi::ack_t ack{};
    ack.utime_us = swarm_.UtimeUs();
    ack.robot_id = id;
    ack.seq = order.seq;
    ack.reason = reason;
    ack.accepted = reason.empty();
    outlet_.Send(ack.utime_us, name + "_ACK", ack);
    turbopi::signed_ack_t own{};
    own.utime_us = ack.utime_us;
    own.robot_id = id;
    own.session = robot.filter.session;
    own.session_us = SessionUs();
    own.command_utime_us = order.utime_us;
    own.seq = order.seq;
    own.verb = order.verb;
    own.accepted = ack.accepted;
    own.stands = !robot.running;
    own.reason = reason;
    outlet_.SendSigned(own.utime_us, name + "_SIGNED_ACK", own, robot.key);
}

int32_t Commands::StatusFlags(int id) const
{
    const Robot &robot = robots_[static_cast<size_t>(id)];
    using turbopi::telemetry_t;
    int32_t flags = swarm_.Output(id).status_flags | telemetry_t::STATUS_TELLS_START;
    flags |= robot.start_pending ? telemetry_t::STATUS_AWAITS_START : 0;
    flags |= robot.link_lost ? telemetry_t::STATUS_LINK_LOST : 0;
    flags |= robot.running && robot.link_timeout_ms == 0 ? telemetry_t::STATUS_UNTETHERED : 0;
    return flags | (robot.filter.latched ? telemetry_t::STATUS_LATCHED : 0);
}

void Commands::PublishLinks()
{
    if (SessionUs() < next_link_us_)
        return;
    next_link_us_ = SessionUs() + kLinkPeriod_us;
    for (int id = 0; id < swarm_.Size(); ++id)
    {
        const Robot &robot = robots_[static_cast<size_t>(id)];
        turbopi::link_t link{};
        link.utime_us = swarm_.UtimeUs();
        link.robot_id = id;
        link.session = robot.filter.session;
        link.session_us = SessionUs();
        link.counter = robot.filter.counter;
        link.mode = swarm_.Output(id).mode;
        link.stands = !robot.running;
        link.armed = !robot.filter.latched;
        link.link_timeout_ms = robot.link_timeout_ms;
        link.status_flags = StatusFlags(id);
        outlet_.SendSigned(link.utime_us, options_.channel_prefix + RobotName(id) + "_LINK", link,
                           robot.key);
    }
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
        case FW_VERB_ARM:
        case FW_VERB_HOLD: break;
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
