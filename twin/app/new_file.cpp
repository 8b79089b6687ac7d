// SPDX-License-Identifier: Apache-2.0
#include "new_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace twin
{
namespace
{

constexpr std::string_view kEnding = ".partial";
constexpr mode_t kMode = 0644;

}  // namespace

std::string Exists(const std::string &option, const std::string &path)
{
    return option + " " + path + ": exists; choose another name, or replace it with --force";
}

NewFile::NewFile(std::string option, std::string path, bool force)
    : option_(std::move(option)),
      path_(std::move(path)),
      partial_(path_ + ".XXXXXX" + std::string(kEnding)),
      force_(force)
{
    const int fd = mkostemps(partial_.data(), static_cast<int>(kEnding.size()), O_CLOEXEC);
    if (fd < 0)
        Fail("cannot be written");
    fchmod(fd, kMode);
    close(fd);
}

NewFile::~NewFile()
{
    unlink(partial_.c_str());
}

void NewFile::Fail(const char *what) const
{
    throw std::runtime_error(option_ + " " + path_ + ": " + what + ": " + std::strerror(errno));
}

void NewFile::Finish()
{
    // The name is taken first, so that of two programs one finds it taken.
    const int fd =
        force_ ? -1 : open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kMode);
    if (!force_ && fd < 0 && errno == EEXIST)
        throw std::runtime_error(Exists(option_, path_));
    if (!force_ && fd < 0)
        Fail("cannot be written");
    if (fd >= 0)
        close(fd);
    if (std::rename(partial_.c_str(), path_.c_str()) != 0)
        Fail("cannot be written");
}

}  // namespace twin
