// SPDX-License-Identifier: Apache-2.0
// What to show of a run, from its options.
#ifndef APP_SHOW_H
#define APP_SHOW_H

#include <optional>
#include <string>
#include <vector>

#include "new_file.h"
#include "options.h"
#include "view/views.h"

namespace twin
{

// The files that are drawn, until they have their names.
class Pictures
{
public:
    // As NewFile's constructor.
    explicit Pictures(const Options &options);

    // Where they are drawn; empty if they are not asked for.
    std::string Picture() const { return picture_ ? picture_->Partial() : ""; }
    std::string Video() const { return video_ ? video_->Partial() : ""; }
    // As NewFile's.
    void Finish();

private:
    std::optional<NewFile> picture_, video_;
};

ViewOptions MakeViewOptions(const Options &options, const std::vector<Model> &robots,
                            const Pictures &pictures);

}  // namespace twin

#endif
