// SPDX-License-Identifier: Apache-2.0
// Random numbers that are the same bytes on every machine and thread count.
#ifndef PLANT_RANDOM_H
#define PLANT_RANDOM_H

#include <cstddef>
#include <cstdint>
#include <random>
#include <string_view>

namespace twin
{

// A stream of its own for each (seed, robot, name).
class Random
{
public:
    Random(uint64_t seed, int robot, std::string_view name);
    double Uniform();  // [0, 1)
    // The next `count` of them, each `stride` after the one before.
    void Uniform(double *first, size_t stride, int count);
    double Normal();  // mean 0, standard deviation 1 (Box and Muller 1958)

private:
    std::mt19937_64 engine_;
    double spare_ = 0;
    bool has_spare_ = false;
};

}  // namespace twin

#endif
