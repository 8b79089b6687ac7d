// SPDX-License-Identifier: Apache-2.0
#include "plant/drive_chain.h"

#include <algorithm>
#include <cmath>
#include <ranges>
#include <tuple>
#include <type_traits>

namespace twin
{
namespace
{

// Piecewise-linear table, odd in a duty (-1..1), held beyond its end; of so many wheels.
Wheels RimSpeeds(const Base &base, const Wheels &duty, int wheels)
{
    Wheels pct, place{};  // counted without a branch: duties come in no order
    for (size_t w = 0; w < kMaxWheels; ++w)
        pct[w] = std::min(100 * std::abs(duty[w]), base.duty_pct.back());
    for (size_t k = 1; k + 1 < base.duty_pct.size(); ++k)
        for (size_t w = 0; w < kMaxWheels; ++w)
            place[w] += pct[w] > base.duty_pct[k] ? 1.0 : 0.0;
    Wheels from_pct, to_pct, from_mps, to_mps, rim_mps;
    for (size_t w = 0; w < kMaxWheels; ++w)
    {
        const auto at = static_cast<size_t>(static_cast<int>(place[w]));
        from_pct[w] = base.duty_pct[at];
        to_pct[w] = base.duty_pct[at + 1];
        from_mps[w] = base.wheel_speed_mps[at];
        to_mps[w] = base.wheel_speed_mps[at + 1];
    }
    for (size_t w = 0; w < kMaxWheels; ++w)
    {
        const double part = (pct[w] - from_pct[w]) / (to_pct[w] - from_pct[w]);
        const double size_mps = from_mps[w] + part * (to_mps[w] - from_mps[w]);
        rim_mps[w] = duty[w] < 0 ? -size_mps : size_mps;
    }
    for (size_t w = static_cast<size_t>(wheels); w < kMaxWheels; ++w)
        rim_mps[w] = 0;
    return rim_mps;
}

struct Relaxed
{
    double end, mean;
};

// First-order approach of `target` over `dt_s`, exact: v' = (target - v) / tau.
Relaxed Approach(double v, double target, double tau_s, double dt_s, Decays &decays)
{
    const Decay &decay = decays.Over(dt_s, tau_s);
    return {target + (v - target) * decay.end, target + (v - target) * decay.mean};
}

// The same while slowing down no faster than `max_decel_mps2`: linear first, then first-order.
Relaxed Relax(double v, double target, double tau_s, double max_decel_mps2, double dt_s,
              Decays &decays)
{
    if (max_decel_mps2 == kNoLimit)
        return Approach(v, target, tau_s, dt_s, decays);
    const bool slows = std::abs(target) < std::abs(v) || target * v < 0;
    if (!slows)
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

// Nothing limits how fast wheels slow down, and all lag alike.
bool RelaxAlike(const WheelSignals &s)
{
    bool alike = true;
    for (size_t k = 0; k < kMaxWheels; ++k)
        alike &= (s.tau_s[k] == s.tau_s[0]) & (s.max_decel_mps2[k] == kNoLimit);
    return alike;
}

// As Approach(), of all wheels at once; those that a robot has not stand and are told to. Returns
// their means.
Wheels ApproachAlike(Wheels &rim_mps, const Wheels &target_mps, const Decay &decay)
{
    const Wheels begun_mps = rim_mps, told_mps = target_mps;
    Wheels mean_mps;
    for (size_t k = 0; k < kMaxWheels; ++k)
    {
        const double away = begun_mps[k] - told_mps[k];
        rim_mps[k] = told_mps[k] + away * decay.end;
        mean_mps[k] = told_mps[k] + away * decay.mean;
    }
    return mean_mps;
}

double SignOf(double place_m)
{
    constexpr double kMiddle_m = 1e-9;
    return std::abs(place_m) < kMiddle_m ? 0.0 : std::copysign(1.0, place_m);
}

Wheels SpinOf(const Model &model)
{
    Wheels spin = Kinematics(model.robot, model.base.wheels).Inverse({0, 0, 1}).rim_mps;
    double square = 0;
    for (const double v : spin)
        square += v * v;
    for (double &v : spin)
        v = square > 0 ? v / std::sqrt(square) : 0;
    return spin;
}

RobotFacts FactsOf(const Model &model)
{
    const std::vector<Wheel> wheels = model.MakeWheels();
    RobotFacts facts{
        static_cast<int>(wheels.size()), {}, {}, SpinOf(model), model.robot.wheel_radius_m,
        model.robot.battery_nominal_V};
    for (size_t k = 0; k < wheels.size(); ++k)
    {
        facts.left[k] = SignOf(wheels[k].y_m);
        facts.front[k] = SignOf(wheels[k].x_m);
    }
    return facts;
}

// Depends on nothing but the signals of its step that are the same everywhere in the room.
bool IsSameEverywhere(const BoundEffect &effect)
{
    const Card &card = effect.spec().card;
    return card.needs != Needs::kRoom && card.family != Family::kFormula && effect.StateSize() == 0;
}

// A command's effect on duties or on what wheels tend to, and nothing but the command decides it.
bool AsksByCommandAlone(const BoundEffect &effect)
{
    const Card &card = effect.spec().card;
    return card.needs == Needs::kSteadySpeed && card.family != Family::kFormula &&
           effect.StateSize() == 0;
}

}  // namespace

DriveChain::DriveChain(const Model &model)
    : base_(model.base),
      noise_(model.noise),
      clock_(model.clock),
      frame_(model.frame),
      theta_a1_(model.theta_a1),
      theta_a2_(model.theta_a2),
      robot_(FactsOf(model)),
      kinematics_(model.robot, model.base.wheels)
{
    for (const EffectInstance &instance : model.effects)
        Bind(instance);
}

void DriveChain::Bind(const EffectInstance &instance)
{
    const BoundEffect &effect =
        *effects_.emplace_back(std::make_unique<const BoundEffect>(instance.Bind()));
    const int offset = state_size_;
    state_size_ += effect.StateSize();
    const auto put = [&]<class On>(std::vector<Bound<On>> &stage) {
        const Turn turn = effect.spec().turn;
        const auto at = std::ranges::upper_bound(stage, turn, {}, &Bound<On>::turn);
        stage.insert(at, {std::get<On>(effect.act()), effect.numbers(), offset, turn});
    };
    std::visit(
        [&]<class On>(const On &) {
            if constexpr (std::is_same_v<On, OnDuty>)
                put(duty_);
            else if constexpr (std::is_same_v<On, OnWheels>)
                put(wheel_);
            else if constexpr (std::is_same_v<On, OnRolling>)
                put(rolling_);
            else if constexpr (std::is_same_v<On, OnGround>)
                put(ground_);
            else if constexpr (std::is_same_v<On, OnObservation>)
                put(observe_);
        },
        effect.act());
    if (std::holds_alternative<OnDuty>(effect.act()) ||
        std::holds_alternative<OnWheels>(effect.act()))
        prompt_ = prompt_ && AsksByCommandAlone(effect);
    if (std::holds_alternative<OnGround>(effect.act()))
    {
        homogeneous_ = homogeneous_ && IsSameEverywhere(effect);
        remembers_on_ground_ = remembers_on_ground_ || effect.StateSize() > 0;
    }
}

// The effects of these stages are the same in both.
template <class... On>
bool DriveChain::HasSame(const DriveChain &other) const
{
    const auto acts = [](const auto &effect) {
        return (std::holds_alternative<On>(effect->act()) || ...);
    };
    const auto same = [](const auto &a, const auto &b) { return *a == *b; };
    return std::ranges::equal(effects_ | std::views::filter(acts),
                              other.effects_ | std::views::filter(acts), same);
}

bool DriveChain::DrivesAs(const DriveChain &other) const
{
    const auto has = [](const DriveChain &chain) {
        return std::tie(chain.base_.drive, chain.base_.duty_pct, chain.base_.wheel_speed_mps,
                        chain.base_.motor_lag_s, chain.base_.steering_lag_s, chain.frame_.wheel_rad,
                        chain.robot_, chain.kinematics_);
    };
    return has(*this) == has(other) && HasSame<OnDuty, OnWheels, OnRolling>(other);
}

bool DriveChain::IsSeenAs(const DriveChain &other) const
{
    const auto has = [](const DriveChain &chain) {
        return std::tie(chain.clock_.offset_s, chain.clock_.rate_ppm, chain.frame_.heading_rad);
    };
    return has(*this) == has(other) && HasSame<OnObservation>(other);
}

bool DriveChain::IsSilent() const
{
    return std::ranges::any_of(effects_, [](const auto &effect) { return effect->IsSilent(); });
}

RobotState DriveChain::Start(const Pose2 &pose) const
{
    RobotState state;
    state.pose = pose;
    state.wheel_rad = frame_.wheel_rad;
    state.effect_state.assign(static_cast<size_t>(state_size_), 0.0);
    return state;
}

template <class On, class S>
void DriveChain::Run(const std::vector<Bound<On>> &stage, S &signals, RobotState &state)
{
    for (const Bound<On> &bound : stage)
        bound.act.step(signals, bound.numbers, state.effect_state.data() + bound.state_offset);
}

WheelMotion DriveChain::Target(const Wheels &command) const
{
    WheelMotion target;
    switch (base_.drive)
    {
        case Drive::kDuty: target.rim_mps = RimSpeeds(base_, command, robot_.wheels); break;
        case Drive::kWheelSpeed:
            for (int k = 0; k < robot_.wheels; ++k)
                target.rim_mps[k] = command[k] * robot_.wheel_radius_m;
            break;
        case Drive::kTwist:
            target = kinematics_.Inverse({command[0], command[1], command[2]});
            break;
        case Drive::kSteering: target = kinematics_.Steered(command[0], command[1]); break;
    }
    return target;
}

// What a command asks of the wheels, where that depends on the command alone.
void DriveChain::Ask(const Command &command, RobotState &state) const
{
    DutySignals duty{robot_, 0, command.battery_V, 0, command.value};
    Run(duty_, duty, state);
    const WheelMotion target = Target(duty.duty);
    WheelSignals wheels{
        robot_, 0, 0, command.battery_V, duty.duty, state.rim_mps, state.wheel_rad, target.rim_mps};
    Run(wheel_, wheels, state);
    state.told = command.value;
    state.duty = duty.duty;
    state.asked_mps = wheels.target_mps;
    state.asked_steering_rad = target.steering_rad;
}

WheelMotion DriveChain::DriveWheels(const Command &command, double t_s, double dt_s,
                                    RobotState &state) const
{
    if (prompt_)
    {
        if (state.told != command.value)
            Ask(command, state);
        return Approached(state.decays.Over(dt_s, base_.motor_lag_s), t_s, state);
    }
    if (duty_.empty())
        return DrivePart({robot_, t_s, command.battery_V, dt_s, command.value}, state);
    WheelMotion mean;
    for (double done_s = 0; done_s < dt_s;)
    {
        DutySignals duty{robot_, t_s + done_s, command.battery_V, dt_s - done_s, command.value};
        Run(duty_, duty, state);
        const WheelMotion part = DrivePart(duty, state);
        const double share = duty.dt_s / dt_s;
        for (size_t k = 0; k < kMaxWheels; ++k)
            mean.rim_mps[k] += part.rim_mps[k] * share;
        mean.steering_rad += part.steering_rad * share;
        done_s += duty.dt_s;
    }
    return mean;
}

// Wheels that all lag alike on their way to what they are asked for.
WheelMotion DriveChain::Approached(const Decay &decay, double t_s, RobotState &state) const
{
    return Turned(t_s, decay.dt_s, ApproachAlike(state.rim_mps, state.asked_mps, decay), state);
}

std::vector<Rolling> DriveChain::RollThrough(std::span<const DriveStep> steps,
                                             std::span<const Decay> decays) const
{
    std::vector<Rolling> rolled;
    rolled.reserve(steps.size());
    RobotState state = Start({});
    if (!prompt_)
    {
        for (const auto &[command, t_s, dt_s] : steps)
            RollBy(DriveWheels(command, t_s, dt_s, state), rolled.emplace_back());
        return rolled;
    }
    // Of wheels whose angles nothing asks for the speeds alone are followed.
    const bool plain = rolling_.empty() && !kinematics_.steers();
    WheelMotion mean;
    Wheels rim_mps{};
    for (size_t i = 0; i < steps.size(); ++i)
    {
        if (state.told != steps[i].command.value)
            Ask(steps[i].command, state);
        if (plain)
            mean.rim_mps = ApproachAlike(rim_mps, state.asked_mps, decays[i]);
        else
            mean = Approached(decays[i], steps[i].t_s, state);
        RollBy(mean, rolled.emplace_back());
    }
    return rolled;
}

// The same over a part of a step in which the duties stay the same.
WheelMotion DriveChain::DrivePart(const DutySignals &duty, RobotState &state) const
{
    if (state.duty != duty.duty)
    {
        const WheelMotion target = Target(duty.duty);
        state.duty = duty.duty;
        state.asked_mps = target.rim_mps;
        state.asked_steering_rad = target.steering_rad;
    }
    if (wheel_.empty())
        return Approached(state.decays.Over(duty.dt_s, base_.motor_lag_s), duty.t_s, state);
    return Turned(duty.t_s, duty.dt_s, TurnWheels(duty, state), state);
}

// The motion of wheels with these speeds over a part of a step.
WheelMotion DriveChain::Turned(double t_s, double dt_s, const Wheels &mean_mps,
                               RobotState &state) const
{
    WheelMotion motion{mean_mps, 0};
    if (!rolling_.empty())
    {
        RollSignals roll{robot_, t_s, dt_s, state.duty, mean_mps, state.rim_mps, state.wheel_rad};
        Run(rolling_, roll, state);
        for (size_t k = 0; k < kMaxWheels; ++k)
            motion.rim_mps[k] *= roll.radius_ratio[k];
    }
    const double rad_per_mps = dt_s / robot_.wheel_radius_m;
    for (size_t k = 0; k < kMaxWheels; ++k)
        state.wheel_rad[k] += mean_mps[k] * rad_per_mps;
    if (kinematics_.steers())
    {
        const Relaxed steering = Approach(state.steering_rad, state.asked_steering_rad,
                                          base_.steering_lag_s, dt_s, state.decays);
        state.steering_rad = steering.end;
        motion.steering_rad = steering.mean;
    }
    return motion;
}

// Takes rim speeds over that part with the effects on wheels, and returns their means.
Wheels DriveChain::TurnWheels(const DutySignals &duty, RobotState &state) const
{
    WheelSignals s{robot_,    duty.t_s,      duty.dt_s,       duty.battery_V,
                   duty.duty, state.rim_mps, state.wheel_rad, state.asked_mps};
    s.tau_s.fill(base_.motor_lag_s);
    Run(wheel_, s, state);
    if (RelaxAlike(s))
        return ApproachAlike(state.rim_mps, s.target_mps, state.decays.Over(s.dt_s, s.tau_s[0]));
    Wheels mean_mps{};
    for (int k = 0; k < robot_.wheels; ++k)
    {
        const Relaxed rim = Relax(state.rim_mps[k], s.target_mps[k], s.tau_s[k],
                                  s.max_decel_mps2[k], s.dt_s, state.decays);
        mean_mps[k] = rim.mean;
        state.rim_mps[k] = rim.end;
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

Twist DriveChain::BodyTwist(const WheelMotion &motion, double t_s, double dt_s, RobotState &state,
                            Random *random) const
{
    const Direction ahead = ground_.empty() ? Direction{} : Direction::Of(state.pose.theta_rad);
    Rolling rolling;
    RollBy(motion, rolling);
    return OnFloor(rolling, ahead, t_s, dt_s, state, random);
}

Twist DriveChain::OnFloor(const Rolling &rolling, const Direction &ahead, double t_s, double dt_s,
                          RobotState &state, Random *random) const
{
    Twist twist = Geared(rolling);
    if (random && rolling.moves)
        Disturb(twist, dt_s, state, *random);
    if (!ground_.empty())
    {
        GroundSignals s{robot_,
                        t_s,
                        dt_s,
                        rolling.moves,
                        state.pose.x_m,
                        state.pose.y_m,
                        state.pose.theta_rad,
                        ahead,
                        twist.vx_mps,
                        twist.vy_mps,
                        twist.omega_radps};
        Run(ground_, s, state);
        twist = {s.vx_mps, s.vy_mps, s.omega_radps};
    }
    state.vx_mps = twist.vx_mps;
    state.vy_mps = twist.vy_mps;
    state.omega_radps = twist.omega_radps;
    return twist;
}

void DriveChain::Observe(Pose2 &pose, double &t_s) const
{
    if (!observe_.empty())
    {
        ObservedPose seen{pose.x_m, pose.y_m, pose.theta_rad, t_s};
        for (const Bound<OnObservation> &bound : observe_)
            bound.act.observe(seen, bound.numbers);
        pose = {seen.x_m, seen.y_m, seen.theta_rad};
        t_s = seen.t_s;
    }
    pose.theta_rad -= frame_.heading_rad;
    t_s = t_s * (1 + clock_.rate_ppm * 1e-6) + clock_.offset_s;
}

void DriveChain::Invert(Pose2 &pose, double &t_s) const
{
    t_s = (t_s - clock_.offset_s) / (1 + clock_.rate_ppm * 1e-6);
    pose.theta_rad += frame_.heading_rad;
    if (observe_.empty())
        return;
    ObservedPose seen{pose.x_m, pose.y_m, pose.theta_rad, t_s};
    for (auto bound = observe_.rbegin(); bound != observe_.rend(); ++bound)
        bound->act.invert(seen, bound->numbers);
    pose = {seen.x_m, seen.y_m, seen.theta_rad};
    t_s = seen.t_s;
}

}  // namespace twin
