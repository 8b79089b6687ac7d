// SPDX-License-Identifier: Apache-2.0
// Tails of the usual distributions, by Eigen's special functions.
#include <Eigen/Core>
#include <unsupported/Eigen/SpecialFunctions>

#include <cmath>

#include "arrays.h"

using namespace nanobind::literals;

namespace twin
{
namespace
{

double TAbove(double value, double free)
{
    const double tail = Eigen::numext::betainc(free / 2, 0.5, free / (free + value * value)) / 2;
    return value < 0 ? 1 - tail : tail;
}

double FAbove(double value, double free, double free_below)
{
    return Eigen::numext::betainc(free_below / 2, free / 2,
                                  free_below / (free_below + free * value));
}

double Chi2Above(double value, double free)
{
    return Eigen::numext::igammac(free / 2, value / 2);
}

}  // namespace

void BindChance(nb::module_ &m)
{
    m.def("t_above", &TAbove, "value"_a, "free"_a,
          "Chance that Student's t of so many degrees of freedom is larger.");
    m.def(
        "f_above", &FAbove, "value"_a, "free"_a, "free_below"_a,
        "Chance that the ratio of two variances (Fisher's F) is larger than a value of 0 or more.");
    m.def("chi2_above", &Chi2Above, "value"_a, "free"_a,
          "Chance that chi squared is larger than a value of 0 or more.");
}

}  // namespace twin
