# SPDX-License-Identifier: Apache-2.0
"""Robots and twins drive on one bus, and are watched while they do.

Usage: watch_session.py FOLDER, as root of a network namespace. Leaves in FOLDER what robots and
twins logged themselves, what `from_bus` heard (heard), and, where the viewer is installed, what
`twinmill swarm watch` showed (shown.rrd). Prints what `twinmill swarm watch` said, as JSON.
"""

import json
import os
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import lcm

from twinmill.data.multi_log import TWIN, multi_log_of
from twinmill.data.stream import Window, from_bus

URL = "udpm://239.255.76.67:7667?ttl=0"
LISTEN_S = 4.0


def drive(log: Path, prefix: str, seed: int, n: int = 2) -> subprocess.Popen:
    """Some robots, or twins, in real time until they are told to stop."""
    words = f"--plant planar --n {n} --spread-m 0.8 --seed {seed} --lcm-url {URL} --log {log}"
    prefix_words = ["--channel-prefix", prefix] if prefix else []
    return subprocess.Popen(
        [os.environ["TWIN_RUN"], *words.split(), *prefix_words], stdout=subprocess.DEVNULL
    )


def listen(heard: Path) -> list[str]:
    """Writes down what the source of `twinmill swarm watch` gives; who could be shown of it."""
    window, log = Window(LISTEN_S), lcm.EventLog(str(heard), "w")
    for now_us, batch in from_bus(URL, LISTEN_S):
        window.add(now_us, batch)
        for channel, payloads in batch.by_channel.items():
            for payload in payloads:
                log.write_event(now_us, channel, payload)
    log.close()
    return [recorded.name for recorded in multi_log_of(window.events(), heard).robots]


def watch(save: Path) -> dict:
    """Output of the command for a few seconds of the bus."""
    words = ["watch", "--lcm-url", URL, "--duration-s", str(LISTEN_S), "--save", save, "--json"]
    start = "from twinmill_cli.main import run; import sys; run(sys.argv[1:])"
    done = subprocess.run(
        [sys.executable, "-c", start, *map(str, words)],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def main(folder: Path) -> dict:
    with drive(folder / "robots", "", 1) as robots, drive(folder / "twins", TWIN, 2) as twins:
        try:
            result = {"robots": listen(folder / "heard")}
            if find_spec("rerun"):
                result["said"] = watch(folder / "shown.rrd")
        finally:
            for driver in (robots, twins):
                driver.send_signal(signal.SIGINT)
    if robots.returncode or twins.returncode:
        raise RuntimeError("twin_run failed")
    return result


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]))))
