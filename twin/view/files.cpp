// SPDX-License-Identifier: Apache-2.0
#include "files.h"

#include <fcntl.h>
#include <png.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>
#include <utility>

extern char **environ;

namespace twin
{

void WritePng(const std::string &path, const std::vector<uint8_t> &rgb, int width_px, int height_px)
{
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(width_px);
    image.height = static_cast<png_uint_32>(height_px);
    image.format = PNG_FORMAT_RGB;
    const int from_below = -3 * width_px;
    if (!png_image_write_to_file(&image, path.c_str(), 0, rgb.data(), from_below, nullptr))
        throw std::runtime_error(std::string("--picture: cannot be written: ") + image.message);
}

VideoWriter::VideoWriter(const std::string &path, int width_px, int height_px, int rate_Hz)
{
    std::signal(SIGPIPE, SIG_IGN);  // a writer that ended is seen by write()
    const std::string size = std::to_string(width_px) + "x" + std::to_string(height_px);
    std::vector<std::string> words{
        "ffmpeg",   "-loglevel", "error",     "-y",         "-f",       "rawvideo",
        "-pix_fmt", "rgb24",     "-s",        size,         "-r",       std::to_string(rate_Hz),
        "-i",       "-",         "-vf",       "vflip",      "-pix_fmt", "yuv420p",
        "-crf",     "20",        "-movflags", "+faststart", "-f",       "mp4",
        path};
    std::vector<char *> arguments;
    for (std::string &word : words)
        arguments.push_back(word.data());
    arguments.push_back(nullptr);
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0)
        throw std::runtime_error(std::string("--video: no pipe: ") + std::strerror(errno));
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[0], STDIN_FILENO);
    posix_spawnattr_t own_group;  // Ctrl-C ends the run, and the run ends the video
    posix_spawnattr_init(&own_group);
    posix_spawnattr_setflags(&own_group, POSIX_SPAWN_SETPGROUP);
    const int error =
        posix_spawnp(&pid_, "ffmpeg", &actions, &own_group, arguments.data(), environ);
    posix_spawnattr_destroy(&own_group);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[0]);
    fd_ = ends[1];
    if (error != 0)
    {
        close(std::exchange(fd_, -1));
        pid_ = -1;
        throw std::runtime_error(std::string("--video needs the program ffmpeg: ") +
                                 std::strerror(error) + "; install the package ffmpeg");
    }
}

VideoWriter::~VideoWriter()
{
    if (pid_ >= 0)
        WaitForEnd();
}

int VideoWriter::WaitForEnd()
{
    close(std::exchange(fd_, -1));
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR)
    {
    }
    pid_ = -1;
    return status;
}

void VideoWriter::Add(const std::vector<uint8_t> &rgb)
{
    for (size_t sent = 0; sent < rgb.size();)
    {
        const ssize_t got = write(fd_, rgb.data() + sent, rgb.size() - sent);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            throw std::runtime_error("--video: ffmpeg ended early: see its message");
        sent += static_cast<size_t>(got);
    }
}

void VideoWriter::Finish()
{
    if (WaitForEnd() != 0)
        throw std::runtime_error("--video: ffmpeg failed: see its message");
}

}  // namespace twin
