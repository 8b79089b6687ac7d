// SPDX-License-Identifier: Apache-2.0
// Moves robots: commands in, poses out. Two plants share this interface, the drive chain and the
// effects.
#ifndef PLANT_PLANT_H
#define PLANT_PLANT_H

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "effects/signals.h"

namespace twin
{

// In one swarm.
constexpr int kMaxRobots = 1000;

struct Pose2
{
    double x_m = 0, y_m = 0, theta_rad = 0;
};

// What a robot is told in one step. Which part counts is said by the model's drive.
struct Command
{
    // Duty drive: duties -1..1. Wheel-speed drive: rad/s. Twist drive: vx_mps, vy_mps, omega_radps.
    // Steering drive: vx_mps, steering_rad (of the middle of the front axle, left positive).
    Wheels value{};
    double battery_V = 0;  // 0: the model's nominal voltage
};

constexpr double kUntold = std::numeric_limits<double>::quiet_NaN();

// What is left of a first-order lag after a step, 1 at its begin: exp(-dt / tau) at its end, and
// the mean meanwhile.
struct Decay
{
    double dt_s = 0, tau_s = 0, end = 1, mean = 1;

    static Decay Over(double dt_s, double tau_s)
    {
        if (tau_s <= 0)
            return {dt_s, tau_s, 0, 0};
        const double end = std::exp(-dt_s / tau_s);
        return {dt_s, tau_s, end, (1 - end) * tau_s / dt_s};
    }
};

// Decays of late: commands that come evenly ask for the same few again and again.
class Decays
{
public:
    const Decay &Over(double dt_s, double tau_s)
    {
        const uint64_t mixed = std::bit_cast<uint64_t>(dt_s) * 0x9E3779B97F4A7C15;
        Decay &decay = known_[mixed >> (64 - kBits)];
        if (dt_s != decay.dt_s || tau_s != decay.tau_s)
            decay = Decay::Over(dt_s, tau_s);
        return decay;
    }

private:
    static constexpr int kBits = 6;
    std::array<Decay, 1 << kBits> known_;
};

struct RobotState
{
    Pose2 pose;
    double vx_mps = 0, vy_mps = 0, omega_radps = 0;  // body frame, mean over the last step
    Wheels rim_mps{};
    Wheels wheel_rad{};       // angle at the start and what was turned since
    double steering_rad = 0;  // Ackermann
    // The command, or that command as the stage of duty left it, and the rim speeds and steering
    // that it asks for: most often the next step has the same.
    Wheels told{kUntold, kUntold, kUntold, kUntold}, duty = told, asked_mps{};
    double asked_steering_rad = 0;
    std::array<double, 3> drive_noise{};  // velocity disturbance: forward, left, turn
    Decays decays;
    std::vector<double> effect_state;
};

class Plant
{
public:
    virtual ~Plant() = default;
    virtual int Size() const = 0;
    virtual void SetCommand(int robot, const Command &command) = 0;
    // Moves all robots forward by `dt_s`.
    virtual void Step(double dt_s) = 0;
    virtual const RobotState &State(int robot) const = 0;
    // Some formula of the robot's model has had no finite value at any step, so that it did
    // nothing.
    virtual bool IsSilent(int) const { return false; }
    virtual double TimeS() const = 0;
};

}  // namespace twin

#endif
