# SPDX-License-Identifier: Apache-2.0
"""A mill of robots that see two bits, as `twinmill lab discover` found, told nothing of mills."""

import json
import subprocess
import sys
from pathlib import Path

import twinmill_native as native

TWINMILL = Path(sys.executable).with_name("twinmill")
# Ideal TurboPis, so that robots told duties do what the search saw; the halves of the picture.
BITS = ("left", "right")
ROBOTS = 5
# A short search that finds one that holds: few of other seeds do.
SEARCH = ("--seeds", "3", "--duration-s", "40", "--generations", "5", "--seed", "3")
BRIEFLY = ("--n", str(ROBOTS), *SEARCH, "--confirm", "12", "--show", "1", "--mujoco", "0")


def find_mill(folder: Path) -> tuple[Path, str]:
    """Searches. Returns what `twin_run` and `flash` need: DIR with behaviors.toml, and a name."""
    ideal = Path(native.find_model_file("turbopi_nominal.toml")).read_text()
    model, found = folder / "two_bits.toml", folder / "found"
    model.write_text(ideal.replace("[sensor]", f"[sensor]\nbits = {json.dumps(BITS)}"))
    words = ("discover", "--model", model, *BRIEFLY, "--out", found, "--json")
    done = subprocess.run([TWINMILL, *words], capture_output=True, text=True, check=True)
    mills = [
        entry["name"]
        for entry in json.loads(done.stdout)["entries"]
        if entry["offered"] and entry["kind"] == "milling" and not entry["odd_count"]
    ]
    return found, mills[0]


def swarm_words(found: Path, name: str, behaviors: Path) -> tuple[str, ...]:
    """For `twin_run`: all robots play the table, and no cone errs."""
    return (
        *("--plant", "planar", "--sensor", "cone", "--start", "square", "--n", str(ROBOTS)),
        *("--model", str(found / "model.toml"), "--behaviors", str(behaviors), "--behavior", name),
    )


def metrics_of(log: Path, found: Path) -> dict:
    """Output of `twinmill swarm metrics` for a log."""
    words = ("metrics", log, "--model", found / "model.toml", "--json")
    done = subprocess.run([TWINMILL, *words], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)
