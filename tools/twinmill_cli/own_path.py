# SPDX-License-Identifier: Apache-2.0
"""Modules come from the standard library and this installation before any file of the user's.

A random.py or queue.py in the working directory or on PYTHONPATH, as a ROS workspace may have,
would else be taken for a part of this program, and keep even a stop from being said.
"""

import os
import sys  # these two are in the interpreter itself; any other module could be the user's

PROGRAMS = ("twinmill", "twin_run", "twin_sweep")


def is_program() -> bool:
    """This is one of our programs, which has not begun; else who imports us goes on."""
    name = os.path.basename(sys.argv[0] if sys.argv else "")
    return name in (*PROGRAMS, "-m")  # python -m calls itself so until our module is found


def put_first() -> None:
    """Moves entries of `sys.path` before the standard library behind all others."""
    library = os.path.dirname(os.__file__)
    if library not in sys.path:
        return
    begin = sys.path.index(library)
    archive = [path for path in sys.path[:begin] if path.endswith(".zip")]
    users = [path for path in sys.path[:begin] if path not in archive]
    sys.path[:] = [*archive, *sys.path[begin:], *users]
    _replace(_taken_from({os.path.abspath(path) for path in users}))


def _taken_from(folders: set[str]) -> list[str]:
    """Modules under a name of the standard library that were imported from elsewhere."""
    return [
        name
        for name, module in sys.modules.items()
        if name in sys.stdlib_module_names
        and (file := getattr(module, "__file__", None))  # none has what the interpreter brings
        and _folder_of(file) in folders
    ]


def _folder_of(file: str) -> str:
    file = os.path.abspath(file)
    if os.path.basename(file).startswith("__init__."):
        file = os.path.dirname(file)
    return os.path.dirname(file)


def _replace(names: list[str]) -> None:
    """Imports them anew, for the script that starts this program, too: it has imported `re`."""
    script = vars(sys.modules["__main__"])
    for name in names:
        foreign = sys.modules.pop(name)
        for below in [n for n in sys.modules if n.startswith(f"{name}.")]:
            del sys.modules[below]
        if script.get(name) is foreign:
            script[name] = __import__(name)
