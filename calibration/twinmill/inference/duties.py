# SPDX-License-Identifier: Apache-2.0
"""The curve from duty to speed between the nodes of a model's table: known only to its bend.

A table is linear between its nodes; a motor is not. Nodes are put in the middle of each stretch.
Their speeds are those of the straight line, give or take what a line misses of a curve of the
table's own second derivative, h^2/8 |v''| (linear interpolation; Stoer and Bulirsch 2002, ch. 2.1).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import tomlkit
import twinmill_native as native

from twinmill.model.model_file import ModelFile

TABLE = "base.wheel_speed_mps."


@dataclass(frozen=True)
class Refined:
    """A model with a node in the middle of each stretch of its table.

    Attributes:
        model: the same motion.
        weights: (2 n, n) speeds of its nodes from 1 up, of those of the table's n from 1 up.
        std_mps: (2 n,) by which these may be off; 0 at the table's nodes.
    """

    model: native.Model
    weights: np.ndarray
    std_mps: np.ndarray


@lru_cache(maxsize=1)  # a problem asks twice, and its own log's again
def refined(model_file: ModelFile) -> Refined:
    """The model of a file with the nodes in between; of a robot that is told duties."""
    document = tomlkit.parse(model_file.text)
    base = document["base"]
    model = model_file.model
    duty = np.array(base["duty_pct"].unwrap(), float)
    count = len(duty) - 1
    speed = np.r_[0.0, [model.get(f"{TABLE}{k + 1}") for k in range(count)]]
    middle = (duty[1:] + duty[:-1]) / 2
    every = np.sort(np.r_[duty, middle])
    weights = np.array([np.interp(every[1:], duty, column) for column in np.eye(count + 1)[1:]]).T
    base["duty_pct"] = every.tolist()
    base["wheel_speed_mps"] = np.interp(every, duty, speed).tolist()
    std = np.zeros(2 * count)
    std[::2] = _missed_mps(duty, speed)
    fine = native.Model.from_toml(tomlkit.dumps(document), str(model_file.path))
    return Refined(fine, weights, std)


def _missed_mps(duty: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """(n,) what a straight line misses in the middle of each stretch.

    The curve is odd, so that its second derivative at zero is zero; beyond the last node it is as
    at the node before.
    """
    slope = np.diff(speed) / np.diff(duty)
    bend = np.r_[0.0, 2 * np.diff(slope) / (duty[2:] - duty[:-2])]
    bend = np.abs(np.r_[bend, bend[-1:]])
    return np.diff(duty) ** 2 / 8 * np.maximum(bend[1:], bend[:-1])
