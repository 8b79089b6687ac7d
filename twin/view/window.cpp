// SPDX-License-Identifier: Apache-2.0
#include "window.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <stdexcept>
#include <utility>

namespace twin
{
namespace
{

constexpr int kWidth_px = 1200, kHeight_px = 800;
constexpr double kZoomPerNotch = -0.05;

Window &Of(GLFWwindow *window)
{
    return *static_cast<Window *>(glfwGetWindowUserPointer(window));
}

}  // namespace

Window::Window(int robots) : window_(nullptr), robots_(robots)
{
    if (glfwInit())
    {
        glfwWindowHint(GLFW_SAMPLES, 4);
        window_ = glfwCreateWindow(kWidth_px, kHeight_px, "twin_run", nullptr, nullptr);
    }
    if (!window_)
    {
        const char *why = nullptr;
        glfwGetError(&why);
        const std::string reason = why ? why : "unknown reason";
        glfwTerminate();
        throw std::runtime_error("--view: no window can be opened (" + reason +
                                 "): it needs a display; --picture and --video do not");
    }
    glfwMakeContextCurrent(window_);
    glfwSwapInterval(0);
    glfwSetWindowUserPointer(window_, this);
    glfwSetKeyCallback(window_, [](GLFWwindow *w, int key, int, int action, int) {
        if (action != GLFW_RELEASE)
            Of(w).OnKey(key);
    });
    glfwSetCursorPosCallback(window_,
                             [](GLFWwindow *w, double x, double y) { Of(w).OnMove(x, y); });
    glfwSetScrollCallback(window_, [](GLFWwindow *w, double, double y) { Of(w).OnScroll(y); });
}

Window::~Window()
{
    glfwDestroyWindow(window_);
    glfwTerminate();
}

void Window::Steer(const mjModel *model, mjvCamera *camera)
{
    model_ = model;
    camera_ = camera;
}

mjrRect Window::Area() const
{
    mjrRect area{};
    glfwGetFramebufferSize(window_, &area.width, &area.height);
    return area;
}

void Window::Flip()
{
    glfwSwapBuffers(window_);
    glfwPollEvents();
}

bool Window::Closed() const
{
    return glfwWindowShouldClose(window_);
}

bool Window::TakeStep()
{
    return std::exchange(step_, false);
}

void Window::OnKey(int key)
{
    if (key == GLFW_KEY_SPACE)
        paused_ = !paused_;
    else if (key == GLFW_KEY_RIGHT)
        paused_ = step_ = true;
    else if (key == GLFW_KEY_TAB)
        robot_ = (robot_ + 1) % robots_;
    else if (key >= GLFW_KEY_0 && key <= GLFW_KEY_9 && key - GLFW_KEY_0 < robots_)
        robot_ = key - GLFW_KEY_0;
    else if (key == GLFW_KEY_F && camera_)
    {
        follows_ = true;
        camera_->distance = 0;  // as near as all are in view
    }
    else if (key == GLFW_KEY_ESCAPE)
        glfwSetWindowShouldClose(window_, GLFW_TRUE);
}

void Window::OnMove(double x_px, double y_px)
{
    const double dx_px = x_px - std::exchange(x_px_, x_px);
    const double dy_px = y_px - std::exchange(y_px_, y_px);
    const auto down = [this](int button) { return glfwGetMouseButton(window_, button); };
    int height_px = 0;
    glfwGetWindowSize(window_, nullptr, &height_px);
    if (height_px == 0)
        return;
    if (down(GLFW_MOUSE_BUTTON_LEFT))
        MoveCamera(mjMOUSE_ROTATE_V, dx_px / height_px, dy_px / height_px);
    else if (down(GLFW_MOUSE_BUTTON_RIGHT))
        MoveCamera(mjMOUSE_MOVE_H, dx_px / height_px, dy_px / height_px);
    else if (down(GLFW_MOUSE_BUTTON_MIDDLE))
        MoveCamera(mjMOUSE_ZOOM, 0, dy_px / height_px);
}

void Window::OnScroll(double by)
{
    MoveCamera(mjMOUSE_ZOOM, 0, kZoomPerNotch * by);
}

void Window::MoveCamera(int how, double by_x, double by_y)
{
    if (!camera_)
        return;
    follows_ = false;
    mjv_moveCamera(model_, how, by_x, by_y, camera_);
}

}  // namespace twin
