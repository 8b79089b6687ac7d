// SPDX-License-Identifier: Apache-2.0
// Says of a swarm what real robots and a motion capture would say, and the truth besides.
#ifndef APP_PUBLISHER_H
#define APP_PUBLISHER_H

#include <string>
#include <vector>

#include "outlet.h"
#include "plant/drive_chain.h"
#include "plant/kinematics.h"
#include "plant/random.h"
#include "swarm/recent_poses.h"
#include "swarm/swarm.h"

namespace twin
{

// The beginning of a robot's channels: "R07".
std::string RobotName(int id);

class Publisher
{
public:
    struct Robot
    {
        std::string behavior;
        std::string config_toml;
    };
    // `models` and `robots` in the swarm's order; `swarm` at its start.
    Publisher(Outlet &outlet, const Swarm &swarm, const std::vector<Model> &models,
              std::vector<Robot> robots, const std::string &channel_prefix, double pose_rate_hz,
              uint64_t seed);

    // What R<nn>_RUN says from now on, at the next step first.
    void SetBehavior(int robot, const std::string &name)
    {
        Member &member = members_[static_cast<size_t>(robot)];
        member.run_due = member.run_due || member.robot.behavior != name;
        member.robot.behavior = name;
    }

    // What was published of poses, newest ones.
    const RecentPoses &recent() const { return recent_; }

    // After Swarm::Decide(): R<nn>_TELEMETRY, R<nn>_DRIVE of robots told velocities, and R<nn>_RUN
    // and TWIN_BODY every 5 s.
    void PublishDecisions(const Swarm &swarm);
    // At the start and after every Swarm::Advance(): the R<nn>_POSE and TWIN_TRUTH_R<nn> that fell
    // due, between the poses known before and after, and TWIN_BODY of bodies that move.
    void PublishPoses(const Swarm &swarm);

private:
    struct Member
    {
        Robot robot;
        Base base;
        Kinematics kinematics;
        DriveChain chain;
        Noise noise;
        double wheel_radius_m;
        Random random;
        RobotState last;
        std::string telemetry, drive, pose, run, truth;  // channels
        bool run_due = false;                            // before the others
    };
    void PublishRun(int id, int64_t utime_us);
    void PublishTelemetry(int id, const Swarm &swarm);
    void PublishDrive(int id, const Swarm &swarm);
    void PublishPose(int id, double t_s, const Pose2 &pose);
    void PublishBody(const WorldBody &body, double t_s);
    void PublishTruth(int id, double t_s, const Pose2 &pose, const RobotState &state);
    int64_t Utime(double t_s) const;

    Outlet &outlet_;
    std::vector<Member> members_;
    int64_t start_utime_us_, next_run_utime_us_;
    double pose_rate_hz_, last_t_s_ = 0;
    int32_t pose_seq_ = 0;
    RecentPoses recent_;
};

}  // namespace twin

#endif
