// SPDX-License-Identifier: Apache-2.0
// Swarms of the published robot, for the tests of this folder.
#ifndef PAPER_SWARM_H
#define PAPER_SWARM_H

#include <memory>
#include <utility>
#include <vector>

#include "fw/behavior.h"
#include "model_file/model.h"
#include "swarm/bodies.h"
#include "swarm/swarm.h"

namespace twin
{

// The published unicycle, all alike: milling at 0.25 m/s and 45 degrees/s.
inline Model PaperModel()
{
    Model model = Model::Load("paper.toml");
    model.idiosyncrasy = {};
    return model;
}

inline std::vector<fw_table> MillingTables(size_t n)
{
    return std::vector<fw_table>(n, fw_behavior_find("milling")->table);
}

inline Swarm PlanarSwarm(const std::vector<Model> &models, const std::vector<Pose2> &starts,
                         const std::vector<fw_table> &tables, const SwarmOptions &options = {})
{
    return Swarm(std::make_unique<PlanarBodies>(models, starts, options.seed), models, tables,
                 options);
}

}  // namespace twin

#endif
