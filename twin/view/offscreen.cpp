// SPDX-License-Identifier: Apache-2.0
#include "offscreen.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>

#include <stdexcept>
#include <string>

namespace twin
{
namespace
{

// Mesa needs neither display nor card; other makers' EGL finds its card by itself.
EGLDisplay OpenDisplay()
{
    const EGLDisplay displays[] = {
        eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr),
        eglGetDisplay(EGL_DEFAULT_DISPLAY)};
    for (const EGLDisplay display : displays)
        if (display != EGL_NO_DISPLAY && eglInitialize(display, nullptr, nullptr))
            return display;
    return EGL_NO_DISPLAY;
}

EGLContext MakeContext(EGLDisplay display)
{
    constexpr EGLint kWanted[] = {EGL_RED_SIZE,
                                  8,
                                  EGL_GREEN_SIZE,
                                  8,
                                  EGL_BLUE_SIZE,
                                  8,
                                  EGL_DEPTH_SIZE,
                                  24,
                                  EGL_STENCIL_SIZE,
                                  8,
                                  EGL_SURFACE_TYPE,
                                  EGL_PBUFFER_BIT,
                                  EGL_RENDERABLE_TYPE,
                                  EGL_OPENGL_BIT,
                                  EGL_NONE};
    EGLConfig config;
    EGLint count = 0;
    if (display == EGL_NO_DISPLAY || !eglChooseConfig(display, kWanted, &config, 1, &count) ||
        count < 1 || !eglBindAPI(EGL_OPENGL_API))
        return EGL_NO_CONTEXT;
    return eglCreateContext(display, config, EGL_NO_CONTEXT, nullptr);
}

}  // namespace

Offscreen::Offscreen() : display_(OpenDisplay()), context_(MakeContext(display_))
{
    if (context_ == EGL_NO_CONTEXT ||
        !eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_))
        throw std::runtime_error(
            "pictures and videos need OpenGL, which EGL does not give here: install "
            "libgl1-mesa-dri, which needs no graphics card");
}

Offscreen::~Offscreen()
{
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display_, context_);
    eglTerminate(display_);
}

}  // namespace twin
