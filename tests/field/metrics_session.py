# SPDX-License-Identifier: Apache-2.0
"""A swarm of robots and one of twins on one bus, measured while they drive.

Usage: metrics_session.py FOLDER, as root of a network namespace. Leaves in FOLDER what each swarm
logged itself. Prints what `twinmill swarm metrics --live` said of them, one prefix and an empty
bus, as JSON.
"""

import json
import signal
import subprocess
import sys
from itertools import islice
from pathlib import Path

from watch_session import URL, drive

from twinmill.data.multi_log import TWIN

LOOKS = 13  # one a second: the last has more than ten seconds behind it
EMPTY_URL = "udpm://239.255.76.68:7668?ttl=0"
START = "from twinmill_cli.main import main; main()"


def metrics(*words: str) -> subprocess.Popen:
    """The command on a bus."""
    command = [sys.executable, "-c", START, "metrics", "--live", *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def finish(process: subprocess.Popen, begun: list[str] = ()) -> dict:
    """Presses Ctrl-C where it would go on for ever, and takes all that it printed."""
    if begun:
        process.send_signal(signal.SIGINT)
    rest, _ = process.communicate(timeout=30)
    return {"lines": [*begun, *rest.splitlines()], "code": process.returncode}


def main(folder: Path) -> dict:
    empty = metrics("--lcm-url", EMPTY_URL, "--duration-s", "5", "--json")
    with drive(folder / "robots", "", 1, 5) as robots, drive(folder / "twins", TWIN, 2, 4) as twins:
        try:
            both = metrics("--lcm-url", URL, "--json")
            one = metrics("--lcm-url", URL, "--channel-prefix", TWIN, "--duration-s", "3")
            result = {"both": finish(both, list(islice(both.stdout, LOOKS)))}
            result |= {"one": finish(one), "empty": finish(empty)}
        finally:
            for driver in (robots, twins):
                driver.send_signal(signal.SIGINT)
    return result


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]))))
