# SPDX-License-Identifier: Apache-2.0
"""`diagnose`, `explain` and `compare` of a model in MJCF: robots of joints in stock MuJoCo."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from twinmill.files import check_new_file, replacing
from twinmill.joints.compare import JointComparison, compare_joints
from twinmill.joints.diagnose import JointDiagnosis, diagnose_joints
from twinmill.joints.explain import JointExplanation, explain_joints
from twinmill.joints.hook import hook_beside
from twinmill.joints.next import Excitation, next_joints
from twinmill.report import joints as shown
from twinmill.version import __version__
from twinmill_cli.frame import command_line, refuse_report, with_own
from twinmill_cli.output import deliver, say, telling

JOINTED = "jointed robots"


def diagnosed(
    logs: list[Path], model: str, *, own: list[Path], as_json: bool, out: Path | None
) -> JointDiagnosis:
    """Names what an MJCF lacks."""
    refuse_report("diagnose", JOINTED, out)
    with telling(f"diagnosing with {model}") as progress, threadpool_limits(1, "blas"):
        found = diagnose_joints(logs, model, progress, own=own)
    _warn(found.warnings)
    command = command_line(with_own("diagnose", own), logs, model)
    deliver({**found.to_json(), **_source(command)}, shown.diagnosis(found), as_json)
    return found


def explained(
    logs: list[Path],
    model: str,
    output: Path,
    *,
    own: list[Path],
    force: bool,
    as_json: bool,
    out: Path | None,
) -> JointExplanation:
    """Writes an MJCF with what was found, and a hook for what it cannot hold."""
    refuse_report("explain", JOINTED, out)
    hook = hook_beside(output)
    for path in (output, hook):
        check_new_file(path, force, [Path(model), *logs, *own])
    with telling(f"explaining with {model}") as progress, threadpool_limits(1, "blas"):
        found = explain_joints(logs, model, progress, own=own)
    _warn(found.diagnosis.warnings)
    written = {}
    for key, path, text in (("output", output, found.text), ("hook", hook, found.hook)):
        if found.added and text:
            with replacing(path, force) as place:
                place.write_text(text, encoding="utf-8")
            written[key] = str(path)
    if "output" in written and "hook" not in written:
        hook.unlink(missing_ok=True)  # of the model that --force replaced
    command = command_line(with_own("explain", own), logs, model, output)
    data = {**found.to_json(), "output": None, "hook": None, **written, **_source(command)}
    deliver(data, shown.explanation(found, written), as_json)
    return found


def compared(logs: list[Path], model: str, as_json: bool, out: Path | None) -> JointComparison:
    """Errors of an MJCF on a log; a hook that `explain` wrote beside it acts as well."""
    refuse_report("compare", JOINTED, out)
    hook = beside if (beside := hook_beside(model)).is_file() else None
    found = compare_joints(logs, model, hook)
    _warn(found.warnings)
    command = command_line("compare", logs, model)
    data = {**found.to_json(), "hook": str(hook) if hook else None, **_source(command)}
    deliver(data, shown.comparison(found, hook), as_json)
    return found


def designed(
    logs: list[Path],
    model: str,
    output: Path,
    *,
    own: list[Path],
    duration_s: float,
    times_speed: float,
    force: bool,
    as_json: bool,
    out: Path | None,
) -> Excitation:
    """Writes the motion that parts what logs leave open."""
    refuse_report("next", JOINTED, out)
    check_new_file(output, force, [Path(model), *logs, *own])
    with telling(f"designing a run with {model}") as progress, threadpool_limits(1, "blas"):
        found = next_joints(
            *(logs, model),
            own=own,
            duration_s=duration_s,
            times_speed=times_speed,
            progress=progress,
        )
    _warn(found.diagnosis.warnings)
    with replacing(output, force) as place:
        place.write_text(found.text(), encoding="utf-8")
    verb = f"next --duration-s {duration_s:g} --times-speed {times_speed:g}"
    command = command_line(with_own(verb, own), logs, model, output)
    then = command_line(with_own("diagnose", own), [*logs, Path("next.mcap")], model)
    data = {"script": str(output), **found.to_json(), "then": then, **_source(command)}
    deliver(data, shown.excitation(found, output, then), as_json)
    return found


def _warn(warnings: tuple[str, ...]) -> None:
    for warning in warnings:
        say(warning)


def _source(command: str) -> dict[str, Any]:
    return {"command": command, "version": f"twinmill {__version__}"}
