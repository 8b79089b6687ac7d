# SPDX-License-Identifier: Apache-2.0
"""Series for the browser, as bytes: facts as JSON, then arrays of 32-bit numbers."""

import json
import struct
from collections.abc import Mapping

import numpy as np
import twinmill_native as native

from twinmill.charts.arrays import Arrays, RobotView, commands, expected, seen
from twinmill.data.camera_frames import Frames
from twinmill.data.log import RobotLog
from twinmill.data.track import Track
from twinmill.model.parameters import CLOCK
from twinmill.predict.detections import Detections

COMMAND_WORDS = {
    "duty": (("FL", "FR", "RL", "RR"), "%"),
    "wheel_speed": (("FL", "FR", "RL", "RR"), "rad/s"),
    "twist": (("vx", "vy", "turn"), "m/s, rad/s"),
}
# Of Okabe and Ito (2008), the last of Tol (2021): told apart by colour-blind readers.
COLORS = ("#0072b2", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#882255")


def pack(arrays: Mapping[str, np.ndarray], **facts: object) -> bytes:
    """Facts as JSON and arrays behind it.

    Layout: uint32 length of the JSON, the JSON padded to 4 bytes, then each array as float32. The
    JSON's `arrays` has the shape of each, in their order.
    """
    flat = {name: np.ascontiguousarray(a, "<f4") for name, a in arrays.items()}
    head = json.dumps({**facts, "arrays": {name: a.shape for name, a in flat.items()}}).encode()
    head += b" " * (-len(head) % 4)
    return struct.pack("<I", len(head)) + head + b"".join(a.tobytes() for a in flat.values())


def pack_log(
    log_name: str, paths: Mapping[int, Arrays], headings: Mapping[int, bool], radius_m: float
) -> bytes:
    """All robots of one log, by their numbers: their paths, and whether headings were recorded."""
    robots = [
        {
            "name": f"R{number:02d}",
            "label": f"{log_name} R{number:02d}",
            "color": COLORS[k % len(COLORS)],
            "heading": headings[number],
            "radius_m": radius_m,
        }
        for k, number in enumerate(paths)
    ]
    arrays = {f"path{k}": made["path"] for k, made in enumerate(paths.values())}
    ends = [float(a[-1, 0]) for a in arrays.values() if len(a)]
    return pack(arrays, robots=robots, end_s=max(ends, default=1.0))


def pack_robot(
    view: RobotView, driven: RobotLog | Track, frames: Frames | None, model: native.Model
) -> bytes:
    """Speeds, commands, sight and band of one robot."""
    names, unit = COMMAND_WORDS.get(driven.command_kind, ((), ""))
    arrays = {**view.measured(), **commands(driven), **seen(frames)}
    detection = model.detection_model()
    cone = {key: detection[key] for key in ("range_m", "cone_rad", "pan_rad")}
    return pack(arrays, command_names=names, command_unit=unit, cone=cone)


def pack_prediction(
    view: RobotView,
    model: native.Model,
    beside: tuple[str, native.Model] | None,
    detections: Detections | None,
    *,
    every: int = 1,
    **facts: object,
) -> bytes:
    """Predictions of one robot, and those of another model with its label.

    `detections`: of its camera, if it has one and others are near; `every`: as of
    `RobotView.predicted`.
    """
    arrays = view.predicted(model, every) | (expected(detections, model) if detections else {})
    if beside:
        others = view.predicted(beside[1], every)
        arrays |= {f"{name}_beside": a for name, a in others.items() if name != "starts"}
    label = beside[0] if beside else ""
    clock_s = model.get(CLOCK)
    return pack(arrays, beside=label, step_s=view.step_s, clock_s=clock_s, **facts)
