// SPDX-License-Identifier: Apache-2.0
// A window on the swarm: mouse turns, shifts and zooms; keys pause, step and choose a
// robot.
#ifndef VIEW_WINDOW_H
#define VIEW_WINDOW_H

#include "painter.h"

struct GLFWwindow;

namespace twin
{

class Window
{
public:
    // Opens it and makes its OpenGL current. Throws std::runtime_error in one sentence.
    explicit Window(int robots);
    ~Window();
    Window(const Window &) = delete;

    // Whose point of view the mouse moves. Both live as long as the window.
    void Steer(const mjModel *model, mjvCamera *camera);

    mjrRect Area() const;
    // Shows what was drawn, and hears mouse and keys.
    void Flip();
    bool Closed() const;
    bool paused() const { return paused_; }
    // False once the person has moved the camera, until a key asks for it again.
    bool follows() const { return follows_; }
    // True once after each press of the key for a single step.
    bool TakeStep();
    int robot() const { return robot_; }

private:
    void OnKey(int key);
    void OnMove(double x_px, double y_px);
    void OnScroll(double by);
    void MoveCamera(int how, double by_x, double by_y);

    GLFWwindow *window_;
    const mjModel *model_ = nullptr;
    mjvCamera *camera_ = nullptr;
    int robots_, robot_ = 0;
    bool paused_ = false, step_ = false, follows_ = true;
    double x_px_ = 0, y_px_ = 0;
};

}  // namespace twin

#endif
