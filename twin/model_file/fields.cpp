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
    {"robot", "battery_nominal_V", "V", 0.1, 100, AT(robot.battery_nominal_V), false},
    {"base", "speed_per_input_mps", "m/s", -1, 1, AT(base.speed_per_input_mps), false},
    {"base", "turn_per_input_radps", "rad/s", -100, 100, AT(base.turn_per_input_radps), false},
    {"base", "forward_gain", "1", 0.05, 5, AT(base.forward_gain), true},
    {"base", "sideways_gain", "1", 0.05, 5, AT(base.sideways_gain), true},
    {"base", "yaw_gain", "1", 0.05, 5, AT(base.yaw_gain), true},
    {"base", "motor_lag_s", "s", 0, 2, AT(base.motor_lag_s), true},
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
    {"clock", "offset_s", "s", -10, 10, AT(clock.offset_s), false},
    {"clock", "rate_ppm", "ppm", -1e6, 1e6, AT(clock.rate_ppm), false},
    {"", "theta_a1", "1", 0.05, 5, AT(theta_a1), true},
    {"", "theta_a2", "1", 0.05, 5, AT(theta_a2), true},
};

#undef AT

std::span<const Field> Fields()
{
    return kFields;
}

}  // namespace twin
