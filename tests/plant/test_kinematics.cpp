// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "drive.h"

namespace twin::test
{
namespace
{

constexpr WheelKind kAllKinds[] = {WheelKind::kMecanum, WheelKind::kDifferential, WheelKind::kOmni3,
                                   WheelKind::kNone};

std::vector<Twist> RandomTwists()
{
    std::mt19937_64 engine(3);
    std::uniform_real_distribution<double> speed(-1, 1), rate(-4, 4);
    std::vector<Twist> twists;
    for (int i = 0; i < 100; ++i)
        twists.push_back({speed(engine), speed(engine), rate(engine)});
    return twists;
}

// Taheri, Qiao and Ghaeminezhad 2015, "Kinematic model of a four mecanum wheeled mobile robot",
// eq. 20 and 24, wheels in our order, times the wheel's radius.
TEST(Kinematics, MecanumIsThePublishedInverse)
{
    const Kinematics kinematics(Robot{}, WheelKind::kMecanum);
    for (const auto &[vx, vy, w] : RandomTwists())
    {
        const Wheels rim_mps = kinematics.Inverse({vx, vy, w}).rim_mps;
        EXPECT_NEAR(rim_mps[0], vx - vy - kLever_m * w, 1e-14);
        EXPECT_NEAR(rim_mps[1], vx + vy + kLever_m * w, 1e-14);
        EXPECT_NEAR(rim_mps[2], vx + vy - kLever_m * w, 1e-14);
        EXPECT_NEAR(rim_mps[3], vx - vy + kLever_m * w, 1e-14);
    }
}

TEST(Kinematics, MecanumIsThePublishedForward)
{
    const Kinematics kinematics(Robot{}, WheelKind::kMecanum);
    std::mt19937_64 engine(4);
    std::uniform_real_distribution<double> speed(-1, 1);
    for (int i = 0; i < 100; ++i)
    {
        const Wheels w{speed(engine), speed(engine), speed(engine), speed(engine)};
        const Twist twist = kinematics.Forward({w});
        EXPECT_NEAR(twist.vx_mps, (w[0] + w[1] + w[2] + w[3]) / 4, 1e-14);
        EXPECT_NEAR(twist.vy_mps, (-w[0] + w[1] + w[2] - w[3]) / 4, 1e-14);
        EXPECT_NEAR(twist.omega_radps, (-w[0] + w[1] - w[2] + w[3]) / (4 * kLever_m), 1e-13);
    }
}

// The vendor's mixing, with speed v in mm/s, direction d (90 = forward, 0 = right) and turn w,
// positive clockwise; half the wheelbase plus half the track is 126 mm on this robot.
TEST(Kinematics, MecanumAgreesWithTheVendorsMixing)
{
    const Kinematics kinematics(Robot{}, WheelKind::kMecanum);
    for (const auto &[vx, vy, w] : {Twist{0, 100, 0}, {100, 0, 0}, {0, 0, 0.5}, {30, -50, 1.5}})
    {
        const double vp = -w * 126;
        const Wheels duty{vy + vx - vp, vy - vx + vp, vy - vx - vp, vy + vx + vp};
        const Wheels rim_mps = kinematics.Inverse({vy / 1000, -vx / 1000, -w}).rim_mps;
        for (size_t k = 0; k < kMaxWheels; ++k)
            EXPECT_NEAR(1000 * rim_mps[k], duty[k], 1e-9);
    }
}

TEST(Kinematics, SignsAreForwardLeftAndCounterClockwise)
{
    const Kinematics kinematics(Robot{}, WheelKind::kMecanum);
    EXPECT_GT(kinematics.Forward({kForward}).vx_mps, 0);
    EXPECT_GT(kinematics.Forward({kStrafeLeft}).vy_mps, 0);
    EXPECT_GT(kinematics.Forward({kTurnLeft}).omega_radps, 0);
}

TEST(Kinematics, ForwardUndoesInverse)
{
    for (const WheelKind kind : kAllKinds)
    {
        const Kinematics kinematics(Robot{}, kind);
        const bool strafes = kind != WheelKind::kDifferential;
        for (const Twist &twist : RandomTwists())
        {
            const Twist back = kinematics.Forward(kinematics.Inverse(twist));
            EXPECT_NEAR(back.vx_mps, twist.vx_mps, 1e-13);
            EXPECT_NEAR(back.vy_mps, strafes ? twist.vy_mps : 0, 1e-13);
            EXPECT_NEAR(back.omega_radps, twist.omega_radps, 1e-13);
        }
    }
}

// Siegwart and Nourbakhsh 2004, Introduction to Autonomous Mobile Robots, sec. 3.2: half the sum,
// the difference over the track.
TEST(Kinematics, DifferentialIsTheTextbooks)
{
    const Robot robot;
    const Twist twist = Kinematics(robot, WheelKind::kDifferential).Forward({{0.1, 0.3, 0.1, 0.3}});
    EXPECT_NEAR(twist.vx_mps, 0.2, 1e-15);
    EXPECT_NEAR(twist.omega_radps, 0.2 / (2 * robot.half_track_m), 1e-14);
}

// A wheel at angle a rolls towards a + 90 degrees: its rim speed is the velocity of its contact
// point, omega x r included, in that direction.
TEST(Kinematics, Omni3RollsAsItsContactPointsMove)
{
    const Robot robot;
    const Kinematics kinematics(robot, WheelKind::kOmni3);
    const double at_rad[] = {std::numbers::pi / 3, std::numbers::pi, 5 * std::numbers::pi / 3};
    for (const auto &[vx, vy, w] : RandomTwists())
    {
        const Wheels rim_mps = kinematics.Inverse({vx, vy, w}).rim_mps;
        for (size_t k = 0; k < 3; ++k)
        {
            const double x_m = robot.half_track_m * std::cos(at_rad[k]);
            const double y_m = robot.half_track_m * std::sin(at_rad[k]);
            const double roll_rad = at_rad[k] + std::numbers::pi / 2;
            EXPECT_NEAR(rim_mps[k],
                        (vx - w * y_m) * std::cos(roll_rad) + (vy + w * x_m) * std::sin(roll_rad),
                        1e-13);
        }
        EXPECT_EQ(rim_mps[3], 0);
    }
}

// A point of a body that turns moves as fast as it is far out, so that wheels at other places than
// a model's, as an MJCF file may have them, turn the body by their own.
TEST(Kinematics, WheelsTwiceAsFarOutTurnTheBodyHalfAsFast)
{
    for (const WheelKind kind : kAllKinds)
    {
        std::vector<Wheel> wheels = DrivenWheels(Robot{}, kind);
        const WheelMotion motion = Kinematics(wheels).Inverse({0, 0, 1});
        for (Wheel &wheel : wheels)
        {
            wheel.x_m *= 2;
            wheel.y_m *= 2;
        }
        EXPECT_NEAR(Kinematics(wheels).Forward(motion).omega_radps, 0.5, 1e-13);
    }
}

// All four wheels of a steered robot turn about one point on the line of the rear axle, at the
// distance wheelbase / tan(steering) (Rajamani 2012, Vehicle Dynamics and Control, sec. 2.2); the
// rear wheels' speeds are as their distances from it.
TEST(Kinematics, AckermannTurnsAboutAPointOnItsRearAxle)
{
    Robot robot;
    robot.half_wheelbase_m = 0.13;
    robot.half_track_m = 0.08;
    const Kinematics kinematics(robot, WheelKind::kAckermann);
    for (const double steering_rad : {-0.4, 0.1, 0.45})
    {
        const WheelMotion motion = kinematics.Steered(0.7, steering_rad);
        const double radius_m = 0.26 / std::tan(steering_rad);
        EXPECT_NEAR(motion.rim_mps[0] / motion.rim_mps[1], (radius_m - 0.08) / (radius_m + 0.08),
                    1e-12);
        const Twist twist = kinematics.Forward(motion);
        EXPECT_NEAR(twist.vx_mps / twist.omega_radps, radius_m, 1e-12);
        EXPECT_NEAR(kinematics.SidewaysOfTurning(twist.omega_radps), 0.13 * twist.omega_radps,
                    1e-15);
    }
}

TEST(Kinematics, AckermannFollowsVelocityCommandsWithinItsSteering)
{
    Robot robot;
    robot.max_steering_rad = 0.5;
    const Kinematics kinematics(robot, WheelKind::kAckermann);
    for (const Twist &wanted : {Twist{0.5, 0, 0.4}, {-0.5, 0, 0.4}, {-0.2, 0, -0.3}, {0.3, 0, 0}})
    {
        const Twist twist = kinematics.Forward(kinematics.Inverse(wanted));
        EXPECT_NEAR(twist.vx_mps, wanted.vx_mps, 1e-14);
        EXPECT_NEAR(twist.omega_radps, wanted.omega_radps, 1e-14);
    }
    // Beyond the limit it keeps its speed and turns as it can; on the spot it cannot turn.
    const Twist sharp = kinematics.Forward(kinematics.Inverse({0.1, 0, 5}));
    EXPECT_NEAR(sharp.vx_mps, 0.1, 1e-15);
    EXPECT_NEAR(sharp.omega_radps, 0.1 * std::tan(0.5) / (2 * robot.half_wheelbase_m), 1e-14);
    EXPECT_EQ(kinematics.Forward(kinematics.Inverse({0, 0, 1})).omega_radps, 0);
}

}  // namespace
}  // namespace twin::test
