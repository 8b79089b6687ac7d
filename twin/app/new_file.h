// SPDX-License-Identifier: Apache-2.0
// A file that stands under its name only once it is whole: written beside it, renamed at the end.
#ifndef APP_NEW_FILE_H
#define APP_NEW_FILE_H

#include <string>

namespace twin
{

// The sentence on a file that is there and is not replaced.
std::string Exists(const std::string &option, const std::string &path);

class NewFile
{
public:
    // Makes a file of a name that no other has. Throws std::runtime_error in one sentence if it
    // cannot be made. `option` is the one that names the file.
    NewFile(std::string option, std::string path, bool force);
    // Removes what is not finished; a killed program leaves `path`.<letters>.partial.
    ~NewFile();
    NewFile(const NewFile &) = delete;
    NewFile &operator=(const NewFile &) = delete;

    // Where it is written.
    const std::string &Partial() const { return partial_; }
    // Gives it its name. Throws std::runtime_error in one sentence if a file has come to be there
    // meanwhile that is not to be replaced.
    void Finish();
    // Throws std::runtime_error: what failed, and what the system says of it.
    [[noreturn]] void Fail(const char *what) const;

private:
    std::string option_, path_, partial_;
    bool force_;
};

}  // namespace twin

#endif
