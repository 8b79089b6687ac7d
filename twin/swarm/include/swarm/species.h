// SPDX-License-Identifier: Apache-2.0
// Which robot runs which behaviour.
#ifndef SWARM_SPECIES_H
#define SWARM_SPECIES_H

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fw/behavior.h"
#include "sensor/scene.h"
#include "swarm/metrics.h"

namespace twin
{

// Of exactly this name, of `own` or else the firmware's; nullptr if neither has it.
const fw_behavior *FindBehavior(const std::string &name, std::span<const fw_behavior> own);

// As fw_table_parse() reads it, exactly.
std::string TableText(const fw_table &table);

// One behaviour per robot from "milling" (for all) or "milling:5,self_centering@red:1", in that
// order; the colour is that of the robots' targets.
// `n` may be left out if counts are given. Throws std::invalid_argument in one sentence if a name
// is neither the firmware's nor one of `own`, or the counts do not add up to n.
std::vector<const fw_behavior *> ParseSpecies(const std::string &text, std::optional<int> n,
                                              std::span<const fw_behavior> own = {});

// Of each robot's target, as `name@colour` says it in the same text; green where nothing does.
// Throws as ParseSpecies().
std::vector<Colour> ParseColours(const std::string &text, std::optional<int> n);
std::vector<std::string> ColourNames(const std::string &text, std::optional<int> n);

// The robots of the most frequent behaviour, of equally many that of the first robot among them.
Ring RingOf(std::span<const fw_behavior *const> robots);

}  // namespace twin

#endif
