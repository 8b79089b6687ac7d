# SPDX-License-Identifier: Apache-2.0
"""Columns of other people's files, before it is known what of the model they belong to."""

from dataclasses import dataclass, field

import numpy as np

from twinmill.joints.files import COMMAND, POSITION, VELOCITY

KINDS = (POSITION, VELOCITY, COMMAND)
TOLD_POSITION, TOLD_VELOCITY, TOLD_FORCE = "position", "velocity", "effort"  # fields of JointState


@dataclass(frozen=True)
class Signal:
    """One column of numbers with its stamps.

    Attributes:
        source: how messages call it: a column, or a topic and a joint.
        kind: one of KINDS; empty where the name has to tell.
        name: of a joint or an actuator, as the file has it; empty where only its place tells.
        t_s, values: (N,), in the units of the file.
        says: field of a JointState that holds a command; empty elsewhere.
    """

    source: str
    kind: str
    name: str
    t_s: np.ndarray = field(repr=False)
    values: np.ndarray = field(repr=False)
    says: str = ""


@dataclass(frozen=True)
class Recording:
    """Signals of one run, and what is to be told of how they were read.

    Attributes:
        name: of the file.
        signals: of it.
        notes: sentences.
    """

    name: str
    signals: list[Signal]
    notes: tuple[str, ...] = ()
