// SPDX-License-Identifier: Apache-2.0
#include "publisher.h"

#include <cmath>
#include <numbers>

#include "turbopi/body_t.hpp"
#include "turbopi/drive_t.hpp"
#include "turbopi/pose_t.hpp"
#include "turbopi/run_t.hpp"
#include "turbopi/telemetry_t.hpp"
#include "turbopi/truth_t.hpp"

namespace twin
{
namespace
{

constexpr double kMarkerHeight_m = 0.106;  // of the marker body above the floor
constexpr const char *kBodyChannel = "TWIN_BODY";
constexpr int64_t kRunPeriod_us = 5'000'000;

}  // namespace

std::string RobotName(int id)
{
    return (id < 10 ? "R0" : "R") + std::to_string(id);
}

Publisher::Publisher(Outlet &outlet, const Swarm &swarm, const std::vector<Model> &models,
                     std::vector<Robot> robots, const std::string &channel_prefix,
                     double pose_rate_hz, uint64_t seed)
    : outlet_(outlet),
      start_utime_us_(swarm.UtimeUs()),
      next_run_utime_us_(swarm.UtimeUs()),
      pose_rate_hz_(pose_rate_hz),
      recent_(swarm.Size())
{
    for (int id = 0; id < swarm.Size(); ++id)
    {
        const size_t i = static_cast<size_t>(id);
        const std::string name = RobotName(id), prefix = channel_prefix + name;
        members_.push_back({std::move(robots[i]), models[i].base,
                            Kinematics(models[i].robot, models[i].base.wheels),
                            DriveChain(models[i]), models[i].noise, models[i].robot.wheel_radius_m,
                            Random(seed, id, "motion_capture"), swarm.State(id),
                            prefix + "_TELEMETRY", prefix + "_DRIVE", prefix + "_POSE",
                            prefix + "_RUN", "TWIN_TRUTH_" + name});
    }
}

int64_t Publisher::Utime(double t_s) const
{
    return start_utime_us_ + std::llround(t_s * 1e6);
}

void Publisher::PublishDecisions(const Swarm &swarm)
{
    const bool run_due = swarm.UtimeUs() >= next_run_utime_us_;
    if (run_due)
    {
        next_run_utime_us_ += kRunPeriod_us;
        for (const WorldBody &body : swarm.World())
            PublishBody(body, swarm.TimeS());
    }
    for (int id = 0; id < swarm.Size(); ++id)
    {
        if (run_due || members_[static_cast<size_t>(id)].run_due)
            PublishRun(id, swarm.UtimeUs());
        PublishTelemetry(id, swarm);
        if (members_[static_cast<size_t>(id)].base.drive != Drive::kDuty)
            PublishDrive(id, swarm);
    }
}

void Publisher::PublishRun(int id, int64_t utime_us)
{
    Member &member = members_[static_cast<size_t>(id)];
    member.run_due = false;
    turbopi::run_t run;
    run.utime_us = utime_us;
    run.robot_id = id;
    run.source = "twin";
    run.version = TWINMILL_VERSION;
    run.behavior = member.robot.behavior;
    run.config_toml = member.robot.config_toml;
    outlet_.Send(utime_us, member.run, run);
}

void Publisher::PublishTelemetry(int id, const Swarm &swarm)
{
    const fw_output &out = swarm.Output(id);
    turbopi::telemetry_t t;
    t.utime_us = swarm.UtimeUs();
    t.frame_utime_us = out.frame_utime_us;
    t.robot_id = id;
    t.seq = out.seq;
    t.frame_seq = static_cast<int32_t>(out.frame_seq);
    t.blob_px = out.blob_px;
    t.detected_raw = out.detected_raw;
    t.detected = out.detected;
    t.mode = out.mode;
    t.speed_input = static_cast<float>(out.speed_input_pct);
    t.turn_input = static_cast<float>(out.turn_input_milli) / 1000;
    for (size_t k = 0; k < FW_WHEEL_COUNT; ++k)
        t.wheel_duty_pct[k] = out.wheel_duty_pct[k];
    // The board reports whole millivolts.
    t.battery_V = static_cast<float>(std::round(swarm.BatteryV(id) * 1000) / 1000);
    t.loop_us = 0;
    t.status_flags = out.status_flags;
    outlet_.Send(t.utime_us, members_[static_cast<size_t>(id)].telemetry, t);
}

// The firmware's duties drive nothing in such a robot. A steering angle is told as the velocities
// that it asks for, as importers do: drive_t knows no angles.
void Publisher::PublishDrive(int id, const Swarm &swarm)
{
    const Member &member = members_[static_cast<size_t>(id)];
    const Wheels told = swarm.Told(id).value;
    Twist twist{told[0], told[1], told[2]};
    if (member.base.drive == Drive::kSteering)
        twist = member.kinematics.Forward(member.kinematics.Steered(told[0], told[1]));
    turbopi::drive_t drive{};
    drive.utime_us = swarm.UtimeUs();
    drive.robot_id = id;
    drive.kind = turbopi::drive_t::KIND_TWIST;
    drive.value[0] = twist.vx_mps;
    drive.value[1] = twist.vy_mps;
    drive.value[2] = twist.omega_radps;
    outlet_.Send(drive.utime_us, member.drive, drive);
}

void Publisher::PublishPoses(const Swarm &swarm)
{
    const double now_s = swarm.TimeS();
    for (double t_s = pose_seq_ / pose_rate_hz_; t_s <= now_s; t_s = pose_seq_ / pose_rate_hz_)
    {
        const double part = now_s > last_t_s_ ? (t_s - last_t_s_) / (now_s - last_t_s_) : 1;
        for (int id = 0; id < swarm.Size(); ++id)
        {
            const RobotState &state = swarm.State(id);
            const Pose2 &a = members_[static_cast<size_t>(id)].last.pose, &b = state.pose;
            const double turn_rad = std::remainder(b.theta_rad - a.theta_rad, 2 * std::numbers::pi);
            const Pose2 pose{a.x_m + part * (b.x_m - a.x_m), a.y_m + part * (b.y_m - a.y_m),
                             a.theta_rad + part * turn_rad};
            PublishPose(id, t_s, pose);
            PublishTruth(id, t_s, pose, state);
        }
        for (const WorldBody &body : swarm.World())
            if (!body.path_m.empty())
                PublishBody(body, t_s);
        ++pose_seq_;
    }
    for (int id = 0; id < swarm.Size(); ++id)
        members_[static_cast<size_t>(id)].last = swarm.State(id);
    last_t_s_ = now_s;
}

void Publisher::PublishPose(int id, double t_s, const Pose2 &pose)
{
    Member &member = members_[static_cast<size_t>(id)];
    Pose2 seen = pose;
    double seen_t_s = t_s;
    member.chain.Observe(seen, seen_t_s);
    seen.x_m += member.noise.sensor_m * member.random.Normal();
    seen.y_m += member.noise.sensor_m * member.random.Normal();
    seen.theta_rad += member.noise.sensor_rad * member.random.Normal();

    turbopi::pose_t message{};
    message.utime_us = Utime(seen_t_s);
    message.robot_id = id;
    message.seq = pose_seq_;
    message.valid = 1;
    message.position_m[0] = seen.x_m;
    message.position_m[1] = seen.y_m;
    message.position_m[2] = kMarkerHeight_m;
    message.orientation_wxyz[0] = std::cos(seen.theta_rad / 2);
    message.orientation_wxyz[3] = std::sin(seen.theta_rad / 2);
    outlet_.Send(Utime(t_s), member.pose, message);
    recent_.Add(id, static_cast<double>(message.utime_us - start_utime_us_) / 1e6, seen);
}

void Publisher::PublishBody(const WorldBody &body, double t_s)
{
    const Capsule now = body.At(t_s);
    turbopi::body_t message;
    message.utime_us = Utime(t_s);
    message.name = body.name;
    for (int i = 0; i < 2; ++i)
    {
        message.from_m[i] = now.from_m[i];
        message.to_m[i] = now.to_m[i];
    }
    message.radius_m = now.radius_m;
    message.colour = body.colour;
    message.solid = body.is_solid;
    outlet_.Send(message.utime_us, kBodyChannel, message);
}

void Publisher::PublishTruth(int id, double t_s, const Pose2 &pose, const RobotState &state)
{
    const Member &member = members_[static_cast<size_t>(id)];
    turbopi::truth_t truth;
    truth.utime_us = Utime(t_s);
    truth.robot_id = id;
    truth.x_m = pose.x_m;
    truth.y_m = pose.y_m;
    truth.theta_rad = pose.theta_rad;
    truth.vx_mps = state.vx_mps;
    truth.vy_mps = state.vy_mps;
    truth.omega_radps = state.omega_radps;
    for (size_t k = 0; k < kMaxWheels; ++k)
        truth.wheel_radps[k] = state.rim_mps[k] / member.wheel_radius_m;
    outlet_.Send(truth.utime_us, member.truth, truth);
}

}  // namespace twin
