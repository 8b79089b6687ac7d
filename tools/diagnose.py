# SPDX-License-Identifier: Apache-2.0
"""`twinmill diagnose` and `explain`: which physical effect a model lacks."""

from dataclasses import replace

import typer
from twinmill.calibration.diagnosis import present
from twinmill.calibration.diagnosis.diagnose import Diagnosis, diagnose
from twinmill.calibration.diagnosis.explain import Explanation, explain
from twinmill.calibration.measurement import load_measurements
from twinmill.tools.calibrate import (
    DEFAULT_MODEL,
    Force,
    Logs,
    Model,
    NewModel,
    Out,
    check_output,
    command_line,
    finish,
    open_model,
    provenance,
)
from twinmill.tools.output import AsJson, telling

SWARM = (
    "Each robot was judged by itself; what only a swarm shows (collisions, hidden robots, one that "
    "is blind), `twinmill compare-swarm` looks for in the same log."
)


def register(app: typer.Typer) -> None:
    """Adds the commands to the application."""
    app.command("diagnose")(_diagnose)
    app.command("explain")(_explain)


def _diagnose(
    logs: Logs, model: Model = DEFAULT_MODEL, as_json: AsJson = False, out: Out = None
) -> Diagnosis:
    """Name the physical effect that a model lacks, or say that none is or that the log cannot tell.

    Best on a model whose base was fitted to another log of the same robot and clocks: then a lag
    that is new and a delay can be told from what was there before.

    Example: twinmill diagnose run.lcmlog --model fitted.toml
    """
    source = provenance(command_line("diagnose", logs, model), model_file := open_model(model, out))
    with telling(f"diagnosing with {model}") as say:
        measurements = load_measurements(logs)
        result = diagnose(measurements, model_file, say)
    if len({m.label for m in measurements if m.log_name == logs[0].name}) > 1:
        result = replace(result, notes=[*result.notes, SWARM])
    data = result.to_json()
    if data["next_experiment"]:  # the script comes from a command of its own
        data["next_experiment"]["command"] = command_line("next", logs, model)
    finish(data, present.terminal(result), source, present.section(result), as_json, out)
    return result


def _explain(
    logs: Logs,
    output: NewModel,
    model: Model = DEFAULT_MODEL,
    force: Force = False,
    as_json: AsJson = False,
    out: Out = None,
) -> Explanation:
    """Diagnose, add what is found, and write the model that has it; every step on held-out data.

    Example: twinmill explain run.lcmlog --model fitted.toml -o explained.toml
    """
    source = provenance(
        command_line("explain", logs, model, output), model_file := open_model(model, out)
    )
    check_output(output, model_file, force)
    with telling(f"explaining with {model}") as say:
        result = explain(load_measurements(logs), model_file, output, source.command, say)
    section = present.section(result.diagnosis)
    finish(result.to_json(), present.terminal_explanation(result), source, section, as_json, out)
    return result
