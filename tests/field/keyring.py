# SPDX-License-Identifier: Apache-2.0
"""Keys for an operator and the robots of a session."""

from pathlib import Path

from twinmill.robots.key import load_or_make, of_robot


def operator_key(folder: Path) -> tuple[Path, bytes]:
    """A key file, made if there is none, and what is in it."""
    path = folder / "operator.key"
    return path, load_or_make(path)


def robot_options(folder: Path, robot_id: int) -> list[str]:
    """Command line by which a robot's program has its number, its key, and a folder of its own."""
    _, key = operator_key(folder)
    own = folder / f"run{robot_id}"
    own.mkdir(exist_ok=True)
    path = own / "key"
    path.touch(mode=0o600)
    path.write_text(of_robot(key, robot_id).hex() + "\n")
    settings = {"robot_id": robot_id, "key_file": path, "run_dir": own}
    return [word for pair in settings.items() for word in ("--set", "{}={}".format(*pair))]
