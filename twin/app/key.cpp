// SPDX-License-Identifier: Apache-2.0
#include "key.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>

namespace twin
{
namespace
{

std::filesystem::path DefaultPath()
{
    const char *config = std::getenv("XDG_CONFIG_HOME"), *home = std::getenv("HOME");
    const std::filesystem::path folder =
        config && *config ? config : std::filesystem::path(home ? home : ".") / ".config";
    return folder / "twinmill" / "swarm.key";
}

}  // namespace

std::string KeyPath(const std::string &path)
{
    return path.empty() ? DefaultPath().string() : path;
}

seal_key LoadKey(const std::string &path)
{
    const std::filesystem::path file = KeyPath(path);
    std::error_code ignored;
    std::filesystem::create_directories(file.parent_path(), ignored);
    if (!seal_make(file.c_str()))
        throw std::runtime_error("--key " + file.string() +
                                 ": cannot be made: " + std::strerror(errno));
    seal_key key;
    char error[SEAL_ERROR_MAX];
    if (!seal_load(file.c_str(), &key, error))
        throw std::runtime_error(error);
    return key;
}

}  // namespace twin
