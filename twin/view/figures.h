// SPDX-License-Identifier: Apache-2.0
// The robots of either plant as MuJoCo bodies that stand where the swarm says.
#ifndef VIEW_FIGURES_H
#define VIEW_FIGURES_H

#include <mujoco/mujoco.h>

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "swarm/swarm.h"

namespace twin
{

class Figures
{
public:
    // `robots` of the MJCF file on its floor, with all that is only looked at.
    Figures(const std::string &mjcf, size_t robots);

    // Puts the robots where they are now; wheels have turned since the last call.
    void Place(const Swarm &swarm);

    const mjModel *model() const { return model_.get(); }
    mjData *data() { return data_.get(); }
    // Number of a robot's camera in the model; -1: its file has none.
    int CameraOf(int robot) const;

private:
    struct Deleter
    {
        void operator()(mjModel *model) const { mj_deleteModel(model); }
        void operator()(mjData *data) const { mj_deleteData(data); }
    };
    struct Joints
    {
        int base;
        std::array<int, kMaxWheels> wheels;
    };
    std::unique_ptr<mjModel, Deleter> model_;
    std::unique_ptr<mjData, Deleter> data_;
    std::vector<Joints> joints_;  // addresses in qpos
    double wheel_radius_m_;
};

}  // namespace twin

#endif
