// SPDX-License-Identifier: Apache-2.0
// The views of a build without graphics (TWINMILL_BUILD_VIEW=OFF): they show nothing and say so.
#include <stdexcept>

#include "view/views.h"

namespace twin
{

struct Views::Parts
{
};

Views::Views(const ViewOptions &options)
{
    if (options.window || !options.picture.empty() || !options.video.empty())
        throw std::runtime_error(
            "--view, --picture and --video: this twin_run was built without "
            "graphics, as `make demo` does; `make build` adds them");
}

Views::~Views() = default;

double Views::Show(const Swarm &)
{
    return 0;
}

bool Views::Closed() const
{
    return false;
}

void Views::Finish(const Swarm &) {}

}  // namespace twin
