# SPDX-License-Identifier: Apache-2.0
"""Colours that stand beside each other stay apart for all eyes.

What the colour-blind see is simulated after Machado, Oliveira and Fernandes (2009), distances are
those of CAM02-UCS (Luo, Cui and Li 2006), both by colorspacious. One is just seen.
"""

import re
from itertools import combinations

import numpy as np
import pytest
from colorspacious import cspace_convert, deltaE

from twinmill.charts.packed import COLORS as ROBOTS
from twinmill.charts.stage import STATIC
from twinmill.swarm.classes import COLORS as CLASSES
from twinmill.threshold.show import FALSE, HIT, MISS
from twinmill.workbench.fails_panel import TONES

APART = 10.0
LOOK = (STATIC / "look.js").read_text()
NAMED = dict(re.findall(r'const (\w+) = "(#\w{6})"', LOOK))
TOGETHER = {
    "robots": ROBOTS,
    "floor": [NAMED[name] for name in ("MEASURED", "PREDICTED", "BEFORE", "FLOOR", "MARK")],
    "wheels": re.findall(r"#\w{6}", re.search(r"WHEELS = (.*);", LOOK)[1]),
    "regimes": TONES,
    "phases": [*CLASSES.values()],
    "threshold": ["#" + bytes(color).hex() for color in (HIT, MISS, FALSE)],
}


def rgb(color: str) -> np.ndarray:
    return np.array([int(color[k : k + 2], 16) / 255 for k in (1, 3, 5)])


def seen(color: np.ndarray, eyes: str) -> np.ndarray:
    if eyes == "common":
        return color
    space = {"name": "sRGB1+CVD", "cvd_type": eyes, "severity": 100}
    return np.clip(cspace_convert(color, space, "sRGB1"), 0, 1)


@pytest.mark.parametrize("eyes", ["common", "deuteranomaly", "protanomaly", "tritanomaly"])
@pytest.mark.parametrize("place", TOGETHER)
def test_colours_side_by_side_stay_apart(place, eyes):
    for one, other in combinations(TOGETHER[place], 2):
        apart = deltaE(seen(rgb(one), eyes), seen(rgb(other), eyes), input_space="sRGB1")
        assert apart > APART, f"{one} and {other}"
