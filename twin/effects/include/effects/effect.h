// SPDX-License-Identifier: Apache-2.0
// A physical effect: what an effect file must provide, and the signals it may read and change.
//
// One step of one robot passes its signals through the stages in the order of `Stage`; within a
// stage the effects act in the order of the model file. An effect is immutable. What it remembers
// of one robot lies in `state`, plain doubles owned by the plant, so that a robot can be copied and
// restarted.
#ifndef EFFECTS_EFFECT_H
#define EFFECTS_EFFECT_H

#include <array>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace twin
{

constexpr int kWheels = 4;  // front-left, front-right, rear-left, rear-right
using Wheels = std::array<double, kWheels>;
constexpr double kNoLimit = std::numeric_limits<double>::infinity();

enum class Stage
{
    kDuty,     // the command, before it becomes a wheel speed
    kWheel,    // the speed each wheel tends to, and how fast it gets there
    kGround,   // the body's velocity over the floor
    kWorld,    // contacts with robots and walls
    kObserve,  // what motion capture reports of the pose
    kView,     // what the camera can see
    kDecide,   // the camera's bit
};

// What a robot's commands are. An effect lists the drives it makes sense for.
enum class Drive : unsigned
{
    kDuty = 1,        // wheel duties, -1..1
    kWheelSpeed = 2,  // measured wheel speeds
    kTwist = 4,       // commanded body velocity
};
constexpr unsigned kAnyDrive = 7;
constexpr unsigned kDutyOnly = static_cast<unsigned>(Drive::kDuty);

// The signals of one robot in one step. Angles and turn rates are positive counter-clockwise.
struct Signals
{
    double t_s = 0;  // start of the step, robot's clock
    // Length of the step. kDuty: an effect whose output changes within the step shortens it to end
    // there; the plant then goes through both stages again for the rest.
    double dt_s = 0;

    double battery_V = 0;          // pack voltage now
    double battery_nominal_V = 0;  // pack voltage at which the base model's speeds hold
    double wheel_radius_m = 0;     // of the base model

    Wheels duty{};        // kDuty: command on its way to the wheels; duty drive: -1..1
    Wheels rim_mps{};     // kWheel: rim speed at the start of the step (read only)
    Wheels target_mps{};  // kWheel: rim speed that the wheel tends to
    Wheels tau_s{};       // kWheel: time constant with which it gets there
    // kWheel: limit on slowing down.
    Wheels max_decel_mps2{kNoLimit, kNoLimit, kNoLimit, kNoLimit};
    Wheels wheel_rad{};       // kWheel: angle turned since the start (read only)
    Wheels roll{1, 1, 1, 1};  // kWheel: way over the floor per way of the rim

    bool moves = false;                      // kGround: some wheel turns (read only)
    double x_m = 0, y_m = 0, theta_rad = 0;  // kGround: pose in W (read only); kObserve: pose seen
    double vx_mps = 0, vy_mps = 0, omega_radps = 0;  // kGround: velocity, body frame
    double observed_t_s = 0;  // kObserve: time stamp of the pose, capture's clock
};

// What a robot's camera sees, and how its bit errs. One robot's numbers do not change while it
// runs: its effects set them once.
struct Sight
{
    double range_m = 0;          // kView: farthest target seen
    double softness_m = 0;       // kView: scale of a logistic edge at range_m; 0: sharp
    double cone_rad = 0;         // kView: full opening angle
    double pan_rad = 0;          // kView: the cone's axis, left of the heading
    double target_radius_m = 0;  // kView: 0: only the other robot's centre is seen
    double hide_radius_m = 0;    // kView: of bodies that hide what is behind them; 0: none do
    double miss_rate = 0;        // kDecide: share of frames that miss what is in view
    double false_rate = 0;       // kDecide: share of frames that see what is not there
    double age_s = 0;            // kDecide: exposure before the frame's time stamp
    double delay_s = 0;          // kDecide: time stamp to controller
    double vote_frames = 1;      // kDecide: seen if more than half of so many frames show it
};

// What a robot's body does on contact.
struct Body
{
    double radius_m = 0;  // kWorld: 0: nothing touches
    double friction = 0;  // kWorld: Coulomb's coefficient against another body
};

// What a parameter says, for those who search for its value.
enum class Role
{
    kSize,      // how strong the effect is
    kPlace,     // where in the room it acts: a search starts from several places
    kLateness,  // how late a response comes: only the sum with other such parameters is firm
};

// One number of an effect. This table is the only place of its name, unit and bounds.
struct Parameter
{
    const char *name;
    const char *unit;      // "1" for a pure number
    double neutral;        // value at which the effect does nothing, bit for bit
    double default_value;  // plausible value: where a fit starts
    double min, max;
    const char *doc;
    // Of a robot whose value is above or below neutral, in plain words; empty: none fit.
    const char *above = "", *below = "";
    double usual_size = 0;  // standard deviation over robots; 0: twice from neutral to default
    Role role = Role::kSize;
};

// `usual_size`, or what its 0 stands for.
double UsualSize(const Parameter &parameter);

// A choice or formula of an effect: what no number can say.
struct TextParameter
{
    const char *name;
    const char *default_value;
    const char *doc;
};

// Effects of one family are told apart with difficulty: one may stand for another.
enum class Family
{
    kTransient,  // what follows a change of the command
    kClock,      // time stamps
    kGain,       // speed over command
    kFriction,   // speed lost to the floor or in the gears
    kGeometry,   // places and shapes of wheels and masses
    kFrame,      // what motion capture tracks, against the robot
    kPlace,      // where in the room, or in which direction
    kPower,      // battery and heat
    kContact,    // other bodies
    kCamera,     // what the camera sees, and when
    kFormula,    // the user's own
};

// What a measurement must hold for an effect to show in it.
enum class Needs
{
    kSteadySpeed,  // mean speeds and turn rates at constant commands are enough
    kChanges,      // starts, stops and other changes of the command
    kClocks,       // time stamps of commands and of poses
    kPoses,        // the pose of the tracked body
    kRoom,         // where in the room the robot was, and its heading
    kBattery,      // the pack voltage
    kHistory,      // how long the robot had been driving
    kWheelAngle,   // motion within a turn of the wheels
    kContacts,     // bodies that touch
    kFrames,       // the camera's bits
};

// Kinds of drives, for Card::identify.
enum Maneuver : unsigned
{
    kStraight = 1 << 0,
    kStrafe = 1 << 1,
    kDiagonal = 1 << 2,  // forward and sideways at once
    kSpin = 1 << 3,      // on the spot
    kArcs = 1 << 4,
    kSteps = 1 << 5,  // from rest
    kStops = 1 << 6,
    kReversals = 1 << 7,
    kLevels = 1 << 8,    // the same at several commands
    kHeadings = 1 << 9,  // the same along several headings
    kPlaces = 1 << 10,   // the same at several places
    kLong = 1 << 11,     // minutes
    kTwoRobots = 1 << 12,
    kWatch = 1 << 13,  // robots in view of a camera
};

// Phases of a drive, for Card::suspect_when.
enum Phase : unsigned
{
    kStanding = 1 << 0,
    kSteady = 1 << 1,
    kStarting = 1 << 2,
    kStopping = 1 << 3,
    kChanging = 1 << 4,
};

// What a person should know of an effect, and what a search for it should.
struct Card
{
    const char *name;
    Stage stage;
    unsigned drives;       // mask of Drive
    const char *summary;   // one sentence
    const char *equation;  // in the symbols of the parameter table
    const char *leaves_out;
    const char *measure;    // which drive makes it visible
    const char *reference;  // where the equation comes from
    Family family;
    Needs needs;
    const char *phrase;         // of a robot that has it, in plain words
    unsigned identify = 0;      // mask of Maneuver: the drives of `measure`
    unsigned suspect_when = 0;  // mask of Phase: where it is the first to think of
};

class Effect
{
public:
    virtual ~Effect() = default;
    virtual int StateSize() const { return 0; }
    // Where it acts: the card's stage, unless its texts say otherwise.
    virtual Stage ActsAt(const Card &card) const { return card.stage; }
    // Acts before the others of its stage, wherever the model file has it.
    virtual bool ActsFirst() const { return false; }
    // kDuty to kObserve: acts on the signals of one step; `state` holds StateSize() doubles, zero
    // at the start.
    virtual void Step(Signals &, double * /*state*/) const {}
    // kObserve only: from the pose seen and its time stamp back to the robot's own.
    virtual void Invert(Signals &) const {}
    // kView and kDecide only.
    virtual void Look(Sight &) const {}
    // kWorld only.
    virtual void Touch(Body &) const {}
};

struct EffectSpec
{
    Card card;
    std::span<const Parameter> parameters;
    // `values` in the order of `parameters`, within bounds (checked by the model file).
    std::unique_ptr<Effect> (*make)(std::span<const double> values);
    std::span<const TextParameter> texts = {};
    // Effects with texts only: the same with `texts`, in their order; `make` takes their defaults.
    // Throws std::invalid_argument in one sentence if a text makes no sense.
    std::unique_ptr<Effect> (*make_with_texts)(std::span<const double> values,
                                               std::span<const std::string> texts) = nullptr;
};

// All effects in alphabetical order.
std::span<const EffectSpec *const> Catalogue();
// The effect of that name, or nullptr.
const EffectSpec *FindEffect(std::string_view name);
const char *StageName(Stage stage);
const char *FamilyName(Family family);
const char *NeedsName(Needs needs);
const char *RoleName(Role role);
std::vector<const char *> ManeuverNames(unsigned maneuvers);
std::vector<const char *> PhaseNames(unsigned phases);

}  // namespace twin

#endif
