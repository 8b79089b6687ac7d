// SPDX-License-Identifier: Apache-2.0
#include <csignal>
#include <cstdio>
#include <exception>

#include "options.h"
#include "run.h"

int main(int argc, char **argv)
{
    try
    {
        const twin::Options options = twin::ParseOptions(argc, argv);
        std::signal(SIGINT, [](int) { twin::RequestStop(); });
        std::signal(SIGTERM, [](int) { twin::RequestStop(); });
        std::signal(SIGXFSZ, SIG_IGN);  // a log that may not grow is an error like a full disk
        twin::Run(options);
        return 0;
    }
    catch (const twin::NoRun &no_run)
    {
        std::fputs(no_run.text.c_str(), no_run.exit_code == 0 ? stdout : stderr);
        return no_run.exit_code;
    }
    catch (const std::exception &error)
    {
        std::fprintf(stderr, "twin_run: %s\n", error.what());
        return 1;
    }
}
