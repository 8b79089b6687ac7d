// SPDX-License-Identifier: Apache-2.0
#include "plant/drive_chain.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace twin
{
namespace
{

// A first-order approach to rest never ends: below this rim speed a wheel counts as standing.
constexpr double kStandstill_mps = 1e-3;

// Piecewise-linear table, odd in `duty` (-1..1), held beyond its end.
double RimSpeed(const Base &base, double duty)
{
    const double pct = std::min(100 * std::abs(duty), base.duty_pct.back());
    size_t i = 1;
    while (pct > base.duty_pct[i])
        ++i;
    const double part = (pct - base.duty_pct[i - 1]) / (base.duty_pct[i] - base.duty_pct[i - 1]);
    const double low = base.wheel_speed_mps[i - 1], high = base.wheel_speed_mps[i];
    const double rim_mps = low + part * (high - low);
    return duty < 0 ? -rim_mps : rim_mps;
}

struct Relaxed
{
    double end, mean;
};

// exp(-dt / tau), kept for the next wheel: most often all four ask for the same.
class Decay
{
public:
    double Over(double dt_s, double tau_s)
    {
        if (dt_s != dt_s_ || tau_s != tau_s_)
        {
            dt_s_ = dt_s;
            tau_s_ = tau_s;
            value_ = std::exp(-dt_s / tau_s);
        }
        return value_;
    }

private:
    double dt_s_ = 0, tau_s_ = 0, value_ = 1;
};

// First-order approach of `target` over `dt_s`, exact: v' = (target - v) / tau.
Relaxed Approach(double v, double target, double tau_s, double dt_s, Decay &decays)
{
    if (tau_s <= 0)
        return {target, target};
    const double decay = decays.Over(dt_s, tau_s);
    return {target + (v - target) * decay, target + (v - target) * (1 - decay) * tau_s / dt_s};
}

// The same while slowing down no faster than `max_decel_mps2`: linear first, then first-order.
Relaxed Relax(double v, double target, double tau_s, double max_decel_mps2, double dt_s,
              Decay &decays)
{
    const bool slows = std::abs(target) < std::abs(v) || target * v < 0;
    if (!slows || max_decel_mps2 == kNoLimit)
        return Approach(v, target, tau_s, dt_s, decays);
    const double distance = std::abs(v - target) - max_decel_mps2 * tau_s;
    const double linear_s = std::clamp(distance / max_decel_mps2, 0.0, dt_s);
    const double rate = std::copysign(max_decel_mps2, target - v);
    const double turned = v + rate * linear_s;
    const double linear_mean = v + rate * linear_s / 2;
    const double rest_s = dt_s - linear_s;
    if (rest_s <= 0)
        return {turned, linear_mean};
    const Relaxed rest = Approach(turned, target, tau_s, rest_s, decays);
    return {rest.end, (linear_mean * linear_s + rest.mean * rest_s) / dt_s};
}

Signals Seen(const Pose2 &pose, double t_s)
{
    Signals s;
    s.x_m = pose.x_m;
    s.y_m = pose.y_m;
    s.theta_rad = pose.theta_rad;
    s.observed_t_s = t_s;
    return s;
}

}  // namespace

DriveChain::DriveChain(const Model &model)
    : base_(model.base),
      noise_(model.noise),
      clock_(model.clock),
      theta_a1_(model.theta_a1),
      theta_a2_(model.theta_a2),
      battery_nominal_V_(model.robot.battery_nominal_V),
      wheel_radius_m_(model.robot.wheel_radius_m),
      kinematics_(model.robot, model.base.wheels)
{
    for (const EffectInstance &instance : model.effects)
    {
        Bound bound{instance.Make(), state_size_};
        state_size_ += bound.effect->StateSize();
        switch (bound.effect->ActsAt(instance.spec->card))
        {
            case Stage::kDuty: duty_.push_back(std::move(bound)); break;
            case Stage::kWheel: wheel_.push_back(std::move(bound)); break;
            case Stage::kGround: ground_.push_back(std::move(bound)); break;
            case Stage::kObserve: observe_.push_back(std::move(bound)); break;
            case Stage::kWorld:
            case Stage::kView:
            case Stage::kDecide: break;
        }
    }
    for (auto *stage : {&duty_, &wheel_, &ground_, &observe_})
        std::ranges::stable_partition(*stage, [](const Bound &b) { return b.effect->ActsFirst(); });
}

RobotState DriveChain::Start(const Pose2 &pose) const
{
    RobotState state;
    state.pose = pose;
    state.effect_state.assign(static_cast<size_t>(state_size_), 0.0);
    return state;
}

void DriveChain::Run(const std::vector<Bound> &stage, Signals &signals, RobotState &state) const
{
    for (const Bound &bound : stage)
        bound.effect->Step(signals, state.effect_state.data() + bound.state_offset);
}

Wheels DriveChain::Target(const Wheels &command) const
{
    Wheels target_mps;
    switch (base_.drive)
    {
        case Drive::kDuty:
            for (int k = 0; k < kWheels; ++k)
                target_mps[k] = RimSpeed(base_, command[k]);
            break;
        case Drive::kWheelSpeed:
            for (int k = 0; k < kWheels; ++k)
                target_mps[k] = command[k] * wheel_radius_m_;
            break;
        case Drive::kTwist:
            target_mps = kinematics_.Inverse({command[0], command[1], command[2]});
            break;
    }
    return target_mps;
}

Wheels DriveChain::DriveWheels(const Command &command, double t_s, double dt_s,
                               RobotState &state) const
{
    Wheels mean_mps{};
    Decay decays;
    for (double done_s = 0; done_s < dt_s;)
    {
        Signals s;
        s.t_s = t_s + done_s;
        s.dt_s = dt_s - done_s;
        s.battery_V = command.battery_V;
        s.battery_nominal_V = battery_nominal_V_;
        s.wheel_radius_m = wheel_radius_m_;
        s.duty = command.value;
        Run(duty_, s, state);

        s.rim_mps = state.rim_mps;
        s.target_mps = Target(s.duty);
        s.tau_s.fill(base_.motor_lag_s);
        s.wheel_rad = state.wheel_rad;
        Run(wheel_, s, state);

        const double part = s.dt_s / dt_s, rad_per_mps = s.dt_s / wheel_radius_m_;
        for (int k = 0; k < kWheels; ++k)
        {
            const Relaxed rim = Relax(state.rim_mps[k], s.target_mps[k], s.tau_s[k],
                                      s.max_decel_mps2[k], s.dt_s, decays);
            state.rim_mps[k] = rim.end;
            state.wheel_rad[k] += rim.mean * rad_per_mps;
            mean_mps[k] += rim.mean * s.roll[k] * part;
        }
        done_s += s.dt_s;
    }
    return mean_mps;
}

// First-order (Ornstein-Uhlenbeck) velocity noise, mean over a step taken as its value: steps are
// short against drive_s.
void DriveChain::Disturb(Twist &twist, double dt_s, RobotState &state, Random &random) const
{
    const std::array<double, 3> std_{noise_.drive_mps, noise_.drive_mps, noise_.drive_radps};
    const std::array<double, 3> memory_s{noise_.drive_s, noise_.drive_s, noise_.drive_turn_s};
    for (size_t i = 0; i < 3; ++i)
    {
        const double keep = std::exp(-dt_s / memory_s[i]), fresh = std::sqrt(1 - keep * keep);
        state.drive_noise[i] = keep * state.drive_noise[i] + fresh * std_[i] * random.Normal();
    }
    twist.vx_mps += state.drive_noise[0];
    twist.vy_mps += state.drive_noise[1];
    twist.omega_radps += state.drive_noise[2];
}

Twist DriveChain::BodyTwist(const Wheels &rim_mps, double t_s, double dt_s, RobotState &state,
                            Random *random) const
{
    Twist twist = kinematics_.Forward(rim_mps);
    twist.vx_mps *= base_.forward_gain * theta_a1_;
    twist.vy_mps *= base_.sideways_gain * theta_a1_;
    twist.omega_radps *= base_.yaw_gain * theta_a2_;

    const bool moves = std::any_of(rim_mps.begin(), rim_mps.end(),
                                   [](double v) { return std::abs(v) > kStandstill_mps; });
    if (random && moves)
        Disturb(twist, dt_s, state, *random);
    if (!ground_.empty())
        ActOnGround(twist, rim_mps, moves, t_s, dt_s, state);
    state.vx_mps = twist.vx_mps;
    state.vy_mps = twist.vy_mps;
    state.omega_radps = twist.omega_radps;
    return twist;
}

void DriveChain::ActOnGround(Twist &twist, const Wheels &rim_mps, bool moves, double t_s,
                             double dt_s, RobotState &state) const
{
    Signals s;
    s.t_s = t_s;
    s.dt_s = dt_s;
    s.rim_mps = rim_mps;
    s.moves = moves;
    s.x_m = state.pose.x_m;
    s.y_m = state.pose.y_m;
    s.theta_rad = state.pose.theta_rad;
    s.vx_mps = twist.vx_mps;
    s.vy_mps = twist.vy_mps;
    s.omega_radps = twist.omega_radps;
    Run(ground_, s, state);
    twist = {s.vx_mps, s.vy_mps, s.omega_radps};
}

void DriveChain::Observe(Pose2 &pose, double &t_s) const
{
    if (!observe_.empty())
    {
        Signals s = Seen(pose, t_s);
        for (const Bound &bound : observe_)
            bound.effect->Step(s, nullptr);
        pose = {s.x_m, s.y_m, s.theta_rad};
        t_s = s.observed_t_s;
    }
    t_s = t_s * (1 + clock_.rate_ppm * 1e-6) + clock_.offset_s;
}

void DriveChain::Invert(Pose2 &pose, double &t_s) const
{
    t_s = (t_s - clock_.offset_s) / (1 + clock_.rate_ppm * 1e-6);
    if (observe_.empty())
        return;
    Signals s = Seen(pose, t_s);
    for (auto bound = observe_.rbegin(); bound != observe_.rend(); ++bound)
        bound->effect->Invert(s);
    pose = {s.x_m, s.y_m, s.theta_rad};
    t_s = s.observed_t_s;
}

}  // namespace twin
