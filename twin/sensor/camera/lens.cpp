// SPDX-License-Identifier: Apache-2.0
#include "sensor/lens.h"

#include <cmath>

namespace twin
{

double Lens::Radius(double theta_rad) const
{
    if (!fisheye)
        return std::tan(theta_rad);
    const double q = theta_rad * theta_rad;
    return theta_rad * (1 + q * (k[0] + q * (k[1] + q * (k[2] + q * k[3]))));
}

double Lens::AngleRad(double radius) const
{
    if (!fisheye)
        return std::atan(radius);
    constexpr double kExact = 1e-14;
    double theta_rad = radius, miss = 1;
    for (int i = 0; i < 20 && std::abs(miss) > kExact; ++i)  // Newton's method
    {
        const double q = theta_rad * theta_rad;
        const double slope = 1 + q * (3 * k[0] + q * (5 * k[1] + q * (7 * k[2] + q * 9 * k[3])));
        miss = Radius(theta_rad) - radius;
        theta_rad -= miss / slope;
    }
    return theta_rad;
}

}  // namespace twin
