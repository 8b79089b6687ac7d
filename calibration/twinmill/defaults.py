# SPDX-License-Identifier: Apache-2.0
"""Values that the library uses and that the help of its commands states. Imports nothing heavy."""

import math
from enum import StrEnum
from typing import Literal

DEFAULT_MODEL = "turbopi.toml"
FOREVER_S = 1e9  # how long a bus is listened to where nothing else is said

# LCM's default group, one hop far: the robots' bus.
URL = "udpm://239.255.76.67:7667?ttl=1"

ALARM_RATE = 0.05  # of comparisons of runs without a change, and of calibrations

# Chance that a swarm of the model itself is called different from it, both tests together.
FALSE_ALARMS = 0.05

# A search for behaviours: candidates of each emitter in a generation, emitters, and all candidates.
BATCH = 36
EMITTERS = 3
PER_GENERATION = BATCH * EMITTERS

# What a diagnosis says of a model, and of an effect that it names: see docs/inference.md.
Verdict = Literal[
    "model_adequate",
    "refit_enough",
    "effect_missing",
    "ambiguous",
    "outside_catalogue",
    "cannot_tell",
]
Certainty = Literal["sure", "group", "doubtful"]


class Question(StrEnum):
    """Design questions."""

    HOW_MANY = "how-many"
    HOW_FAST = "how-fast"
    HOW_GOOD = "how-good"
    HOW_ALIKE = "how-alike"


class LogFormat(StrEnum):
    """File formats for a log."""

    MCAP = "mcap"
    CSV = "csv"
    PARQUET = "parquet"
    ROSBAG2 = "rosbag2"


class ModelFormat(StrEnum):
    """File formats for a model."""

    MJCF = "mjcf"
    SDF = "sdf"
    URDF = "urdf"
    ROS2_CONTROL = "ros2_control"
    JSON = "json"


def least_seeds() -> int:
    """Fewer runs of the twin cannot tell anything at this rate of false alarms."""
    return math.ceil(2 / FALSE_ALARMS) - 1
