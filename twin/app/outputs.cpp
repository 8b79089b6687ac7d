// SPDX-License-Identifier: Apache-2.0
#include "outputs.h"

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "behaviors.h"
#include "key.h"
#include "new_file.h"
#include "outlet.h"

namespace twin
{
namespace
{

namespace fs = std::filesystem;

struct NamedFile
{
    std::string option, path;
};

// By whatever names: a link and what it points at are one file.
bool IsSame(const std::string &path, const std::string &other)
{
    if (fs::exists(path) && fs::exists(other))
        return fs::equivalent(path, other);
    return fs::weakly_canonical(path) == fs::weakly_canonical(other);
}

std::vector<NamedFile> Outputs(const Options &options)
{
    const std::string recording = RecordingPath(options.lcm_url.value_or(""));
    std::vector<NamedFile> named;
    for (const NamedFile &file : std::vector<NamedFile>{{"--log", options.log},
                                                        {"--lcm-url", recording},
                                                        {"--picture", options.picture},
                                                        {"--video", options.video}})
        if (!file.path.empty())
            named.push_back(file);
    return named;
}

std::vector<std::string> Inputs(const Options &options)
{
    std::vector<std::string> paths;
    for (const std::string &path :
         {FindModelFile(options.model), FindModelFile(options.mjcf), options.script, options.world,
          FindBehaviors(options.behaviors), KeyPath(options.key), options.hil.program})
        if (!path.empty())
            paths.push_back(path);
    return paths;
}

void CheckPlace(const NamedFile &file, bool force)
{
    const std::string name = file.option + " " + file.path;
    const fs::path folder = fs::path(file.path).parent_path();
    if (!folder.empty() && !fs::is_directory(folder))
        throw std::runtime_error(name + ": cannot be written: there is no folder " +
                                 folder.string());
    if (fs::exists(file.path) && !fs::is_regular_file(file.path))
        throw std::runtime_error(name + ": is no ordinary file; choose another name");
    if (fs::exists(file.path) && !force)
        throw std::runtime_error(Exists(file.option, file.path));
}

}  // namespace

void CheckOutputs(const Options &options)
{
    const std::vector<std::string> inputs = Inputs(options);
    std::vector<NamedFile> seen;
    for (const NamedFile &file : Outputs(options))
    {
        for (const std::string &input : inputs)
            if (IsSame(file.path, input))
                throw std::runtime_error(file.option + " " + file.path +
                                         ": is read by this command (" + input +
                                         "), and what is read is never replaced; choose another "
                                         "name");
        for (const NamedFile &other : seen)
            if (IsSame(file.path, other.path))
                throw std::runtime_error(file.option + " " + file.path + ": is what " +
                                         other.option + " writes; choose another name");
        CheckPlace(file, options.force);
        seen.push_back(file);
    }
}

}  // namespace twin
