# SPDX-License-Identifier: Apache-2.0
"""A model for other simulators, and ranges of its numbers; what the files cannot carry is named."""

import json
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import twinmill_native as native

from twinmill.defaults import ModelFormat
from twinmill.export.carried import Left, RobotModel
from twinmill.export.mjcf import mjcf
from twinmill.export.model_json import model_json
from twinmill.export.ranges import as_json as ranges_json
from twinmill.export.ranges import as_npz, as_yaml
from twinmill.export.ros2_control import ros2_control
from twinmill.export.sdf import sdf
from twinmill.export.urdf import urdf
from twinmill.files import check_new_file, plain, replacing
from twinmill.model.ranges import Ranges, ranges

ENDINGS = {ModelFormat.MJCF: ".xml", ModelFormat.ROS2_CONTROL: "_control.yaml"}
WRITERS: dict[ModelFormat, Callable[[RobotModel], tuple[str, list[Left]]]] = {
    ModelFormat.MJCF: mjcf,
    ModelFormat.SDF: sdf,
    ModelFormat.URDF: urdf,
    ModelFormat.ROS2_CONTROL: ros2_control,
    ModelFormat.JSON: lambda robot: (json.dumps(plain(model_json(robot)), indent=1) + "\n", []),
}


@dataclass(frozen=True)
class ExportedModel:
    """Files written for a model.

    Attributes:
        files: all of them.
        left: what the file of the model cannot carry.
        warnings: on samples of ranges.
    """

    files: list[Path]
    left: list[Left]
    warnings: list[str]

    def to_json(self) -> dict:
        """The interface's object."""
        return {
            "files": [str(path) for path in self.files],
            "warnings": self.warnings,
            "not_carried": [item.to_json() for item in self.left],
        }


def default_name(name: str, to: ModelFormat) -> Path:
    """Where a model is written to if nothing is said: its name, in this folder.

    With the format before the ending where that would hide an installed file from `twin_run`.
    """
    stem, ending = Path(name).stem, ENDINGS.get(to, f".{to}")
    hides = native.find_installed_model_file(f"{stem}{ending}") is not None
    return Path(f"{stem}_{to}{ending}" if hides else f"{stem}{ending}")


def export_model(
    robot: RobotModel,
    to: ModelFormat | None,
    out: Path,
    *,
    ranges_stem: Path | None = None,
    samples: int = 100,
    seed: int = 1,
    force: bool = False,
) -> ExportedModel:
    """Writes all files, or none is new.

    Args:
        robot: the model.
        to: what is written; None: ranges alone.
        out: the new file.
        ranges_stem: intervals and samples go to this name with `_ranges.yaml`, `_ranges.json` and
            `_ranges.npz`; None: no such files.
        samples: how many.
        seed: of the samples.
        force: replace what is there.

    Raises:
        ValueError: a file is there, cannot be written, or cannot carry this robot at all.
    """
    texts: dict[Path, str | bytes] = {}
    left: list[Left] = []
    warnings: list[str] = []
    if to is not None:
        texts[out], left = WRITERS[to](robot)
    if ranges_stem:
        found = ranges(robot.file, robot.model, samples, seed)
        texts |= _range_files(robot, found, ranges_stem)
        warnings = _truncated(found)
    for path in texts:
        check_new_file(path, force, [robot.file.path])
    with ExitStack() as stack:
        for path, text in texts.items():
            temporary = stack.enter_context(replacing(path, force))
            temporary.write_bytes(text.encode() if isinstance(text, str) else text)
    return ExportedModel(list(texts), left, warnings)


def _range_files(robot: RobotModel, found: Ranges, beside: Path) -> dict[Path, str | bytes]:
    """The three files by path."""
    data = {"model": robot.name, "model_sha256": robot.file.hash, **plain(found.to_json())}
    contents = {"yaml": as_yaml(data), "json": ranges_json(data), "npz": as_npz(found)}
    return {
        beside.with_name(f"{beside.name}_ranges.{suffix}"): content
        for suffix, content in contents.items()
    }


def _truncated(found: Ranges) -> list[str]:
    """A sentence for each quantity whose samples are no whole normal."""
    names = [q.name for q in found.quantities]
    told = []
    for q in found.truncated:
        drawn = found.samples[:, names.index(q.name)]
        told.append(
            f"{q.name} = {q.value:g} ± {q.std:g} is truncated: {100 * q.outside:.2g} % of its "
            f"normal lie outside {q.min:g} to {q.max:g}. The samples have mean {drawn.mean():.3g} "
            f"and std {drawn.std():.3g}, and what is correlated with it shifts, too."
        )
    return told
