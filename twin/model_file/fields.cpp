// SPDX-License-Identifier: Apache-2.0
#include "fields.h"

namespace twin
{

#define AT(member) [](Model &m) -> double & { return m.member; }

static const Field kFields[] = {
    {"robot", "wheel_radius_m", "m", 0.001, 1, AT(robot.wheel_radius_m), false},
    {"robot", "half_wheelbase_m", "m", 0, 5, AT(robot.half_wheelbase_m), false},
    {"robot", "half_track_m", "m", 0.001, 5, AT(robot.half_track_m), false},
    {"robot", "body_radius_m", "m", 0, 5, AT(robot.body_radius_m), false},
    {"robot", "mass_kg", "kg", 0.01, 1000, AT(robot.mass_kg), false},
    {"robot", "max_steering_rad", "rad", 0.01, 1.5, AT(robot.max_steering_rad), false},
    {"robot", "battery_nominal_V", "V", 0.1, 100, AT(robot.battery_nominal_V), false},
    {"base", "speed_per_input_mps", "m/s", -1, 1, AT(base.speed_per_input_mps), false},
    {"base", "turn_per_input_radps", "rad/s", -100, 100, AT(base.turn_per_input_radps), false},
    {"base", "forward_gain", "1", 0.05, 5, AT(base.forward_gain), true, 0.15, "ground"},
    {"base", "sideways_gain", "1", 0.05, 5, AT(base.sideways_gain), true, 0.15, "ground"},
    {"base", "yaw_gain", "1", 0.05, 5, AT(base.yaw_gain), true, 0.15, "ground"},
    {"base", "motor_lag_s", "s", 0, 2, AT(base.motor_lag_s), true, 0.3, "wheel"},
    {"base", "steering_per_input_rad", "rad", -1.5, 1.5, AT(base.steering_per_input_rad), false},
    {"base", "steering_lag_s", "s", 0, 2, AT(base.steering_lag_s), true, 0.3, "wheel"},
    {"base", "control_period_s", "s", 0.001, 1, AT(base.control_period_s), false},
    {"sensor", "range_m", "m", 0, 100, AT(sensor.range_m), true},
    {"sensor", "range_std_m", "m", 0, 100, AT(sensor.range_std_m), false},
    {"sensor", "cone_rad", "rad", 0, 6.2832, AT(sensor.cone_rad), true},
    {"sensor", "cone_std_rad", "rad", 0, 6.2832, AT(sensor.cone_std_rad), false},
    {"sensor", "target_radius_m", "m", 0, 1, AT(sensor.target_radius_m), false},
    {"sensor", "false_negative_rate", "1", 0, 1, AT(sensor.false_negative_rate), true},
    {"sensor", "false_positive_rate", "1", 0, 1, AT(sensor.false_positive_rate), true},
    {"sensor", "delay_s", "s", 0, 5, AT(sensor.delay_s), true},
    {"sensor", "vote_frames", "1", 1, 64, AT(sensor.vote_frames), false},
    {"noise", "sensor_m", "m", 0, 1, AT(noise.sensor_m), false},
    {"noise", "sensor_rad", "rad", 0, 1, AT(noise.sensor_rad), false},
    {"noise", "drive_mps", "m/s", 0, 1, AT(noise.drive_mps), false},
    {"noise", "drive_radps", "rad/s", 0, 10, AT(noise.drive_radps), false},
    {"noise", "drive_s", "s", 0.001, 10, AT(noise.drive_s), false},
    {"noise", "drive_turn_s", "s", 0.001, 10, AT(noise.drive_turn_s), false},
    {"idiosyncrasy", "theta_a1_std", "1", 0, 1, AT(idiosyncrasy.theta_a1_std), false},
    {"idiosyncrasy", "theta_a2_std", "1", 0, 1, AT(idiosyncrasy.theta_a2_std), false},
    {"clock", "offset_s", "s", -10, 10, AT(clock.offset_s), false, 0, "observe"},
    {"clock", "rate_ppm", "ppm", -1e6, 1e6, AT(clock.rate_ppm), false, 0, "observe"},
    {"frame", "heading_rad", "rad", -3.1416, 3.1416, AT(frame.heading_rad), false, 0, "observe"},
    {"frame", "wheel_0_rad", "rad", -6.2832, 6.2832, AT(frame.wheel_rad[0]), false, 0, "wheel"},
    {"frame", "wheel_1_rad", "rad", -6.2832, 6.2832, AT(frame.wheel_rad[1]), false, 0, "wheel"},
    {"frame", "wheel_2_rad", "rad", -6.2832, 6.2832, AT(frame.wheel_rad[2]), false, 0, "wheel"},
    {"frame", "wheel_3_rad", "rad", -6.2832, 6.2832, AT(frame.wheel_rad[3]), false, 0, "wheel"},
    {"", "theta_a1", "1", 0.05, 5, AT(theta_a1), true, 0, "ground"},
    {"", "theta_a2", "1", 0.05, 5, AT(theta_a2), true, 0, "ground"},
};

#undef AT

bool Field::Is(std::string_view name) const
{
    const std::string_view in = section;
    return name.size() == in.size() + !in.empty() + std::string_view(key).size() &&
           name.starts_with(in) && name.ends_with(key) && (in.empty() || name[in.size()] == '.');
}

Parameter Field::In(const Model &model) const
{
    static const Model kDefault;
    Parameter p;
    p.name = Name();
    p.unit = unit;
    p.value = at(const_cast<Model &>(model));
    p.min = min;
    p.max = max;
    p.neutral = p.default_value = at(const_cast<Model &>(kDefault));
    p.usual_size = usual_size;
    p.held = usual_size == 0;
    p.stage = stage;
    return p;
}

std::span<const Field> Fields()
{
    return kFields;
}

}  // namespace twin
