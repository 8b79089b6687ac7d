// SPDX-License-Identifier: Apache-2.0
// Drives a robot in the physics of Gazebo Fortress, its joints held at speeds:
//     gazebo_drive PLUGIN WORLD.sdf MODEL LINK SECONDS [JOINT=RADPS...]
// prints x, y and yaw of the link, in m and rad, after each tenth of a second.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ignition/physics/ForwardStep.hh>
#include <ignition/physics/FrameSemantics.hh>
#include <ignition/physics/GetEntities.hh>
#include <ignition/physics/Joint.hh>
#include <ignition/physics/RequestEngine.hh>
#include <ignition/physics/sdf/ConstructWorld.hh>
#include <ignition/plugin/Loader.hh>
#include <sdf/Root.hh>
#include <sdf/World.hh>

namespace physics = ignition::physics;

struct Needed
    : physics::FeatureList<physics::ForwardStep, physics::GetEntities, physics::LinkFrameSemantics,
                           physics::SetJointVelocityCommandFeature, physics::sdf::ConstructSdfWorld>
{
};

int main(int argc, char **argv)
{
    if (argc < 6)
        return 2;
    sdf::Root root;
    for (const sdf::Error &error : root.Load(argv[2]))
    {
        std::fprintf(stderr, "%s\n", error.Message().c_str());
    }
    ignition::plugin::Loader loader;
    loader.LoadLib(argv[1]);
    const auto engine = physics::RequestEngine3d<Needed>::From(
        loader.Instantiate("ignition::physics::dartsim::Plugin"));
    if (!engine || !root.WorldByIndex(0))
        return 1;
    const auto world = engine->ConstructWorld(*root.WorldByIndex(0));
    const auto robot = world->GetModel(argv[3]);
    const auto link = robot->GetLink(argv[4]);
    physics::ForwardStep::Input input;
    physics::ForwardStep::State state;
    physics::ForwardStep::Output output;
    for (int step = 1; step <= std::lround(1000 * std::atof(argv[5])); ++step)
    {
        for (char **told = argv + 6; *told; ++told)
        {
            const char *split = std::strchr(*told, '=');
            robot->GetJoint(std::string(*told, split - *told))
                ->SetVelocityCommand(0, std::atof(split + 1));
        }
        world->Step(output, state, input);
        if (step % 100)
            continue;
        const auto pose = link->FrameDataRelativeToWorld().pose;
        std::printf("%.9f %.9f %.9f\n", pose.translation().x(), pose.translation().y(),
                    std::atan2(pose.linear()(1, 0), pose.linear()(0, 0)));
    }
}
