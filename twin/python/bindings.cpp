// SPDX-License-Identifier: Apache-2.0
// twinmill_native: the catalogue, model files, short predictions and swarms for Python.
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <functional>
#include "arrays.h"
#include "pickle_bindings.h"

#include "fw/mixing.h"
#include "model_file/installed.h"
#include "plant/kinematics.h"
#include "predict/predict.h"
#include "predict/steady.h"
#include "sensor/view.h"

using namespace nanobind::literals;
using namespace twin;

namespace
{

using Poses = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

// The arrays of a run, checked once and kept alive.
struct PyTrack
{
    PyTrack(Vector command_t_s_, Matrix command_, Vector battery_V_, Vector pose_t_s_, Matrix pose_,
            Indices segment_)
        : command_t_s(command_t_s_),
          battery_V(battery_V_),
          pose_t_s(pose_t_s_),
          command(command_),
          pose(pose_),
          segment(segment_)
    {
        const size_t m = command_t_s.size(), n = pose_t_s.size();
        if (command.shape(0) != m || command.shape(1) != kMaxWheels || battery_V.size() != m)
            throw std::invalid_argument(
                "command must be (M, 4) and battery_V (M), as long as command_t_s");
        if (pose.shape(0) != n || pose.shape(1) != 3 || segment.size() != n)
            throw std::invalid_argument("pose must be (N, 3) and segment (N), as long as pose_t_s");
    }
    Track View() const
    {
        return {Span(command_t_s), Span(command), Span(battery_V), Span(pose_t_s),
                Span(pose),        Span(segment), &recordings};
    }
    Vector command_t_s, battery_V, pose_t_s;
    Matrix command, pose;
    Indices segment;
    mutable Recordings recordings;
};

nb::list Words(const std::vector<const char *> &words)
{
    nb::list list;
    for (const char *word : words)
        list.append(word);
    return list;
}

nb::dict ParameterEntry(const Parameter &p)
{
    nb::dict row;
    row["name"] = p.name;
    row["unit"] = p.unit;
    row["value"] = p.value;
    row["neutral"] = p.neutral;
    row["default"] = p.default_value;
    row["min"] = p.min;
    row["max"] = p.max;
    row["usual_size"] = p.usual_size;
    row["held"] = p.held;
    row["stage"] = p.stage;
    row["role"] = RoleName(p.role);
    row["place_like"] = p.role == Role::kPlace;
    row["above"] = p.above;
    row["below"] = p.below;
    row["doc"] = p.doc;
    return row;
}

// `own`: its parameters on some robot.
nb::dict CardEntry(const EffectSpec &spec, const std::vector<Parameter> &own)
{
    const Card &card = spec.card;
    nb::dict entry;
    entry["name"] = card.name;
    entry["stage"] = StageName(spec.act);
    entry["family"] = FamilyName(card.family);
    entry["phrase"] = card.phrase;
    entry["summary"] = card.summary;
    entry["equation"] = card.equation;
    entry["leaves_out"] = card.leaves_out;
    entry["measure"] = card.measure;
    entry["identify"] = Words(ManeuverNames(card.identify));
    entry["needs"] = NeedsName(card.needs);
    entry["suspect_when"] = Words(PhaseNames(card.suspect_when));
    entry["reference"] = card.reference;
    entry["drives"] = Words(DriveNames(card.drives));
    entry["duty_only"] = card.drives == kDutyOnly;
    bool place_like = false;
    nb::list parameters;
    for (const Parameter &p : own)
    {
        place_like |= p.role == Role::kPlace;
        nb::dict row = ParameterEntry(p);
        for (const char *key : {"value", "held", "stage"})  // of a model's parameter alone
            nb::del(row[key]);
        parameters.append(row);
    }
    entry["place_like"] = place_like;
    entry["parameters"] = parameters;
    nb::list texts;
    for (const TextParameter &t : spec.texts)
    {
        nb::dict row;
        row["name"] = t.name;
        row["default"] = t.default_value;
        row["doc"] = t.doc;
        texts.append(row);
    }
    entry["texts"] = texts;
    return entry;
}

// The effects that a robot like `model`'s can have.
nb::list CatalogueOf(const Model &model)
{
    nb::list effects;
    for (const EffectSpec *spec : Catalogue())
        if (model.WhyNot(*spec).empty())
            effects.append(CardEntry(*spec, ParametersFor(*spec, model.MakeWheels())));
    return effects;
}

// The cards of a model's own effects, in their order.
nb::list OwnCards(const Model &model)
{
    nb::list cards;
    for (const EffectInstance &effect : model.effects)
        cards.append(CardEntry(*effect.spec, effect.parameters));
    return cards;
}

nb::list CatalogueList()
{
    nb::list effects;
    for (const EffectSpec *spec : Catalogue())
        effects.append(CardEntry(*spec, ParametersFor(*spec, Model().MakeWheels())));
    return effects;
}

nb::list ParameterList(const Model &model)
{
    nb::list values;
    for (const Parameter &p : model.Parameters())
        values.append(ParameterEntry(p));
    return values;
}

nb::list WheelList(const Model &model)
{
    nb::list wheels;
    for (const Wheel &wheel : model.MakeWheels())
    {
        nb::dict entry;
        entry["name"] = wheel.name;
        entry["words"] = wheel.words;
        entry["x_m"] = wheel.x_m;
        entry["y_m"] = wheel.y_m;
        entry["roll"] = nb::make_tuple(wheel.roll_x, wheel.roll_y);
        entry["grip"] = nb::make_tuple(wheel.grip_x(), wheel.grip_y());
        wheels.append(entry);
    }
    return wheels;
}

nb::list InertList(const Model &model, const std::string &plant)
{
    if (plant != "planar" && plant != "mujoco")
        throw std::invalid_argument("plant '" + plant + "' must be 'planar' or 'mujoco'");
    nb::list inert;
    for (const Inert &number :
         model.InertIn(plant == "planar" ? PlantKind::kPlanar : PlantKind::kMujoco))
        inert.append(nb::make_tuple(number.name, number.why));
    return inert;
}

// Wheel motion (rad/s) of a body velocity, and back.
std::vector<double> WheelSpeeds(const Model &model, double vx_mps, double vy_mps,
                                double omega_radps)
{
    const WheelMotion motion =
        Kinematics(model.robot, model.base.wheels).Inverse({vx_mps, vy_mps, omega_radps});
    std::vector<double> radps;
    for (size_t k = 0; k < model.MakeWheels().size(); ++k)
        radps.push_back(motion.rim_mps[k] / model.robot.wheel_radius_m);
    return radps;
}

std::vector<double> BodyVelocity(const Model &model, const std::vector<double> &wheel_radps)
{
    if (wheel_radps.size() != model.MakeWheels().size())
        throw std::invalid_argument("wheel_radps must have one speed per driven wheel");
    if (model.base.wheels == WheelKind::kAckermann)
        throw std::invalid_argument("the wheels of an ackermann robot do not say how it turns");
    WheelMotion motion;
    for (size_t k = 0; k < wheel_radps.size(); ++k)
        motion.rim_mps[k] = wheel_radps[k] * model.robot.wheel_radius_m;
    const Twist twist = Kinematics(model.robot, model.base.wheels).Forward(motion);
    return {twist.vx_mps, twist.vy_mps, twist.omega_radps};
}

// The firmware's own mixing, bound here once.
std::vector<int> MixedDuties(int speed_input_pct, int turn_input_milli)
{
    const fw_input input{static_cast<int16_t>(std::clamp(speed_input_pct, -1000, 1000)),
                         static_cast<int16_t>(std::clamp(turn_input_milli, -10000, 10000))};
    if (fw_input_check(&input) != FW_OK)
        throw std::invalid_argument(
            "mix: speed_input_pct must be within -100 to 100, turn_input_milli within -2000 to "
            "2000");
    int8_t duty_pct[FW_WHEEL_COUNT];
    fw_mix(&input, duty_pct);
    return {duty_pct, duty_pct + FW_WHEEL_COUNT};
}

const char *DriveName(const Model &model)
{
    switch (model.base.drive)
    {
        case Drive::kDuty: return "duty";
        case Drive::kWheelSpeed: return "wheel_speed";
        case Drive::kTwist: return "twist";
        case Drive::kSteering: return "steering";
    }
    return "";
}

nb::dict DetectionModelDict(const Model &model)
{
    const DetectionModel detection = model.MakeDetectionModel();
    nb::dict entry;
    entry["range_m"] = detection.range_m;
    entry["softness_m"] = detection.softness_m;
    entry["cone_rad"] = detection.cone_rad;
    entry["pan_rad"] = detection.pan_rad;
    entry["target_radius_m"] = detection.target_radius_m;
    entry["hide_radius_m"] = detection.hide_radius_m;
    entry["miss_rate"] = detection.miss_rate;
    entry["false_rate"] = detection.false_rate;
    entry["age_s"] = detection.age_s;
    entry["delay_s"] = detection.delay_s;
    entry["vote_frames"] = detection.vote_frames;
    return entry;
}

// The camera of robot `self` among `poses`, a frame at a time.
Array InViewOf(const Model &model, size_t self, Poses poses, double position_m, double heading_rad)
{
    const size_t frames = poses.shape(0), robots = poses.shape(1);
    if (poses.shape(2) != 3 || self >= robots)
        throw std::invalid_argument("poses must be (T, N, 3), with the robot itself among the N");
    const DetectionModel detection = model.MakeDetectionModel();
    std::vector<double> seen(frames);
    std::vector<Pose2> at(robots);
    for (size_t t = 0; t < frames; ++t)
    {
        const double *pose = poses.data() + 3 * robots * t;
        for (size_t i = 0; i < robots; ++i, pose += 3)
            at[i] = {pose[0], pose[1], pose[2]};
        seen[t] = ViewProbability(at, self, detection, {position_m, heading_rad});
    }
    return ToNumpy(std::move(seen), {frames});
}

Array Windows(const Model &model, const PyTrack &track, Indices starts, IndexMatrix ends)
{
    if (ends.shape(0) != starts.size())
        throw std::invalid_argument("ends must have one row per start");
    std::vector<double> predicted;
    {
        nb::gil_scoped_release unlocked;
        predicted = PredictWindows(model, track.View(), Span(starts), Span(ends));
    }
    return ToNumpy(std::move(predicted), {starts.size(), ends.shape(1), 3});
}

Array WindowErrorsOf(const Model &model, const PyTrack &track, Indices starts, IndexMatrix ends,
                     const std::vector<std::string> &names, Matrix values, Matrix start,
                     Cube measured, Cube weight, const std::optional<Indices> &part)
{
    const size_t count = starts.size(), width = 3 * ends.shape(1);
    if (ends.shape(0) != count || values.shape(1) != names.size())
        throw std::invalid_argument("ends must have one row per start, values one column per name");
    if (start.size() != 3 * count || measured.size() != count * width ||
        weight.size() != count * width)
        throw std::invalid_argument("start must be (W, 3), measured and weight (W, H, 3), of ends");
    if (part && part->size() != count)
        throw std::invalid_argument("part must have one number per start");
    for (const int64_t row : part ? Span(*part) : std::span<const int64_t>{})
        if (row < 0 || static_cast<size_t>(row) >= values.shape(0))
            throw std::invalid_argument("parts must be rows of values");
    std::vector<double> errors;
    {
        nb::gil_scoped_release unlocked;
        errors = WindowErrorsBatch(model, track.View(), Span(starts), Span(ends), names,
                                   Span(values), {Span(start), Span(measured), Span(weight)},
                                   part ? Span(*part) : std::span<const int64_t>{});
    }
    return ToNumpy(std::move(errors), {part ? 1 : values.shape(0), count * width});
}

Array OneStep(const Model &model, const PyTrack &track)
{
    return ToNumpy(PredictOneStep(model, track.View()), {track.pose_t_s.size(), 3});
}

Array OneStepBatch(const Model &model, const PyTrack &track, const std::vector<std::string> &names,
                   Matrix values)
{
    if (values.shape(1) != names.size())
        throw std::invalid_argument("values must have one column per name");
    std::vector<double> predicted;
    {
        nb::gil_scoped_release unlocked;
        predicted = PredictOneStepBatch(model, track.View(), names, Span(values));
    }
    return ToNumpy(std::move(predicted), {values.shape(0), track.pose_t_s.size(), 3});
}

nb::list TextsList(const Model &model)
{
    nb::list rows;
    for (const EffectInstance &effect : model.effects)
    {
        nb::dict row;
        for (size_t i = 0; i < effect.texts.size(); ++i)
            row[effect.spec->texts[i].name] = effect.texts[i];
        rows.append(row);
    }
    return rows;
}

Array Steady(const Model &model, Matrix commands, const std::vector<std::string> &names,
             Matrix values)
{
    if (commands.shape(1) != kMaxWheels || values.shape(1) != names.size())
        throw std::invalid_argument("commands must be (K, 4), values have one column per name");
    const size_t rows = names.empty() ? 1 : values.shape(0);
    std::vector<double> steady;
    {
        nb::gil_scoped_release unlocked;
        steady = PredictSteady(model, Span(commands), names, Span(values));
    }
    return ToNumpy(std::move(steady), {rows, commands.shape(0), kSteadyValues});
}

// For a process that ends soon.
void KeepMemory()
{
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 32 << 20);  // glibc takes no more
    mallopt(M_TRIM_THRESHOLD, 1 << 30);
#endif
}

}  // namespace

NB_MODULE(twinmill_native, m)
{
    nb::set_leak_warnings(false);  // threads of a program that was stopped still hold some
    m.doc() = "Effects, model files, short predictions and swarms of the twin's planar plant.";
    m.def("catalogue", &CatalogueList,
          "All effects: cards and parameter tables, in alphabetical order.");
    m.def("find_model_file", &FindModelFile, "name"_a,
          "Path of a file in the working directory or among the installed models.");
    m.def("find_installed_model_file", &FindInstalledModelFile, "file"_a,
          "Path of the installed file with that name and ending; None: there is none.");

    nb::class_<Model>(m, "Model", "A robot model. Errors are ValueError with one sentence.")
        .def_static(
            "from_toml",
            [](const std::string &text, const std::string &origin) {
                return Model::FromToml(text, origin);
            },
            "text"_a, "origin"_a)
        .def_static("load", &Model::Load, "name"_a)
        .def("values", &ParameterList,
             "Every parameter: name, unit, value, min, max, neutral, default, usual_size (0: not "
             "known), held (no fit moves it unless told to), stage and more.")
        .def("get", &Model::Get, "name"_a)
        .def("set", &Model::Set, "name"_a, "value"_a)
        .def("add_effect", &Model::AddEffect, "name"_a,
             "texts"_a = std::map<std::string, std::string>(),
             "Appends an effect at its neutral values; texts: its formula and the like, by name.")
        .def("remove_effect", &Model::RemoveEffect, "index"_a)
        .def("catalogue", &CatalogueOf,
             "Effects that this robot can have, per-wheel parameters by its own wheels.")
        .def("wheels", &WheelList,
             "Driven wheels: name, words, place, and unit vectors along which each rolls and "
             "grips, body frame.")
        .def("wheel_speeds", &WheelSpeeds, "vx_mps"_a, "vy_mps"_a, "omega_radps"_a,
             "Speeds in rad/s of the driven wheels at that body velocity.")
        .def("body_velocity", &BodyVelocity, "wheel_radps"_a,
             "(vx_mps, vy_mps, omega_radps) of those speeds of the driven wheels.")
        .def("inert", &InertList, "plant"_a,
             "(name, why) of the numbers that were stated and do not act in 'planar' or 'mujoco'.")
        .def("for_robot", &Model::ForRobot, "robot_id"_a)
        .def(
            "stated_of",
            [](const Model &model, int robot_id) {
                const auto found = model.robot_overrides.find(robot_id);
                return found == model.robot_overrides.end() ? std::map<std::string, double>()
                                                            : found->second;
            },
            "robot_id"_a, "What [robots.Rnn] states of this robot: values by field or name.")
        .def("detection_model", &DetectionModelDict,
             "What the robot's camera sees and how it errs, effects included.")
        .def("copy", [](const Model &model) { return Model(model); })
        .def("__getstate__", &StateOf)
        .def("__setstate__",
             [](Model &model, const nb::tuple &state) { new (&model) Model(ModelOf(state)); })
        .def_prop_ro("drive", &DriveName)
        .def_prop_ro("wheel_kind",
                     [](const Model &model) { return WheelKindName(model.base.wheels); })
        .def_prop_ro("clock_known", [](const Model &model) { return model.clock.known; })
        .def_prop_ro("clock_same", [](const Model &model) { return model.clock.same; })
        .def_prop_ro("bits", [](const Model &model) { return model.sensor.bits; })
        .def_prop_ro("texts", &TextsList, "By effect in their order: its texts by name.")
        .def_prop_ro("cards", &OwnCards,
                     "By effect in their order: its card, with the parameters that it has here.")
        .def_prop_ro("instances", &Model::Instances,
                     "Names of its effects in their order: `dead_zone`, `dead_zone#2`; "
                     "`equation#air` of a formula that its author calls air.")
        .def_prop_ro("effects", [](const Model &model) {
            nb::list names;
            for (const EffectInstance &effect : model.effects)
                names.append(effect.spec->card.name);
            return names;
        });

    nb::class_<PyTrack>(m, "Track", "A measured run: see predict.h for shapes and units.")
        .def(nb::init<Vector, Matrix, Vector, Vector, Matrix, Indices>(), "command_t_s"_a,
             "command"_a, "battery_V"_a, "pose_t_s"_a, "pose"_a, "segment"_a);

    m.def("one_step", &OneStep, "model"_a, "track"_a,
          "(N, 3) poses predicted from the pose before each.");
    m.def("one_step_batch", &OneStepBatch, "model"_a, "track"_a, "names"_a, "values"_a,
          "(B, N, 3) one-step predictions for B rows of values.");
    m.def("steady", &Steady, "model"_a, "commands"_a, "names"_a, "values"_a,
          "(B, K, 7) steady vx_mps, vy_mps, omega_radps and rim speeds at K constant commands.");
    m.def("windows", &Windows, "model"_a, "track"_a, "starts"_a, "ends"_a,
          "(W, H, 3) poses predicted at `ends` from the poses at `starts`.");
    m.def(
        "window_errors", &WindowErrorsOf, "model"_a, "track"_a, "starts"_a, "ends"_a, "names"_a,
        "values"_a, "start"_a, "measured"_a, "weight"_a, "part"_a = nb::none(),
        "(B, R) weighted errors for B rows of values, on all cores: displacements measured (W, H, "
        "3) less predicted, seen from `start` (W, 3); 0 where there is none. With `part` (W,) (1, R): "
        "each window by the row of its number alone.");
    m.def("mix", &MixedDuties, "speed_input_pct"_a, "turn_input_milli"_a,
          "Duties in percent (fl, fr, rl, rr) that the firmware gives at these inputs.");
    m.def("in_view", &InViewOf, "model"_a, "self"_a, "poses"_a, "position_m"_a, "heading_rad"_a,
          "(T,) probability that robot `self` of poses (T, N, 3), known to these standard "
          "deviations, has another in view; poses of NaN are seen by nobody.");
    m.def(
        "replica",
        [](const Model &model, const PyTrack &track, uint64_t seed) {
            return ToNumpy(SimulateReplica(model, track.View(), seed), {track.pose_t_s.size(), 3});
        },
        "model"_a, "track"_a, "seed"_a,
        "(N, 3) poses had this model, with its noise, been driven.");

    m.def("keep_memory", &KeepMemory,
          "From now on memory that was freed is used again and not given back to the system, which "
          "would hand it out anew, page by page.");
    BindEvents(m);
    BindProducts(m);
    BindSeries(m);
    BindSwarms(m);
    BindThreshold(m);
}
