// SPDX-License-Identifier: Apache-2.0
// Words for what cards say, as the catalogue prints them.
#include "effects/card.h"

#include <span>

namespace twin
{
namespace
{

std::vector<const char *> NamesIn(unsigned mask, std::span<const char *const> names)
{
    std::vector<const char *> in;
    for (size_t bit = 0; bit < names.size(); ++bit)
        if (mask >> bit & 1)
            in.push_back(names[bit]);
    return in;
}

}  // namespace

std::vector<const char *> DriveNames(unsigned drives)
{
    constexpr const char *kNames[] = {"duties", "wheel speeds", "velocities", "steering angles"};
    return NamesIn(drives, kNames);
}

const char *FamilyName(Family family)
{
    switch (family)
    {
        case Family::kTransient: return "transient";
        case Family::kClock: return "clock";
        case Family::kGain: return "gain";
        case Family::kFriction: return "friction";
        case Family::kGeometry: return "geometry";
        case Family::kFrame: return "frame";
        case Family::kPlace: return "place";
        case Family::kPower: return "power";
        case Family::kContact: return "contact";
        case Family::kCamera: return "camera";
        case Family::kFormula: return "formula";
    }
    return "";
}

const char *NeedsName(Needs needs)
{
    switch (needs)
    {
        case Needs::kSteadySpeed: return "steady_speed";
        case Needs::kChanges: return "changes";
        case Needs::kClocks: return "clocks";
        case Needs::kPoses: return "poses";
        case Needs::kHeading: return "heading";
        case Needs::kRoom: return "room";
        case Needs::kBattery: return "battery";
        case Needs::kHistory: return "history";
        case Needs::kWheelAngle: return "wheel_angle";
        case Needs::kContacts: return "contacts";
        case Needs::kFrames: return "frames";
        case Needs::kRawFrames: return "raw_frames";
    }
    return "";
}

std::vector<const char *> ManeuverNames(unsigned maneuvers)
{
    static constexpr const char *kNames[] = {
        "straight",  "strafe", "diagonal", "spin",   "arcs", "steps",      "stops",
        "reversals", "levels", "headings", "places", "long", "two_robots", "watch"};
    return NamesIn(maneuvers, kNames);
}

std::vector<const char *> PhaseNames(unsigned phases)
{
    static constexpr const char *kNames[] = {"standing", "steady", "starting", "stopping",
                                             "changing"};
    return NamesIn(phases, kNames);
}

}  // namespace twin
