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

from twinmill.model.child_file import write_nodes
from twinmill.model.model_file import ModelFile

TABLE = "base.wheel_speed_mps."


@dataclass(frozen=True)
class Refined:
    """A model with a node in the middle of each stretch of its table.

    Attributes:
        model: the same motion.
        weights: (2 n, n) speeds of its nodes from 1 up, of those of the table's n from 1 up.
        std_mps: (2 n,) by which these may be off; 0 at the table's nodes.
        speed_mps: (n,) of the table's nodes from 1 up.
        duty_pct: (2 n + 1,) of all nodes.
    """

    model: native.Model
    weights: np.ndarray
    std_mps: np.ndarray
    speed_mps: np.ndarray
    duty_pct: tuple[float, ...]


@lru_cache(maxsize=1)  # a problem asks twice, and its own log's again
def refined(model_file: ModelFile) -> Refined:
    """The model of a file with the nodes in between; of a robot that is told duties."""
    document = tomlkit.parse(model_file.text)
    model = model_file.model
    duty = np.array(document["base"]["duty_pct"].unwrap(), float)
    count = len(duty) - 1
    speed = np.r_[0.0, [model.get(f"{TABLE}{k + 1}") for k in range(count)]]
    middle = (duty[1:] + duty[:-1]) / 2
    every = np.sort(np.r_[duty, middle])
    weights = np.array([np.interp(every[1:], duty, column) for column in np.eye(count + 1)[1:]]).T
    write_nodes(document, every.tolist())
    std = np.zeros(2 * count)
    std[::2] = _missed_mps(duty, speed)
    fine = native.Model.from_toml(tomlkit.dumps(document), str(model_file.path))
    return Refined(fine, weights, std, speed[1:], tuple(every.tolist()))


def written_on(model_file: ModelFile, curved: bool) -> native.Model:
    """The model of a file, if its table is `curved` with twice as many nodes."""
    return refined(model_file).model if curved else model_file.model


def off_by(model_file: ModelFile, share: float, *, scale: bool) -> np.ndarray:
    """(2 n, n) root of the covariance by which the refined table's speeds are off.

    Those between nodes follow these.

    Args:
        model_file: with a table of n speeds above 0.
        share: relative error of each.
        scale: a factor of all of them is their own error, and not that of a gain.
    """
    weights = refined(model_file).weights
    speed, count = refined(model_file).speed_mps, weights.shape[1]
    each = np.eye(count) if scale else np.eye(count) - 1 / count
    return share * weights @ (speed[:, None] * each)


def _missed_mps(duty: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """(n,) what a straight line misses in the middle of each stretch.

    The curve is odd, so that its second derivative at zero is zero; beyond the last node it is as
    at the node before.
    """
    slope = np.diff(speed) / np.diff(duty)
    bend = np.r_[0.0, 2 * np.diff(slope) / (duty[2:] - duty[:-2])]
    bend = np.abs(np.r_[bend, bend[-1:]])
    return np.diff(duty) ** 2 / 8 * np.maximum(bend[1:], bend[:-1])
