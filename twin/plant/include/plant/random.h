// SPDX-License-Identifier: Apache-2.0
// Random numbers that are the same bytes on every machine and thread count.
#ifndef PLANT_RANDOM_H
#define PLANT_RANDOM_H

#include <cstdint>
#include <string_view>

namespace twin
{

// A stream of its own for each (seed, robot, name).
class Random
{
public:
    Random(uint64_t seed, int robot, std::string_view name);
    double Uniform();  // [0, 1)
    double Normal();   // mean 0, standard deviation 1 (Box and Muller 1958)
    // Where SplitMix() goes on; Uniform() is its upper 53 bits times 2^-53.
    uint64_t State() const { return state_; }

private:
    uint64_t state_;
    double spare_ = 0;
    bool has_spare_ = false;
};

}  // namespace twin

#endif
