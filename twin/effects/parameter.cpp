// SPDX-License-Identifier: Apache-2.0
#include "effects/parameter.h"

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace twin
{

double UsualSize(const ParameterSpec &spec)
{
    return spec.usual_size > 0 ? spec.usual_size : 2 * std::abs(spec.default_value - spec.neutral);
}

const char *RoleName(Role role)
{
    switch (role)
    {
        case Role::kSize: return "size";
        case Role::kPlace: return "place";
        case Role::kMoment: return "moment";
        case Role::kDuration: return "duration";
        case Role::kLateness: return "lateness";
        case Role::kLimit: return "limit";
        case Role::kRadius: return "radius";
    }
    return "";
}

void Parameter::CheckBounds(double other, const std::string &what) const
{
    if (other >= min && other <= max)
        return;
    const std::string tail = unit == "1" ? "" : " " + unit;
    std::ostringstream text;
    text << what << " = " << other << tail << " is outside " << min << " to " << max << tail;
    throw std::invalid_argument(text.str());
}

}  // namespace twin
