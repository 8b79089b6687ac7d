// SPDX-License-Identifier: Apache-2.0
// Eight robots ram each other and the walls for ten minutes. Truth: bodies do not pass through each
// other, nor fall over, and MuJoCo does not warn.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "plant_mujoco/mujoco_plant.h"

namespace twin
{
namespace
{

constexpr double kMinutes = 10, kControl_s = 0.02, kArena_m = 0.6, kMostOverlap_m = 0.007;

class Ramming : public testing::TestWithParam<MujocoOptions>
{
};

TEST_P(Ramming, StaysSaneForTenMinutes)
{
    Model model;
    model.base.drive = Drive::kTwist;
    std::vector<Pose2> starts;
    for (int i = 0; i < 8; ++i)
        starts.push_back({0.3 * (i % 3) - 0.3, 0.3 * (i / 3) - 0.3, 0.5 * i});
    MujocoOptions options = GetParam();
    options.arena_half_width_m = kArena_m;
    MujocoPlant plant(FindModelFile("turbopi.xml"), std::vector<Model>(8, model), starts, options);
    Random random(1, 0, "ramming");
    const mjModel *m = plant.model();
    double overlap_m = 0;
    int contacts = 0;
    for (int step = 0; step < std::lround(kMinutes * 60 / kControl_s); ++step)
    {
        if (step % 25 == 0)
            for (int i = 0; i < 8; ++i)
            {
                const double x = 0.7 * random.Uniform() - 0.35, y = 0.7 * random.Uniform() - 0.35;
                plant.SetCommand(i, {{x, y, 5 * random.Uniform() - 2.5, 0}, 0});
            }
        plant.Step(kControl_s);
        for (int c = 0; c < plant.data()->ncon; ++c)
        {
            const mjContact &contact = plant.data()->contact[c];
            if (m->geom_type[contact.geom[0]] == mjGEOM_PLANE)
                continue;
            ++contacts;
            overlap_m = std::max(overlap_m, -contact.dist);
        }
    }
    std::printf("%d contacts of bodies, deepest %.1f mm\n", contacts, 1000 * overlap_m);
    EXPECT_LT(overlap_m, kMostOverlap_m);
    EXPECT_GT(contacts, 10000);
    for (const mjWarningStat &warning : plant.data()->warning)
        EXPECT_EQ(warning.number, 0);
    for (int i = 0; i < 8; ++i)
    {
        const mjtNum *up =
            plant.data()->xmat + 9 * mj_name2id(m, mjOBJ_BODY, NameInWorld(i, "base").c_str());
        EXPECT_GT(up[8], std::cos(0.05)) << "robot " << i << " tipped";
    }
}

// As twin_run has it, and as sweeps do.
INSTANTIATE_TEST_SUITE_P(Uses, Ramming,
                         testing::Values(MujocoOptions{.timestep_s = 0.002}, SweepOptions(0)),
                         [](const auto &use) { return use.index == 0 ? "TwinRun" : "Sweeps"; });

}  // namespace
}  // namespace twin
