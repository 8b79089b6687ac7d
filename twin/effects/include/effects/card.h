// SPDX-License-Identifier: Apache-2.0
// What a person should know of an effect, and what a search for it should.
#ifndef EFFECTS_CARD_H
#define EFFECTS_CARD_H

#include <vector>

namespace twin
{

// What a robot's commands are. An effect lists the drives it makes sense for.
enum class Drive : unsigned
{
    kDuty = 1,        // wheel duties, -1..1
    kWheelSpeed = 2,  // measured wheel speeds
    kTwist = 4,       // commanded body velocity
    kSteering = 8,    // commanded speed and steering angle
};
constexpr unsigned kAnyDrive = 15;
constexpr unsigned kDutyOnly = static_cast<unsigned>(Drive::kDuty);

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
    kHeading,      // its heading, recorded and not found by the fit
    kRoom,         // where in the room the robot was, and its heading
    kBattery,      // the pack voltage
    kHistory,      // how long the robot had been driving
    kWheelAngle,   // motion within a turn of the wheels
    kContacts,     // bodies that touch
    kFrames,       // the camera's bits
    kRawFrames,    // these, before any vote
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

struct Card
{
    const char *name;
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

// What a robot is told, in words, of a mask of Drive: "duties", "wheel speeds", ...
std::vector<const char *> DriveNames(unsigned drives);
const char *FamilyName(Family family);
const char *NeedsName(Needs needs);
std::vector<const char *> ManeuverNames(unsigned maneuvers);
std::vector<const char *> PhaseNames(unsigned phases);

}  // namespace twin

#endif
