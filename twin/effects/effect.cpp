// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

#include <cmath>

namespace twin
{

const char *StageName(const Act &act)
{
    static constexpr const char *kNames[] = {"duty",  "wheel",   "wheel", "ground",
                                             "world", "observe", "view",  "decide"};
    static_assert(std::size(kNames) == std::variant_size_v<Act>);
    return kNames[act.index()];
}

BoundEffect::BoundEffect(const EffectSpec &spec, std::vector<double> values,
                         std::span<const std::string> texts)
    : spec_(&spec), values_(std::move(values)), texts_(texts.begin(), texts.end()), act_(spec.act)
{
    if (!spec.compile)
        return;
    for (size_t i = texts_.size(); i < spec.texts.size(); ++i)
        texts_.emplace_back(spec.texts[i].default_value);
    EffectSpec::Compiled compiled = spec.compile(values_, texts_);
    act_ = compiled.act;
    formula_ = std::move(compiled.formula);
}

void BoundEffect::Set(DetectionModel &detection) const
{
    if (const auto *view = std::get_if<OnView>(&act_))
        view->set(detection, numbers());
    if (const auto *decision = std::get_if<OnDecision>(&act_))
        decision->set(detection, numbers());
}

void BoundEffect::Set(Body &body) const
{
    if (const auto *on = std::get_if<OnBody>(&act_))
        on->set(body, numbers());
}

double Begun(double since_s, double edge_s)
{
    constexpr double kOver = 40;  // edges: then it is 0 or 1 but for less than 1e-17
    if (std::abs(since_s) > kOver * edge_s)
        return since_s > 0;
    return 1 / (1 + std::exp(-since_s / edge_s));
}

const EffectSpec *FindEffect(std::string_view name)
{
    for (const EffectSpec *spec : Catalogue())
        if (name == spec->card.name)
            return spec;
    return nullptr;
}

}  // namespace twin
