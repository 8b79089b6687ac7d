// SPDX-License-Identifier: Apache-2.0
// Pixels to files: PNG by libpng, MP4 by the program ffmpeg.
#ifndef VIEW_FILES_H
#define VIEW_FILES_H

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

namespace twin
{

// `rgb` has the lowest row first. Throws std::runtime_error in one sentence.
void WritePng(const std::string &path, const std::vector<uint8_t> &rgb, int width_px,
              int height_px);

class VideoWriter
{
public:
    // Starts ffmpeg. Throws std::runtime_error in one sentence if it is not there.
    VideoWriter(const std::string &path, int width_px, int height_px, int rate_Hz);
    ~VideoWriter();
    VideoWriter(const VideoWriter &) = delete;

    // One frame, the lowest row first.
    void Add(const std::vector<uint8_t> &rgb);
    // Throws std::runtime_error in one sentence if the file is not whole.
    void Finish();

private:
    int WaitForEnd();

    pid_t pid_ = -1;
    int fd_ = -1;
};

}  // namespace twin

#endif
