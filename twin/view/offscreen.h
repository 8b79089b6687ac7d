// SPDX-License-Identifier: Apache-2.0
// OpenGL without a display, by EGL.
#ifndef VIEW_OFFSCREEN_H
#define VIEW_OFFSCREEN_H

namespace twin
{

class Offscreen
{
public:
    // Makes a context and makes it current. Throws std::runtime_error in one sentence.
    Offscreen();
    ~Offscreen();
    Offscreen(const Offscreen &) = delete;

private:
    void *display_, *context_;
};

}  // namespace twin

#endif
