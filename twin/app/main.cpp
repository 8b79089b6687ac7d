// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <string>
#include <string_view>

#include "options.h"
#include "run.h"
#include "summary.h"

namespace
{

int Fail(const std::string &sentence, int exit_code, bool as_json)
{
    std::fprintf(stderr, "twin_run: %s\n", sentence.c_str());
    if (as_json)
        twin::PrintFailure(sentence);
    return exit_code;
}

// What is lost on a full disk must not look like success.
int Done()
{
    if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0)
        return 0;
    return Fail(std::string("the output cannot be written: ") + std::strerror(errno), 1, false);
}

}  // namespace

int main(int argc, char **argv)
{
    // A wrong command line is told in JSON, too.
    const bool as_json = std::any_of(
        argv + 1, argv + argc, [](const char *word) { return std::string_view(word) == "--json"; });
    try
    {
        const twin::Options options = twin::ParseOptions(argc, argv);
        std::signal(SIGINT, [](int) { twin::RequestStop(); });
        std::signal(SIGTERM, [](int) { twin::RequestStop(); });
        std::signal(SIGXFSZ, SIG_IGN);  // a log that may not grow is an error like a full disk
        twin::Run(options);
        return Done();
    }
    catch (const twin::NoRun &no_run)
    {
        if (no_run.exit_code != 0)
            return Fail(no_run.text, no_run.exit_code, as_json);
        std::fputs(no_run.text.c_str(), stdout);
        return Done();
    }
    catch (const std::exception &error)
    {
        return Fail(error.what(), 1, as_json);
    }
}
