// SPDX-License-Identifier: Apache-2.0
#include "view/views.h"

#include <chrono>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "figures.h"
#include "files.h"
#include "offscreen.h"
#include "painter.h"
#include "window.h"

namespace twin
{
namespace
{

using WallClock = std::chrono::steady_clock;

constexpr int kWidth_px = 1280, kHeight_px = 720, kVideoRate_Hz = 30;
constexpr std::chrono::milliseconds kRedraw{33};
// What MuJoCo's renderer has materials for: 12 a robot.
constexpr size_t kMostShown = 80;

}  // namespace

// In the order in which they are made: drawing needs a context, and a robot to draw.
struct Views::Parts
{
    explicit Parts(const ViewOptions &o) : options(o), figures(o.mjcf, o.cones.size())
    {
        if (options.window)
            window.emplace(static_cast<int>(options.cones.size()));
        else
            offscreen.emplace();
        painter.emplace(figures, options.cones);
        if (window)
            window->Steer(figures.model(), &painter->camera());
        if (!options.video.empty())
            video.emplace(options.video, kWidth_px, kHeight_px, kVideoRate_Hz);
    }

    // Keeps all robots in view until the person moves the camera.
    void Follow(const Swarm &swarm, const mjrRect &area)
    {
        if (!window || window->follows())
            painter->Frame(swarm, area);
    }

    void DrawOffscreen(const Swarm &swarm)
    {
        const mjrRect area{0, 0, kWidth_px, kHeight_px};
        Follow(swarm, area);
        painter->UseOffscreen(kWidth_px, kHeight_px);
        painter->Draw(swarm, window ? window->robot() : 0, "", area);
        painter->Read(pixels, area);
    }

    void DrawWindow(const Swarm &swarm)
    {
        Follow(swarm, window->Area());
        painter->UseWindow();
        painter->Draw(swarm, window->robot(),
                      window->paused()
                          ? "paused: space goes on, right arrow steps"
                          : "space pauses, Tab or digit chooses a robot, F follows all",
                      window->Area());
        window->Flip();
        drawn = WallClock::now();
    }

    ViewOptions options;
    Figures figures;
    std::optional<Offscreen> offscreen;
    std::optional<Window> window;
    std::optional<Painter> painter;
    std::optional<VideoWriter> video;
    std::vector<uint8_t> pixels;
    int64_t video_frames = 0;
    WallClock::time_point drawn{};
};

Views::Views(const ViewOptions &options)
{
    if (!options.window && options.picture.empty() && options.video.empty())
        return;
    if (options.cones.size() > kMostShown)
        throw std::runtime_error(
            std::to_string(options.cones.size()) + " robots cannot be shown, only up to " +
            std::to_string(kMostShown) + ": leave out --view, --picture and --video, or lower --n");
    parts_ = std::make_unique<Parts>(options);
}

Views::~Views() = default;

double Views::Show(const Swarm &swarm)
{
    if (!parts_)
        return 0;
    Parts &p = *parts_;
    if (p.video && swarm.TimeS() * kVideoRate_Hz >= static_cast<double>(p.video_frames))
    {
        p.DrawOffscreen(swarm);
        for (; swarm.TimeS() * kVideoRate_Hz >= static_cast<double>(p.video_frames);
             ++p.video_frames)
            p.video->Add(p.pixels);
    }
    if (!p.window)
        return 0;
    const WallClock::time_point begin = WallClock::now();
    if (begin < p.drawn + kRedraw && !p.window->paused())
        return 0;
    p.DrawWindow(swarm);
    if (!p.window->paused())
        return 0;
    while (p.window->paused() && !p.window->Closed() && !p.window->TakeStep())
    {
        std::this_thread::sleep_for(kRedraw);
        p.DrawWindow(swarm);
    }
    return std::chrono::duration<double>(WallClock::now() - begin).count();
}

bool Views::Closed() const
{
    return parts_ && parts_->window && parts_->window->Closed();
}

void Views::Finish(const Swarm &swarm)
{
    if (!parts_)
        return;
    if (parts_->video)
        parts_->video->Finish();
    if (!parts_->options.picture.empty())
    {
        parts_->DrawOffscreen(swarm);
        WritePng(parts_->options.picture, parts_->pixels, kWidth_px, kHeight_px);
    }
}

}  // namespace twin
