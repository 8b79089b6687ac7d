# SPDX-License-Identifier: Apache-2.0
"""Scripts of drives for robots on ROS, as `next` and `characterise` write them."""

from collections.abc import Iterable
from pathlib import Path

from twinmill.export.script import TwistScript, write_bag, write_publisher
from twinmill.files import check_absent, check_new_file, check_new_folder
from twinmill_cli.options import ScriptForm


def ros_path(form: ScriptForm, script: Path) -> Path:
    """Beside the script: `script_bag/`, or `script_publisher.py`."""
    suffix = "" if form is ScriptForm.BAG else ".py"
    return script.with_name(f"{script.stem}_{form}{suffix}")


def check_new_script(
    form: ScriptForm | None, path: Path, force: bool, inputs: Iterable[Path] = ()
) -> None:
    """Raises ValueError if it could not be written, before the long work."""
    if form is not ScriptForm.BAG:
        check_new_file(path, force, inputs)
        return
    check_absent(path, force)
    check_new_folder(path)


def write_script(
    script: TwistScript,
    form: ScriptForm,
    path: Path,
    force: bool,
    *,
    command: str,
    inputs: Iterable[Path] = (),
) -> None:
    """Whole or not at all, and never over the `inputs`."""
    if form is ScriptForm.BAG:
        write_bag(script, path, force)
    else:
        write_publisher(script, path, force, command=command, inputs=inputs)
