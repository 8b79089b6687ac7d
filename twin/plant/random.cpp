// SPDX-License-Identifier: Apache-2.0
#include "plant/random.h"

#include <cmath>
#include <numbers>

#include "plant/split_mix.h"

namespace twin
{
namespace
{

// FNV-1a over the bytes of the three parts: distinct streams for distinct triples.
uint64_t Hash(uint64_t seed, int robot, std::string_view name)
{
    uint64_t hash = 14695981039346656037u;
    const auto mix = [&hash](uint64_t byte) { hash = (hash ^ byte) * 1099511628211u; };
    for (int shift = 0; shift < 64; shift += 8)
        mix((seed >> shift) & 255);
    for (int shift = 0; shift < 32; shift += 8)
        mix((static_cast<uint64_t>(robot) >> shift) & 255);
    for (const char letter : name)
        mix(static_cast<unsigned char>(letter));
    return hash;
}

}  // namespace

Random::Random(uint64_t seed, int robot, std::string_view name) : state_(Hash(seed, robot, name)) {}

double Random::Uniform()
{
    return static_cast<double>(SplitMix(state_) >> 11) * 0x1p-53;
}

double Random::Normal()
{
    if (has_spare_)
    {
        has_spare_ = false;
        return spare_;
    }
    const double radius = std::sqrt(-2 * std::log(1 - Uniform()));
    const double angle_rad = 2 * std::numbers::pi * Uniform();
    spare_ = radius * std::sin(angle_rad);
    has_spare_ = true;
    return radius * std::cos(angle_rad);
}

}  // namespace twin
