// SPDX-License-Identifier: Apache-2.0
// Draws figures with OpenGL: robots, what each looks over and whether it sees something, and one
// robot's camera in a corner. Needs a current context.
#ifndef VIEW_PAINTER_H
#define VIEW_PAINTER_H

#include "figures.h"
#include "view/views.h"

namespace twin
{

class Painter
{
public:
    Painter(Figures &figures, const std::vector<ViewCone> &cones);
    ~Painter();
    Painter(const Painter &) = delete;

    // Moves the point of view so that all robots are in a picture of this shape, none of them
    // beneath the corner.
    void Frame(const Swarm &swarm, const mjrRect &area);
    // Into the current buffer: the window's, or UseOffscreen()'s.
    void Draw(const Swarm &swarm, int robot_in_corner, const std::string &note,
              const mjrRect &area);

    // Draws to a picture of `width` x `height` instead of the window.
    void UseOffscreen(int width_px, int height_px);
    void UseWindow();
    // What was drawn, RGB, the lowest row first.
    void Read(std::vector<uint8_t> &rgb, const mjrRect &area) const;

    mjvCamera &camera() { return camera_; }

private:
    double DistanceFor(double x_m, double y_m, const mjrRect &area) const;
    mjvGeom *NewDecor();
    void AddCone(const RobotState &state, const ViewCone &cone, bool detected);
    void AddBody(const WorldBody &body, double t_s);
    void AddNumber(const RobotState &state, int robot, bool is_in_corner);
    void ShadeBeside(const ViewCone &cone, double half_across, const mjrRect &corner);
    void DrawCorner(const Swarm &swarm, int robot, const mjrRect &area);

    Figures &figures_;
    std::vector<ViewCone> cones_;
    mjvScene scene_;
    mjvCamera camera_;
    mjvOption option_;
    mjrContext context_;
    std::vector<uint8_t> corner_rgb_;
};

}  // namespace twin

#endif
