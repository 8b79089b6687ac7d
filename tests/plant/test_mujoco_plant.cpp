// SPDX-License-Identifier: Apache-2.0
// Tests twin/plant/mujoco. Truth: the ideal mecanum equations, Coulomb friction, Newton's law, the
// planar plant, and the sizes of the MJCF file.
#include "plant_mujoco/mujoco_plant.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>

#include "plant/planar_plant.h"

namespace twin
{
namespace
{

constexpr double kRadius_m = 0.0325, kHalfWheelbase_m = 0.059, kHalfTrack_m = 0.067;
constexpr double kHalfLength_m = 0.095;  // of the hull
constexpr double kFriction = 0.8, kRollerDrag = 0.065, kGravity_mps2 = 9.81;
constexpr double kSide[kMaxWheels] = {-1, 1, 1, -1};
constexpr double kX[kMaxWheels] = {1, 1, -1, -1}, kY[kMaxWheels] = {1, -1, 1, -1};
constexpr double kControl_s = 0.02;

Model WheelSpeedModel()
{
    Model model;
    model.base.drive = Drive::kWheelSpeed;
    return model;
}

MujocoPlant MakePlant(const std::vector<Pose2> &starts, const MujocoOptions &options = {},
                      const Model &model = WheelSpeedModel())
{
    return MujocoPlant(FindModelFile("turbopi.xml"), std::vector<Model>(starts.size(), model),
                       starts, options);
}

void Simulate(Plant &plant, double duration_s)
{
    for (int i = 0; i < std::lround(duration_s / kControl_s); ++i)
        plant.Step(kControl_s);
}

// Wheel rates of the textbook: w R = vx - y omega + s (vy + x omega).
Command Ideal(const Twist &twist)
{
    Command command;
    for (size_t k = 0; k < kMaxWheels; ++k)
        command.value[k] =
            (twist.vx_mps - kY[k] * kHalfTrack_m * twist.omega_radps +
             kSide[k] * (twist.vy_mps + kX[k] * kHalfWheelbase_m * twist.omega_radps)) /
            kRadius_m;
    return command;
}

double Rim(const Twist &twist)
{
    return std::abs(twist.vx_mps) + std::abs(twist.vy_mps) +
           (kHalfWheelbase_m + kHalfTrack_m) * std::abs(twist.omega_radps);
}

class IdealMotion : public testing::TestWithParam<std::tuple<double, Twist>>
{
};

TEST_P(IdealMotion, IsReachedWithinOnePercent)
{
    const auto [timestep_s, wanted] = GetParam();
    MujocoPlant plant = MakePlant({{0.3, -0.2, 0.7}}, {.timestep_s = timestep_s});
    plant.SetCommand(0, Ideal(wanted));
    Simulate(plant, 1.0);
    const double tolerance_mps = 0.01 * Rim(wanted);
    double height_m = 0, hop_m2 = 0;
    for (int i = 0; i < 50; ++i)
    {
        plant.Step(kControl_s);
        const RobotState &state = plant.State(0);
        EXPECT_NEAR(state.vx_mps, wanted.vx_mps, tolerance_mps);
        EXPECT_NEAR(state.vy_mps, wanted.vy_mps, tolerance_mps);
        EXPECT_NEAR((kHalfWheelbase_m + kHalfTrack_m) * state.omega_radps,
                    (kHalfWheelbase_m + kHalfTrack_m) * wanted.omega_radps, tolerance_mps);
        const double z_m = plant.data()->qpos[2];
        height_m = i == 0 ? z_m : height_m;
        hop_m2 += (z_m - height_m) * (z_m - height_m) / 50;
    }
    EXPECT_LT(std::sqrt(hop_m2), 2e-6) << "the wheels hop";
}

std::string NameOfMove(const testing::TestParamInfo<IdealMotion::ParamType> &move)
{
    const auto &[timestep_s, twist] = move.param;
    return std::string(twist.vx_mps != 0 ? "Forward" : "") + (twist.vy_mps != 0 ? "Sideways" : "") +
           (twist.omega_radps != 0 ? "Turn" : "") + "By" +
           std::to_string(std::lround(1e3 * timestep_s)) + "ms";
}

INSTANTIATE_TEST_SUITE_P(Moves, IdealMotion,
                         testing::Combine(testing::Values(0.002, 0.005),
                                          testing::Values(Twist{0.3, 0, 0}, Twist{0, 0.3, 0},
                                                          Twist{0, 0, 2}, Twist{0.2, 0.2, 0},
                                                          Twist{0.15, -0.1, 1})),
                         NameOfMove);

TEST(MujocoPlant, RobotAtRestStays)
{
    MujocoPlant plant = MakePlant({{1, 2, 0.5}});
    Simulate(plant, 5);
    const Pose2 &pose = plant.State(0).pose;
    EXPECT_LT(std::hypot(pose.x_m - 1, pose.y_m - 2), 1e-4);
    EXPECT_NEAR(pose.theta_rad, 0.5, 1e-3);
}

TEST(MujocoPlant, WheelsTouchOnceWithTheRollerAxisAsFirstTangent)
{
    const double heading_rad = 0.4;
    MujocoPlant plant = MakePlant({{0, 0, heading_rad}});
    Simulate(plant, 0.2);
    ASSERT_EQ(plant.data()->ncon, kMaxWheels);
    for (int i = 0; i < kMaxWheels; ++i)
    {
        const mjContact &contact = plant.data()->contact[i];
        int k = 0;
        while (NameInWorld(0, std::array{"fl", "fr", "rl", "rr"}[static_cast<size_t>(k)]) !=
               mj_id2name(plant.model(), mjOBJ_GEOM, contact.geom[1]))
            ++k;
        const double axis_rad = heading_rad + kSide[k] * std::numbers::pi / 4;
        EXPECT_NEAR(contact.frame[3], std::cos(axis_rad), 1e-3);
        EXPECT_NEAR(contact.frame[4], std::sin(axis_rad), 1e-3);
        EXPECT_DOUBLE_EQ(contact.friction[0], kFriction);
    }
}

TEST(MujocoPlant, RobotRammedIntoAWallHolds)
{
    const double wall_m = 0.5;
    MujocoPlant plant = MakePlant({{0, 0, 0}}, {.arena_half_width_m = wall_m});
    plant.SetCommand(0, Ideal({0.3, 0, 0}));
    Simulate(plant, 4);
    const Pose2 &pose = plant.State(0).pose;
    EXPECT_NEAR(pose.x_m + kHalfLength_m, wall_m, 0.005);
    EXPECT_NEAR(pose.y_m, 0, 0.005);
    EXPECT_NEAR(pose.theta_rad, 0, 0.05);
}

// Two robots of `model` drive into each other; how near their centres come.
double NearestWhenRamming(const Model &model)
{
    MujocoPlant plant = MakePlant({{-0.4, 0, 0}, {0.4, 0.02, std::numbers::pi}}, {}, model);
    double nearest_m = 1;
    for (int robot : {0, 1})
        plant.SetCommand(robot, Ideal({0.36, 0, 0}));
    for (int i = 0; i < 150; ++i)
    {
        plant.Step(kControl_s);
        nearest_m = std::min(nearest_m, plant.State(1).pose.x_m - plant.State(0).pose.x_m);
    }
    return nearest_m;
}

TEST(MujocoPlant, RobotsThatRamEachOtherOverlapLittle)
{
    const double nearest_m = NearestWhenRamming(WheelSpeedModel());
    EXPECT_GT(nearest_m, 2 * kHalfLength_m - 0.007);
    EXPECT_LT(nearest_m, 2 * kHalfLength_m + 0.001);
}

TEST(MujocoPlant, WiderBodiesTouchEarlier)
{
    Model model = WheelSpeedModel();
    model.AddEffect("collision");
    model.Set("collision.radius_m", 0.03);
    const double nearest_m = NearestWhenRamming(model);
    EXPECT_GT(nearest_m, 2 * (kHalfLength_m + 0.03) - 0.007);
    EXPECT_LT(nearest_m, 2 * (kHalfLength_m + 0.03) + 0.001);
}

// Pushes the still robot sideways; returns how far it went meanwhile.
double Push(double force_N, double duration_s)
{
    MujocoPlant plant = MakePlant({{0, 0, 0}});
    const int base = mj_name2id(plant.model(), mjOBJ_BODY, NameInWorld(0, "base").c_str());
    plant.data()->xfrc_applied[6 * base + 1] = force_N;
    Simulate(plant, duration_s);
    return plant.State(0).pose.y_m;
}

TEST(MujocoPlant, PushAboveTheFrictionConeSlides)
{
    // Four wheels hold m g mu at most, at 45 degrees to the push; rollers drag at 45 degrees to it.
    const double mass_kg = 1.2, push_N = 15, time_s = 0.3;
    const double held_N = mass_kg * kGravity_mps2 * (kFriction + kRollerDrag) / std::numbers::sqrt2;
    const double expected_m = (push_N - held_N) / mass_kg * time_s * time_s / 2;
    EXPECT_NEAR(Push(push_N, time_s), expected_m, 0.05 * expected_m);
}

TEST(MujocoPlant, PushInsideTheFrictionConeIsHeld)
{
    EXPECT_LT(Push(3, 0.5), 0.005);
}

std::vector<Pose2> Grid(int n)
{
    std::vector<Pose2> starts;
    for (int i = 0; i < n; ++i)
        starts.push_back({0.3 * (i % 3) - 0.3, 0.3 * (i / 3) - 0.3, 0.5 * i});
    return starts;
}

// Drives all robots at random for a while and returns their states as bytes.
std::string RandomDrive(MujocoPlant &plant, double duration_s)
{
    std::vector<Random> random;
    for (int i = 0; i < plant.Size(); ++i)
        random.emplace_back(1, i, "test");
    const auto twist = [](Random &r) {
        return Twist{0.7 * r.Uniform() - 0.35, 0.7 * r.Uniform() - 0.35, 5 * r.Uniform() - 2.5};
    };
    for (double t_s = 0; t_s < duration_s; t_s += 0.5)
    {
        for (int i = 0; i < plant.Size(); ++i)
            plant.SetCommand(i, Ideal(twist(random[static_cast<size_t>(i)])));
        Simulate(plant, 0.5);
    }
    std::string bytes(sizeof(mjtNum) * static_cast<size_t>(plant.model()->nq), 0);
    std::memcpy(bytes.data(), plant.data()->qpos, bytes.size());
    return bytes;
}

TEST(MujocoPlant, EightRobotsRammingAtRandomStaySane)
{
    MujocoPlant plant = MakePlant(Grid(8), {.arena_half_width_m = 0.6});
    RandomDrive(plant, 20);
    for (const mjWarningStat &warning : plant.data()->warning)
        EXPECT_EQ(warning.number, 0);
    for (int i = 0; i < plant.Size(); ++i)
    {
        const Pose2 &pose = plant.State(i).pose;
        EXPECT_LT(std::max(std::abs(pose.x_m), std::abs(pose.y_m)), 0.6)
            << "robot " << i << " left";
        const mjtNum *up = plant.data()->xmat + 9 * mj_name2id(plant.model(), mjOBJ_BODY,
                                                               NameInWorld(i, "base").c_str());
        EXPECT_GT(up[8], std::cos(0.05)) << "robot " << i << " tipped";
    }
}

TEST(MujocoPlant, SameSeedSameBytes)
{
    Model model = WheelSpeedModel();
    model.noise.drive_mps = 0.01;
    model.noise.drive_radps = 0.1;
    const auto drive = [&model](uint64_t seed) {
        MujocoPlant plant = MakePlant(Grid(3), {.seed = seed}, model);
        return RandomDrive(plant, 3);
    };
    EXPECT_EQ(drive(7), drive(7));
    EXPECT_NE(drive(7), drive(8));
}

TEST(MujocoPlant, AgreesWithThePlanarPlantWhenWheelsGrip)
{
    Model model;
    model.base.motor_lag_s = 0.08;
    model.base.forward_gain = 0.95;
    model.base.sideways_gain = 0.88;
    model.base.yaw_gain = 0.9;
    model.AddEffect("dead_zone");
    model.AddEffect("floor_tilt");
    model.Set("dead_zone.width", 0.05);
    model.Set("floor_tilt.drift_x_mps", 0.03);
    const std::vector<Pose2> start{{0.1, 0.2, -0.5}};
    MujocoPlant mujoco = MakePlant(start, {}, model);
    PlanarPlant planar({model}, start, 0);
    const Wheels script[] = {
        {0.6, 0.6, 0.6, 0.6}, {-0.5, 0.5, 0.5, -0.5}, {0.8, 0.3, 0.8, 0.3}, {}};
    double path_m = 0;
    for (const Wheels &duty : script)
    {
        for (Plant *plant : {static_cast<Plant *>(&mujoco), static_cast<Plant *>(&planar)})
        {
            plant->SetCommand(0, {duty, 0});
            Simulate(*plant, 1);
        }
        const Pose2 &a = mujoco.State(0).pose, &b = planar.State(0).pose;
        path_m += 0.3;
        EXPECT_NEAR(a.x_m, b.x_m, 0.015 * path_m);
        EXPECT_NEAR(a.y_m, b.y_m, 0.015 * path_m);
        EXPECT_NEAR(a.theta_rad, b.theta_rad, 0.03);
    }
}

TEST(MujocoPlant, EncodersSeeTheWheelsNotTheGain)
{
    Model model = WheelSpeedModel();
    model.base.forward_gain = 0.8;
    MujocoPlant plant = MakePlant({{0, 0, 0}}, {}, model);
    plant.SetCommand(0, Ideal({0.3, 0, 0}));
    Simulate(plant, 1);
    EXPECT_NEAR(plant.State(0).vx_mps, 0.24, 0.003);
    for (const double rim_mps : plant.State(0).rim_mps)
        EXPECT_NEAR(rim_mps, 0.3, 0.003);
}

TEST(MujocoPlant, HeadingCountsFullTurns)
{
    MujocoPlant plant = MakePlant({{0, 0, 0}});
    plant.SetCommand(0, Ideal({0, 0, 2}));
    Simulate(plant, 5);
    EXPECT_NEAR(plant.State(0).pose.theta_rad, 10, 0.15);
}

TEST(MujocoPlant, SceneFileGivesTheSameMotionAsTheRobotAlone)
{
    const auto drive = [](const char *mjcf) {
        MujocoPlant plant(FindModelFile(mjcf), {2, WheelSpeedModel()}, {{0, 0, 0}, {0.5, 0, 1}},
                          {});
        return RandomDrive(plant, 1);
    };
    EXPECT_EQ(drive("turbopi.xml"), drive("scene.xml"));
}

TEST(MujocoPlant, VisualsDoNotChangeTheMotion)
{
    const auto drive = [](bool visuals) {
        MujocoPlant plant = MakePlant(Grid(2), {.visuals = visuals});
        return RandomDrive(plant, 1);
    };
    EXPECT_EQ(drive(false), drive(true));
}

// What sweeps leave out does not show in a drive: to a fifth of what either is off ten free
// rollers.
TEST(MujocoPlant, ASimplifiedWorldMovesLikeAWholeOne)
{
    for (const Twist &twist : {Twist{0.3, 0, 0}, Twist{0, 0.3, 0}, Twist{0, 0, 2},
                               Twist{0.25, 0, 0.8}, Twist{0.2, 0.1, -0.5}})
    {
        MujocoPlant whole = MakePlant({{0, 0, 0.3}}, {.timestep_s = kSweepStep_s});
        MujocoPlant simple = MakePlant({{0, 0, 0.3}}, SweepOptions(0));
        EXPECT_EQ(whole.model()->nv, simple.model()->nv + 2);  // pan and tilt
        for (MujocoPlant *plant : {&whole, &simple})
        {
            plant->SetCommand(0, Ideal(twist));
            Simulate(*plant, 20);
        }
        const Pose2 &a = whole.State(0).pose, &b = simple.State(0).pose;
        const double way_m = 20 * Rim(twist);
        EXPECT_LT(std::hypot(a.x_m - b.x_m, a.y_m - b.y_m), 2e-3 * way_m);
        EXPECT_NEAR(a.theta_rad, b.theta_rad, 2e-3 * way_m / kHalfTrack_m);
    }
}

TEST(MujocoPlant, MjcfAgreesWithTheDefaultModel)
{
    MujocoPlant plant = MakePlant({{0, 0, 0}});
    const mjModel *m = plant.model();
    const Robot robot;
    const int wheel = mj_name2id(m, mjOBJ_GEOM, NameInWorld(0, "fl").c_str());
    const mjtNum *hub = m->body_pos + 3 * m->geom_bodyid[wheel];
    EXPECT_DOUBLE_EQ(m->geom_size[3 * wheel], robot.wheel_radius_m);
    EXPECT_DOUBLE_EQ(hub[0], robot.half_wheelbase_m);
    EXPECT_DOUBLE_EQ(hub[1], robot.half_track_m);
    EXPECT_NEAR(mj_getTotalmass(m), robot.mass_kg, 0.001);
}

// What the constructor says of an MJCF file with this text.
std::string Complaint(const std::string &text)
{
    const auto path = std::filesystem::path(testing::TempDir()) /
                      ("complaint_" + std::to_string(getpid()) + ".xml");
    std::ofstream(path) << text;
    try
    {
        MujocoPlant(path.string(), {Model{}}, {Pose2{}}, {});
    }
    catch (const std::invalid_argument &error)
    {
        return error.what();
    }
    return "";
}

TEST(MujocoPlant, SaysWhatIsWrongWithAFile)
{
    const auto body = [](const std::string &joint, const std::string &wheels) {
        return "<mujoco><worldbody><body name='base'>" + joint + "<geom size='0.1'/>" + wheels +
               "</body></worldbody></mujoco>";
    };
    EXPECT_NE(Complaint("<mujoco").find("is no valid MJCF"), std::string::npos);
    EXPECT_NE(Complaint(body("<freejoint/>", "")).find("has no joint \"fl\""), std::string::npos);
    EXPECT_NE(Complaint(body("<freejoint/>", "<body><joint name='fl'/><geom size='1'/></body>"))
                  .find("has no geom \"fl\""),
              std::string::npos);
}

TEST(MujocoPlant, SaysThatItBecameUnstable)
{
    MujocoPlant plant = MakePlant({{0, 0, 0}});
    plant.data()->qvel[0] = std::nan("");
    EXPECT_THROW(plant.Step(kControl_s), std::runtime_error);
}

TEST(MujocoPlantDeathTest, WritesNoLogFileOfItsOwn)
{
    const auto work = std::filesystem::temp_directory_path() / "twinmill_mujoco_log";
    std::filesystem::create_directory(work);
    std::filesystem::current_path(work);
    MujocoPlant plant = MakePlant({{0, 0, 0}});
    plant.data()->qvel[0] = std::nan("");
    EXPECT_THROW(plant.Step(kControl_s), std::runtime_error);
    EXPECT_EXIT(mju_error("no more memory"), testing::ExitedWithCode(EXIT_FAILURE),
                "no more memory");
    EXPECT_TRUE(std::filesystem::is_empty(work));
}

// A robot of which only the model's numbers are known, told velocities.
Model Twisted(WheelKind wheels)
{
    Model model;
    model.base.wheels = wheels;
    model.base.drive = Drive::kTwist;
    model.robot.half_track_m = 0.09;
    model.robot.wheel_radius_m = 0.04;
    return model;
}

class MadeRobot : public testing::TestWithParam<WheelKind>
{
};

INSTANTIATE_TEST_SUITE_P(MujocoPlant, MadeRobot,
                         testing::Values(WheelKind::kMecanum, WheelKind::kDifferential,
                                         WheelKind::kOmni3),
                         [](const auto &kind) { return std::string(WheelKindName(kind.param)); });

// Where its wheels grip it does what it is told, as the planar plant does exactly.
TEST_P(MadeRobot, FollowsVelocityCommands)
{
    const bool strafes = GetParam() != WheelKind::kDifferential;
    const double scrub = strafes ? 0.05 : 0.1;  // plain wheels are wide: their edges slip in turns
    for (const Twist &wanted : {Twist{0.2, 0, 0}, {-0.15, 0, 0.8}, {0, 0, 1.5}, {0.1, 0.1, -0.5}})
    {
        if (wanted.vy_mps != 0 && !strafes)
            continue;
        MujocoPlant plant("", {Twisted(GetParam())}, {{0, 0, 0.3}}, {});
        plant.SetCommand(0, {{wanted.vx_mps, wanted.vy_mps, wanted.omega_radps, 0}});
        Simulate(plant, 1);
        const double start_rad = plant.State(0).pose.theta_rad;
        double vx_mps = 0, vy_mps = 0;
        constexpr int kSteps = 40;
        for (int i = 0; i < kSteps; ++i)
        {
            plant.Step(kControl_s);
            vx_mps += plant.State(0).vx_mps / kSteps;
            vy_mps += plant.State(0).vy_mps / kSteps;
        }
        const double omega_radps =
            (plant.State(0).pose.theta_rad - start_rad) / (kSteps * kControl_s);
        EXPECT_NEAR(vx_mps, wanted.vx_mps, 0.01);
        EXPECT_NEAR(vy_mps, wanted.vy_mps, 0.01);
        EXPECT_NEAR(omega_radps, wanted.omega_radps, scrub * std::abs(wanted.omega_radps) + 0.01);
    }
}

TEST_P(MadeRobot, StandsStillOnItsWheels)
{
    MujocoPlant plant("", {Twisted(GetParam())}, {{1, 2, 0.5}}, {});
    Simulate(plant, 3);
    const Pose2 &pose = plant.State(0).pose;
    EXPECT_LT(std::hypot(pose.x_m - 1, pose.y_m - 2), 1e-3);
    EXPECT_NEAR(plant.data()->qpos[2], 0, 2e-3);
    EXPECT_NEAR(plant.data()->qpos[3] * plant.data()->qpos[3] +
                    plant.data()->qpos[6] * plant.data()->qpos[6],
                1, 1e-4);  // upright
}

TEST_P(MadeRobot, WeighsWhatItsModelSays)
{
    Model model = Twisted(GetParam());
    model.Set("robot.mass_kg", 2.5);
    const MujocoPlant plant("", {model}, {{0, 0, 0}}, {});
    EXPECT_NEAR(plant.model()->body_subtreemass[0], 2.5, 1e-9);
}

// Four plain wheels scrub when they turn; straight ahead they do not.
TEST(MujocoPlant, ScrubsOnFourPlainWheels)
{
    Model model = Twisted(WheelKind::kDifferential);
    model.Set("robot.half_wheelbase_m", 0.08);
    MujocoPlant plant("", {model}, {{0, 0, 0}}, {});
    plant.SetCommand(0, {{0, 0, 1.5, 0}});
    Simulate(plant, 2);
    EXPECT_GT(plant.State(0).pose.theta_rad, 0.2);
    EXPECT_LT(plant.State(0).pose.theta_rad, 0.9 * 1.5 * 2);
}

// The file's robot weighs 1.2 kg: 1.027 of the base, 0.0377 of each wheel, 0.022 of the camera.
TEST(MujocoPlant, TakesTheMassThatTheModelStates)
{
    Model model = WheelSpeedModel();
    EXPECT_NEAR(MakePlant({{0, 0, 0}}, {}, model).model()->body_subtreemass[0], 1.1998, 1e-9);
    model.Set("robot.mass_kg", 2.4);
    const MujocoPlant heavy = MakePlant({{0, 0, 0}}, {}, model);
    EXPECT_NEAR(heavy.model()->body_subtreemass[0], 2.4, 1e-9);
}

// Motors of limited torque: at twice the mass a robot takes longer to get going.
TEST(MujocoPlant, AHeavierRobotStartsMoreSlowly)
{
    double way_m[2];
    for (int i = 0; i < 2; ++i)
    {
        Model model = WheelSpeedModel();
        model.Set("robot.mass_kg", i ? 4.8 : 1.2);
        MujocoPlant plant = MakePlant({{0, 0, 0}}, {}, model);
        plant.SetCommand(0, Ideal({0.4, 0, 0}));
        Simulate(plant, 0.2);
        way_m[i] = plant.State(0).pose.x_m;
    }
    EXPECT_LT(way_m[1], 0.95 * way_m[0]);
}

TEST(MujocoPlant, RefusesWhatItCannotSimulate)
{
    Model differential;
    differential.base.wheels = WheelKind::kDifferential;
    EXPECT_THROW(MakePlant({{0, 0, 0}}, {}, differential), std::invalid_argument);
    EXPECT_THROW(MujocoPlant("", {Twisted(WheelKind::kAckermann)}, {{0, 0, 0}}, {}),
                 std::invalid_argument);
    EXPECT_THROW(MakePlant({}), std::invalid_argument);
    EXPECT_THROW(MakePlant({{0, 0, 0}}, {.timestep_s = 0}), std::invalid_argument);
}

// Walls and posts stop the hull, which is kHalfLength_m long in front; a goal does not.
TEST(World, StopsTheHullAtAWallAndNotAtAGoal)
{
    const WorldBody wall{"", {{0.6, -1}, {0.6, 1}, 0.02}, 0.2, ""},
        goal{"", {{0.3, 0}, {0.3, 0}, 0.1}, 0.2, "red", false};
    MujocoPlant plant = MakePlant({{0, 0, 0}}, {.world = {goal, wall}});
    plant.SetCommand(0, Ideal({0.3, 0, 0}));
    Simulate(plant, 4);
    const double contact_m = 0.6 - 0.02 - kHalfLength_m;
    EXPECT_NEAR(plant.State(0).pose.x_m, contact_m, 0.01);  // contacts are soft, wheels stick out
}

// It goes 1 m in 4 s and does not yield.
TEST(World, EvaderPushesARobotAway)
{
    const WorldBody evader{"", {{-0.5, 0}, {-0.5, 0}, 0.1}, 0.2, "red", true, {{0.5, 0}}, 0.25};
    MujocoPlant plant = MakePlant({{0, 0, 0}}, {.world = {evader}});
    Simulate(plant, 4);
    EXPECT_NEAR(plant.State(0).pose.x_m, 0.5 + 0.1 + kHalfLength_m, 0.02);
}

}  // namespace
}  // namespace twin
