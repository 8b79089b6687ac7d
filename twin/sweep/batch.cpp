// SPDX-License-Identifier: Apache-2.0
#include "sweep/batch.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "fw/config.h"
#include "fw/mixing.h"
#include "plant/planar_plant.h"
#include "plant/random.h"
#include "sensor/view.h"
#include "swarm/robots.h"
#include "swarm/swarm.h"
#include "sweep/defence.h"

namespace twin
{
namespace
{

// Swarms change little within a sample; what is measured costs more than a step.
constexpr double kWindow_s = 10, kSample_s = 0.1;
constexpr size_t kAlign = 64;

std::vector<BatchWidth> UsableWidths()
{
    std::vector<BatchWidth> widths;
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl"))
        widths.push_back({16, BatchAdvance16});
    if (__builtin_cpu_supports("avx2"))
        widths.push_back({8, BatchAdvance8});
#endif
    widths.push_back({4, BatchAdvance4});
    return widths;
}

// How many numbers in [0, 2^53) are below `rate` as fractions, as the bits of a double.
double BelowRate(double rate)
{
    return std::bit_cast<double>(static_cast<int64_t>(std::ceil(std::ldexp(rate, 53))));
}

double StepS(const Base &base)
{
    return base.control_period_s / SubstepCount(base.control_period_s, SwarmOptions{}.max_step_s);
}

// The firmware's view of time: which frame has arrived, which votes are in.
std::vector<BatchStep> Schedule(const Model &model, const StepCount &count, int vote_frames,
                                int &kept_frames)
{
    const auto utime_us = [&](int step) {
        return std::llround(step * model.base.control_period_s * 1e6);
    };
    const int64_t delay_us = std::llround(model.sensor.delay_s * 1e6);
    std::vector<BatchStep> schedule;
    schedule.reserve(static_cast<size_t>(count.steps));
    int frame = -1, pushed = 0;
    kept_frames = 1;
    for (int step = 0; step < count.steps; ++step)
    {
        const int before = frame;
        while (frame < step && (delay_us == 0 || utime_us(frame + 1) + delay_us <= utime_us(step)))
            ++frame;
        const bool fresh = frame > before;
        const int slot = fresh ? pushed++ % vote_frames : -1;
        schedule.push_back({frame, slot, std::min(pushed, vote_frames), count.Measures(step)});
        kept_frames = std::max(kept_frames, step - std::max(frame, 0) + 1);
    }
    for (BatchStep &step : schedule)
        step.frame = step.frame < 0 ? -1 : step.frame % kept_frames;
    return schedule;
}

class Batch
{
public:
    Batch(const BatchWidth &width, std::span<const World> worlds, double duration_s,
          bool prefilters)
        : worlds_(worlds),
          lanes_(width.lanes),
          advance_(width.advance),
          defence_(*worlds.front().cell)
    {
        const Cell &cell = *worlds.front().cell;
        const Model &model = cell.model;
        const StepCount count = CountSteps(model.base.control_period_s, duration_s);
        measured_ = count.Measured();
        plan_.n = static_cast<int>(cell.tables.size());
        plan_.ring = static_cast<int>(cell.ring_size);
        plan_.step_count = count.steps;
        bits_ = MakeBits(model);
        plan_.bits = static_cast<int>(bits_.size());
        FindShown(cell);
        plan_.prefilters = prefilters && IsPlain() && cell.world.empty();
        plan_.substeps = SubstepCount(model.base.control_period_s, SwarmOptions{}.max_step_s);
        plan_.vote_frames = static_cast<int>(std::lround(model.sensor.vote_frames));
        schedule_ = Schedule(model, count, plan_.vote_frames, plan_.kept_frames);
        plan_.steps = schedule_.data();
        plan_.body_m = 2 * model.robot.body_radius_m;
        plan_.touch_m = plan_.body_m * kTouch;
        FindWorld(cell);
        const size_t size = static_cast<size_t>(BatchLayout(plan_).total) * lanes_ / 2;
        memory_.assign(size + kAlign / sizeof(double), 0.0);
        numbers_ = Aligned(memory_);
        for (size_t lane = 0; lane < lanes_; ++lane)  // idle lanes repeat the first world
            FillLane(lane, worlds[lane < worlds.size() ? lane : 0]);
    }

    void Run() { advance_(plan_, numbers_); }

    Outcome OutcomeOf(size_t lane) const
    {
        const auto mean = [&](BatchSum sum) { return Sum(sum, lane) / measured_; };
        return {{mean(kCirclinessSum), mean(kRadiusSum), mean(kScatterSum), mean(kRotationSum),
                 mean(kOddSum), mean(kDiffusionSum), mean(kGroupsSum), mean(kContactsSum)},
                Sum(kLeastDiffusion, lane),
                std::numeric_limits<double>::quiet_NaN(),
                DefenceOf(Sum(kCaught, lane), Sum(kReached, lane), Sum(kInside, lane),
                          plan_.step_count)};
    }

private:
    static double *Aligned(std::vector<double> &memory)
    {
        const auto address = reinterpret_cast<uintptr_t>(memory.data());
        return memory.data() + (kAlign - address % kAlign) % kAlign / sizeof(double);
    }

    // A number of a lane, `at` that of BatchLayout.
    double &Number(int at, size_t lane) const
    {
        const size_t half = lanes_ / 2, size = static_cast<size_t>(BatchLayout(plan_).size);
        return numbers_[(lane / half * size + static_cast<size_t>(at)) * half + lane % half];
    }

    double &At(int column, size_t robot, size_t lane)
    {
        return Number(column * plan_.n + static_cast<int>(robot), lane);
    }

    double &Sum(int sum, size_t lane) const { return Number(BatchLayout(plan_).sums + sum, lane); }

    void FillLane(size_t lane, const World &world)
    {
        const Cell &cell = *world.cell;
        Model model = cell.model;
        model.stated.clear();  // many names, which each robot would have a copy of, and none needs
        const auto robots = DrawRobots(model, plan_.n, world.seed);
        const auto starts = StartsOf(cell, world.seed);
        for (size_t i = 0; i < robots.size(); ++i)
        {
            At(kX, i, lane) = starts[i].x_m;
            At(kY, i, lane) = starts[i].y_m;
            At(kCos, i, lane) = std::cos(starts[i].theta_rad);
            At(kSin, i, lane) = std::sin(starts[i].theta_rad);
            FillSensor(i, lane, robots[i].sensor);
            for (size_t bit = 0; bit < bits_.size(); ++bit)
                FillEye(static_cast<int>(bit), i, lane, robots[i].MakeDetectionModel());
            At(kDice, i, lane) =
                std::bit_cast<double>(Random(world.seed, static_cast<int>(i), "sensor").State());
            const DriveChain chain(robots[i]);
            for (int row = 0; row < 1 << plan_.bits; ++row)
                FillRow(row, i, lane, chain, robots[i].base,
                        fw_table_lookup(&cell.tables[i], static_cast<uint32_t>(row)));
        }
        Number(BatchLayout(plan_).range, lane) = cell.model.sensor.range_m;
        for (const BatchSum least : {kLeastDiffusion, kCaught, kReached})
            Sum(least, lane) = std::numeric_limits<double>::infinity();
    }

    void FillSensor(size_t robot, size_t lane, const Sensor &sensor)
    {
        At(kMiss, robot, lane) = BelowRate(sensor.false_negative_rate);
        At(kFalse, robot, lane) = BelowRate(sensor.false_positive_rate);
        plan_.target_is_disc |= sensor.target_radius_m > 0;
        plan_.errors |= sensor.false_negative_rate > 0 || sensor.false_positive_rate > 0;
    }

    void FillEye(int bit, size_t robot, size_t lane, const DetectionModel &whole)
    {
        const auto sector = static_cast<fw_sector>(bits_[static_cast<size_t>(bit)].sector);
        const DetectionModel eye = InSector(whole, sector);
        const double half_cos = std::cos(eye.cone_rad / 2);
        const auto at = [&](BitColumn column) -> double & {
            return At(BatchLayout(plan_).OfBit(bit, column), robot, lane);
        };
        at(kAxisCos) = std::cos(eye.pan_rad);
        at(kAxisSin) = std::sin(eye.pan_rad);
        at(kRange2) = eye.range_m * eye.range_m;
        at(kCone) = half_cos * std::abs(half_cos);
        at(kHalfCos) = half_cos;
        at(kHalfSin) = std::sin(eye.cone_rad / 2);
        at(kTarget2) = eye.target_radius_m * eye.target_radius_m;
    }

    void FindShown(const Cell &cell)
    {
        for (const fw_bit &bit : bits_)
            for (size_t i = 0; i < cell.tables.size(); ++i)
                shown_.push_back(IsInside(cell.ColourOf(i), bit.box));
        plan_.shown = shown_.data();
    }

    // Where its bodies are, and who sees them; after substeps were counted.
    void FindWorld(const Cell &cell)
    {
        plan_.world = defence_.World();
        plan_.step_s = cell.model.base.control_period_s;
        for (const fw_bit &bit : bits_)
            for (const WorldBody &body : cell.world)
                bodies_shown_.push_back(!body.colour.empty() &&
                                        IsInside(ColourNamed(body.colour), bit.box));
        plan_.bodies_shown = bodies_shown_.data();
        const int times = cell.world.empty() ? 0 : plan_.step_count * plan_.substeps + 1;
        for (int k = 0; k < times; ++k)
            std::ranges::copy(PlacesAt(cell.world, k * plan_.step_s / plan_.substeps),
                              std::back_inserter(places_));
        plan_.places = places_.data();
    }

    // Any other robot, anywhere ahead.
    bool IsPlain() const
    {
        return bits_.size() == 1 && bits_[0].sector == FW_SECTOR_ALL &&
               std::ranges::find(shown_, 0) == shown_.end();
    }

    // The motion that a row of the table gives this robot, and one substep of it: the chord of the
    // arc, in the body frame, and the turn.
    void FillRow(int row, size_t robot, size_t lane, const DriveChain &chain, const Base &base,
                 const fw_input &input)
    {
        const auto at = [&](int column) -> double & {
            return At(BatchLayout(plan_).OfRow(row, column), robot, lane);
        };
        const double dt_s = StepS(base);
        RobotState state = chain.Start({});
        int8_t duty_pct[FW_WHEEL_COUNT];
        fw_mix(&input, duty_pct);
        PlanarStep(chain, CommandFor(base, input, duty_pct), 0, dt_s, state, nullptr);
        const double length_m = std::hypot(state.pose.x_m, state.pose.y_m);
        plan_.most_m = std::max(plan_.most_m, 1.01 * plan_.substeps * length_m);
        at(kRowX) = state.pose.x_m;
        at(kRowY) = state.pose.y_m;
        at(kRowCos) = std::cos(state.pose.theta_rad);
        at(kRowSin) = std::sin(state.pose.theta_rad);
        const Motion taken = MotionOf(state.vx_mps, state.vy_mps, state.omega_radps);
        for (size_t k = 0; k < taken.size(); ++k)
            at(kRowMotion + static_cast<int>(k)) = taken[k];
    }

    std::span<const World> worlds_;
    size_t lanes_;
    BatchAdvance advance_;
    int measured_ = 0;
    BatchPlan plan_{};
    std::vector<BatchStep> schedule_;
    std::vector<fw_bit> bits_;
    DefencePlan defence_;
    std::vector<uint8_t> shown_, bodies_shown_;
    std::vector<PlainCapsule> places_;
    std::vector<double> memory_;
    double *numbers_ = nullptr;
};

}  // namespace

std::span<const BatchWidth> BatchWidths()
{
    static const std::vector<BatchWidth> widths = UsableWidths();
    return widths;
}

bool SameBatch(const Cell &a, const Cell &b)
{
    const Model &m = a.model, &o = b.model;
    return a.tables.size() == b.tables.size() && a.ring_size == b.ring_size &&
           a.colours == b.colours && a.world == b.world && m.sensor.bits == o.sensor.bits &&
           m.base.control_period_s == o.base.control_period_s &&
           m.sensor.delay_s == o.sensor.delay_s && m.sensor.vote_frames == o.sensor.vote_frames &&
           m.robot.body_radius_m == o.robot.body_radius_m;
}

StepCount CountSteps(double period_s, double duration_s)
{
    const int steps = std::max(1, static_cast<int>(std::ceil(duration_s / period_s - 0.5)));
    const int stride = std::max(1, static_cast<int>(kSample_s / period_s));
    int first = steps - 1;
    while (first >= stride && (first - stride + 1) * period_s > steps * period_s - kWindow_s)
        first -= stride;
    return {steps, first, stride};
}

std::string WhyNotBatched(const Model &model)
{
    if (!model.effects.empty())
        return std::string("the model has the effect ") + model.effects.front().spec->card.name;
    if (model.noise.drive_mps > 0 || model.noise.drive_radps > 0)
        return "the model has drive noise";
    // With a frame older than this at the next step, the firmware forgets its votes.
    const double timeout_s = static_cast<double>(fw_config_default().frame_timeout_us) * 1e-6;
    if (model.sensor.delay_s + 2 * model.base.control_period_s > timeout_s)
        return "the sensor's delay comes near the firmware's time-out";
    if (model.base.motor_lag_s > 0)
        return "the model has motor lag";
    const auto votes_alike = [&](const fw_bit &bit) {
        return bit.vote.window_us == INT64_MAX &&
               bit.vote.max_frames == std::lround(model.sensor.vote_frames);
    };
    if (!std::ranges::all_of(MakeBits(model), votes_alike))
        return "a bit of the model has a vote of its own";
    for (const auto &[id, values] : model.robot_overrides)
    {
        const Model robot = model.ForRobot(id);
        if (robot.base.motor_lag_s > 0 || robot.sensor.delay_s != model.sensor.delay_s)
            return "a robot of the model has a lag or delay of its own";
    }
    return "";
}

void RunBatch(const BatchWidth &width, std::span<const World> worlds, double duration_s,
              std::span<Outcome> outcomes, bool prefilters)
{
    Batch batch(width, worlds, duration_s, prefilters);
    batch.Run();
    for (size_t lane = 0; lane < worlds.size(); ++lane)
        outcomes[lane] = batch.OutcomeOf(lane);
}

}  // namespace twin
