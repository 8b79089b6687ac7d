// SPDX-License-Identifier: Apache-2.0
#include "mujoco_world.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <stdexcept>

#include "mecanum_collider.h"
#include "model_file/installed.h"
#include "robot_mjcf.h"

namespace twin
{
namespace
{

constexpr const char *kFloor = "floor";
constexpr double kWallHalfThickness_m = 0.02, kWallHalfHeight_m = 0.15;

// Friction across the grip in the contact itself. More makes MuJoCo's convex contacts lift the
// wheel by about friction times slip speed, and the robot hops; the real drag is a force of the
// plant.
constexpr double kCrossFriction = 1e-4;

struct SpecDeleter
{
    void operator()(mjSpec *spec) const { mj_deleteSpec(spec); }
};
using Spec = std::unique_ptr<mjSpec, SpecDeleter>;

[[noreturn]] void Fail(const std::string &mjcf, const std::string &why)
{
    throw std::invalid_argument((mjcf.empty() ? "mujoco plant" : mjcf) + ": " + why);
}

// The file's robot, or without a file one made of the model's numbers.
Spec Parse(const std::string &mjcf, const Model &model)
{
    char error[1000] = "";
    Spec spec(mjcf.empty()
                  ? mj_parseXMLString(RobotMjcf(model).c_str(), nullptr, error, sizeof error)
                  : mj_parseXML(mjcf.c_str(), nullptr, error, sizeof error));
    if (!spec)
        Fail(mjcf, std::string("is no valid MJCF: ") + error);
    return spec;
}

mjsGeom *FindGeom(mjSpec *spec, const std::string &name)
{
    mjsElement *element = mjs_findElement(spec, mjOBJ_GEOM, name.c_str());
    return element ? mjs_asGeom(element) : nullptr;
}

// What else a file that is no robot of the twin's may be, and how to name the one that was meant.
std::string MeantFile(const std::string &mjcf)
{
    std::string hint =
        "; what `twinmill twin export` writes is for MuJoCo itself, and twin_run runs the model by "
        "--model";
    const auto installed = FindInstalledModelFile(std::filesystem::path(mjcf).filename().string());
    std::error_code unreadable;
    if (installed && !std::filesystem::equivalent(*installed, mjcf, unreadable))
        hint += "; the file here hides the installed one: rename it, or give --mjcf " + *installed;
    return hint;
}

void CheckWheel(const std::string &mjcf, mjSpec *spec, const Wheel &wheel)
{
    const struct
    {
        mjtObj type;
        const char *word;
    } parts[] = {{mjOBJ_JOINT, "joint"}, {mjOBJ_GEOM, "geom"}, {mjOBJ_ACTUATOR, "actuator"}};
    const std::string name = wheel.name;
    for (const auto &part : parts)
        if (!mjs_findElement(spec, part.type, wheel.name))
            Fail(mjcf, std::string("has no ") + part.word + " \"" + name +
                           "\"; a robot needs a joint, a geom and an actuator for each of its "
                           "wheels fl, fr, rl, rr, or w1, w2, w3 of an omni3 robot (see "
                           "turbopi.xml)" +
                           MeantFile(mjcf));
    const mjsGeom *geom = FindGeom(spec, name);
    int size = 0;
    const double *user = mjs_getDouble(geom->userdata, &size);
    const double code = size == 1 ? *user : 0;
    if (geom->type == mjGEOM_CYLINDER && RollerCode(wheel.tread) == code)
        return;
    if (wheel.tread == Tread::kPlain || wheel.tread == Tread::kRollersAcross)
        Fail(mjcf, "geom \"" + name + "\" must be a cylinder" +
                       (wheel.tread == Tread::kPlain
                            ? " without user data: the model's robot has plain wheels"
                            : " with user=\"2\": the model's robot has omni wheels"));
    if (geom->type != mjGEOM_CYLINDER || std::abs(code) != 1)
        Fail(
            mjcf,
            std::string("geom \"") + name +
                "\" must be a cylinder with user=\"1\" or user=\"-1\", the sign of its roller axis "
                "(1, user, 0) at the floor");
}

// The body that carries the wheels.
mjsBody *FindBase(const std::string &mjcf, mjSpec *spec, const std::vector<Wheel> &wheels)
{
    for (const Wheel &wheel : wheels)
        CheckWheel(mjcf, spec, wheel);
    mjsElement *first = mjs_findElement(spec, mjOBJ_JOINT, wheels[0].name);
    mjsBody *base = mjs_getParent(mjs_getParent(first)->element);
    mjsElement *joint = mjs_firstChild(base, mjOBJ_JOINT, 0);
    if (!joint || mjs_asJoint(joint)->type != mjJNT_FREE)
        Fail(mjcf, "the body that carries the wheels has no free joint, so the robot cannot move");
    return base;
}

// Everything but the robot: the file's own world if it has a floor, else the installed one.
Spec MakeSurroundings(const std::string &mjcf, mjSpec *robot, const Model &model)
{
    Spec world;
    if (FindGeom(robot, kFloor))
    {
        world.reset(mj_copySpec(robot));
        mjs_delete(world.get(), FindBase(mjcf, world.get(), model.MakeWheels())->element);
    }
    else
        world = Parse(FindModelFile("turbopi_world.xml"), model);
    world->nuser_geom = 1;
    return world;
}

// A contact pair that grips along the rollers' axes, or all around if there are none, with the
// friction and softness of the wheel's geom. It takes the place of the contact that floor and wheel
// would have by themselves.
void AddWheelContact(mjSpec *world, const mjsGeom &wheel, const std::string &name, Tread tread)
{
    mjsPair *pair = mjs_addPair(world, nullptr);
    mjs_setString(pair->geomname1, kFloor);
    mjs_setString(pair->geomname2, name.c_str());
    pair->condim = 3;
    pair->friction[0] = wheel.friction[0];
    pair->friction[1] = tread == Tread::kPlain ? wheel.friction[0] : kCrossFriction;
    for (int i = 0; i < mjNREF; ++i)
        pair->solref[i] = wheel.solref[i];
}

// What collision effects ask for: the hull wider all around, and rougher.
void ChangeHull(mjsBody *base, const Model &model)
{
    const Body body = model.MakeBody();
    const double wider_m = body.radius_m - model.robot.body_radius_m;
    if (wider_m == 0 && body.friction == 0)
        return;
    for (mjsElement *e = mjs_firstChild(base, mjOBJ_GEOM, 0); e; e = mjs_nextChild(base, e, 0))
    {
        mjsGeom *geom = mjs_asGeom(e);
        if (!geom->contype)
            continue;
        const int axes = geom->type == mjGEOM_BOX || geom->type == mjGEOM_ELLIPSOID ? 2 : 1;
        for (int axis = 0; axis < axes; ++axis)
            geom->size[axis] = std::max(geom->size[axis] + wider_m, 1e-3);
        geom->friction[0] += body.friction;
    }
}

double CompiledMass(mjSpec *robot)
{
    const std::unique_ptr<mjModel, void (*)(mjModel *)> model(mj_compile(robot, nullptr),
                                                              mj_deleteModel);
    return model ? model->body_subtreemass[0] : 0;
}

void ScaleMass(mjsBody *body, double factor)
{
    body->mass *= factor;
    for (double &moment : body->inertia)
        moment *= factor;
    for (double &moment : body->fullinertia)
        moment *= factor;
    for (mjsElement *e = mjs_firstChild(body, mjOBJ_GEOM, 0); e; e = mjs_nextChild(body, e, 0))
    {
        mjs_asGeom(e)->mass *= factor;
        mjs_asGeom(e)->density *= factor;
    }
    for (mjsElement *e = mjs_firstChild(body, mjOBJ_BODY, 0); e; e = mjs_nextChild(body, e, 0))
        ScaleMass(mjs_asBody(e), factor);
}

// The model's mass, where it states one, spread as in the file.
void TakeMass(const std::string &mjcf, mjSpec *robot, mjsBody *base, const Model &model)
{
    constexpr double kRounded = 1e-3;  // files give the masses of parts to a few digits
    if (mjcf.empty() || !model.States("robot.mass_kg"))
        return;
    const Spec alone(mj_copySpec(robot));
    const double file_kg = CompiledMass(alone.get());
    if (!(file_kg > 0))
        Fail(mjcf, "its robot has no mass that robot.mass_kg could change");
    const double factor = model.robot.mass_kg / file_kg;
    if (std::abs(factor - 1) > kRounded)
        ScaleMass(base, factor);
}

bool IsWheel(const std::vector<Wheel> &wheels, const std::string &name)
{
    return std::any_of(wheels.begin(), wheels.end(),
                       [&](const Wheel &wheel) { return wheel.name == name; });
}

// All elements of a kind of which `unwanted` is true.
template <typename Unwanted>
void DeleteAll(mjSpec *spec, mjtObj kind, Unwanted unwanted)
{
    for (mjsElement *e = mjs_firstElement(spec, kind); e;)
    {
        mjsElement *next = mjs_nextElement(spec, e);
        if (unwanted(e))
            mjs_delete(spec, e);
        e = next;
    }
}

// Leaves the free joint and the wheels: servos stand where they start, sensors and keyframes go.
void Strip(mjSpec *robot, const std::vector<Wheel> &wheels)
{
    const auto any = [](mjsElement *) { return true; };
    const auto servo = [&](mjsElement *e) {
        return !IsWheel(wheels, mjs_getString(mjs_getName(e))) &&
               !(e->elemtype == mjOBJ_JOINT && mjs_asJoint(e)->type == mjJNT_FREE);
    };
    DeleteAll(robot, mjOBJ_SENSOR, any);
    DeleteAll(robot, mjOBJ_KEY, any);
    DeleteAll(robot, mjOBJ_ACTUATOR, servo);
    DeleteAll(robot, mjOBJ_JOINT, servo);
}

void AddRobot(const std::string &mjcf, mjSpec *world, mjSpec *robot, int id, const Pose2 &start,
              const Model &model)
{
    mjsFrame *frame = mjs_addFrame(mjs_findBody(world, "world"), nullptr);
    frame->pos[0] = start.x_m;
    frame->pos[1] = start.y_m;
    frame->quat[0] = std::cos(start.theta_rad / 2);
    frame->quat[3] = std::sin(start.theta_rad / 2);

    const Spec copy(mj_copySpec(robot));
    const std::vector<Wheel> wheels = model.MakeWheels();
    mjsBody *base = FindBase(mjcf, copy.get(), wheels);
    ChangeHull(base, model);
    TakeMass(mjcf, robot, base, model);
    if (!mjs_attach(frame->element, base->element, NameInWorld(id, "").c_str(), ""))
        Fail(mjcf, std::string("cannot be put into the world: ") + mjs_getError(world));
    for (const Wheel &wheel : wheels)
    {
        const std::string name = NameInWorld(id, wheel.name);
        AddWheelContact(world, *FindGeom(world, name), name, wheel.tread);
    }
}

void AddWalls(mjSpec *world, double half_width_m)
{
    const double inner_m = half_width_m + kWallHalfThickness_m,
                 long_m = inner_m + kWallHalfThickness_m;
    for (int side = 0; side < 4; ++side)
    {
        const int across = side / 2, along = 1 - across;
        mjsGeom *wall = mjs_addGeom(mjs_findBody(world, "world"), mjs_findDefault(world, "wall"));
        wall->type = mjGEOM_BOX;
        wall->contype = wall->conaffinity = 2;
        wall->pos[across] = side % 2 ? inner_m : -inner_m;
        wall->pos[2] = wall->size[2] = kWallHalfHeight_m;
        wall->size[across] = kWallHalfThickness_m;
        wall->size[along] = long_m;
    }
}

mjsGeom *AddPiece(mjsBody *body, mjtGeom type, double height_m)
{
    mjsGeom *piece = mjs_addGeom(body, nullptr);
    piece->type = type;
    piece->contype = piece->conaffinity = 2;
    piece->pos[2] = height_m / 2;
    return piece;
}

// A post at each end, and for a wall what is between them. It is told where to be, and yields to
// nobody.
void AddWorldBody(mjSpec *world, const WorldBody &of)
{
    mjsBody *body = mjs_addBody(mjs_findBody(world, "world"), nullptr);
    body->mocap = 1;
    body->pos[0] = of.shape.from_m.x();
    body->pos[1] = of.shape.from_m.y();
    const Eigen::Vector2d along_m = of.shape.to_m - of.shape.from_m;
    const double length_m = along_m.norm();
    for (const double end : {0.0, 1.0})
    {
        if (end > 0 && length_m == 0)
            return;
        mjsGeom *post = AddPiece(body, mjGEOM_CYLINDER, of.height_m);
        post->size[0] = of.shape.radius_m;
        post->size[1] = of.height_m / 2;
        post->pos[0] = end * along_m.x();
        post->pos[1] = end * along_m.y();
    }
    mjsGeom *wall = AddPiece(body, mjGEOM_BOX, of.height_m);
    wall->size[0] = length_m / 2;
    wall->size[1] = of.shape.radius_m;
    wall->size[2] = of.height_m / 2;
    wall->pos[0] = along_m.x() / 2;
    wall->pos[1] = along_m.y() / 2;
    const double half_rad = std::atan2(along_m.y(), along_m.x()) / 2;
    wall->quat[0] = std::cos(half_rad);
    wall->quat[3] = std::sin(half_rad);
}

// Attaching a body leaves the numerics of its file behind.
void CopyRollerDrag(mjSpec *world, mjSpec *robot)
{
    mjsElement *from = mjs_findElement(robot, mjOBJ_NUMERIC, kRollerDrag);
    if (!from || mjs_findElement(world, mjOBJ_NUMERIC, kRollerDrag))
        return;
    int size = 0;
    const double *drag = mjs_getDouble(mjs_asNumeric(from)->data, &size);
    mjsNumeric *to = mjs_addNumeric(world);
    mjs_setName(to->element, kRollerDrag);
    mjs_setDouble(to->data, drag, size);
    to->size = size;
}

}  // namespace

std::string NameInWorld(int robot, const std::string &name)
{
    char prefix[16];
    std::snprintf(prefix, sizeof prefix, "r%02d_", robot);
    return prefix + name;
}

std::vector<WorldBody> SolidOf(std::vector<WorldBody> world)
{
    std::erase_if(world, [](const WorldBody &body) { return !body.is_solid; });
    return world;
}

mjModel *CompileWorld(const std::string &mjcf, const std::vector<Model> &models,
                      const std::vector<Pose2> &starts, const MujocoOptions &options)
{
    InstallMecanumCollider();
    const Spec robot = Parse(mjcf, models[0]);
    const std::vector<Wheel> wheels = models[0].MakeWheels();
    FindBase(mjcf, robot.get(), wheels);
    if (options.simplified)
        Strip(robot.get(), wheels);
    const Spec world = MakeSurroundings(mjcf, robot.get(), models[0]);
    CopyRollerDrag(world.get(), robot.get());
    for (size_t i = 0; i < starts.size(); ++i)
        AddRobot(mjcf, world.get(), robot.get(), static_cast<int>(i), starts[i], models[i]);
    if (options.arena_half_width_m)
        AddWalls(world.get(), *options.arena_half_width_m);
    for (const WorldBody &body : SolidOf(options.world))
        AddWorldBody(world.get(), body);
    if (!options.visuals)
        mjs_discardVisual(world.get(), nullptr);
    if (options.simplified)
        world->compiler.fusestatic = true;
    mjModel *model = mj_compile(world.get(), nullptr);
    if (!model)
        Fail(mjcf,
             std::string("does not compile with its surroundings: ") + mjs_getError(world.get()));
    return model;
}

}  // namespace twin
