// SPDX-License-Identifier: Apache-2.0
#include "offscreen.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <dlfcn.h>

#include <stdexcept>
#include <string>

namespace twin
{
namespace
{

// Looked up when pictures are asked for: the twin itself runs on machines that have no graphics.
struct Egl
{
    decltype(&eglGetPlatformDisplay) get_platform_display;
    decltype(&eglGetDisplay) get_display;
    decltype(&eglInitialize) initialize;
    decltype(&eglChooseConfig) choose_config;
    decltype(&eglBindAPI) bind_api;
    decltype(&eglCreateContext) create_context;
    decltype(&eglMakeCurrent) make_current;
    decltype(&eglDestroyContext) destroy_context;
    decltype(&eglTerminate) terminate;
};

template <typename Function>
void Find(void *library, const char *name, Function &function)
{
    function = reinterpret_cast<Function>(dlsym(library, name));
    if (!function)
        throw std::runtime_error(std::string("libEGL.so.1 has no ") + name +
                                 ": it is older than 1.5; install libegl1");
}

Egl LoadEgl()
{
    void *library = dlopen("libEGL.so.1", RTLD_NOW | RTLD_GLOBAL);
    if (!library)
        throw std::runtime_error(
            "pictures and videos need libEGL.so.1, which is not here: install libegl1 and "
            "libgl1-mesa-dri, which need no graphics card");
    Egl egl;
    Find(library, "eglGetPlatformDisplay", egl.get_platform_display);
    Find(library, "eglGetDisplay", egl.get_display);
    Find(library, "eglInitialize", egl.initialize);
    Find(library, "eglChooseConfig", egl.choose_config);
    Find(library, "eglBindAPI", egl.bind_api);
    Find(library, "eglCreateContext", egl.create_context);
    Find(library, "eglMakeCurrent", egl.make_current);
    Find(library, "eglDestroyContext", egl.destroy_context);
    Find(library, "eglTerminate", egl.terminate);
    return egl;
}

const Egl &TheEgl()
{
    static const Egl egl = LoadEgl();
    return egl;
}

// Mesa needs neither display nor card; other makers' EGL finds its card by itself.
EGLDisplay OpenDisplay()
{
    const EGLDisplay displays[] = {
        TheEgl().get_platform_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr),
        TheEgl().get_display(EGL_DEFAULT_DISPLAY)};
    for (const EGLDisplay display : displays)
        if (display != EGL_NO_DISPLAY && TheEgl().initialize(display, nullptr, nullptr))
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
    if (display == EGL_NO_DISPLAY ||
        !TheEgl().choose_config(display, kWanted, &config, 1, &count) || count < 1 ||
        !TheEgl().bind_api(EGL_OPENGL_API))
        return EGL_NO_CONTEXT;
    return TheEgl().create_context(display, config, EGL_NO_CONTEXT, nullptr);
}

}  // namespace

Offscreen::Offscreen() : display_(OpenDisplay()), context_(MakeContext(display_))
{
    if (context_ == EGL_NO_CONTEXT ||
        !TheEgl().make_current(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_))
        throw std::runtime_error(
            "pictures and videos need OpenGL, which EGL does not give here: install "
            "libgl1-mesa-dri, which needs no graphics card");
}

Offscreen::~Offscreen()
{
    TheEgl().make_current(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    TheEgl().destroy_context(display_, context_);
    TheEgl().terminate(display_);
}

}  // namespace twin
