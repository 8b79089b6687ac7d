# SPDX-License-Identifier: Apache-2.0
"""Logs for the commands that judge a model: what is wrong with them is said, here and in JSON."""

from __future__ import annotations

from pathlib import Path

import typer

from twinmill_cli.lazy import working
from twinmill_cli.output import deliver

if working():  # not for --help
    from twinmill.data.measurement import BadInputError, Measurements, load_measurements
    from twinmill.model.model_file import ModelFile


def load(logs: list[Path], model_file: ModelFile, as_json: bool) -> Measurements:
    """Reads logs and says on stderr what is wrong with them.

    Raises:
        BadInputError: nothing is left to judge; with --json the verdict is printed first.
        LogError: nothing could be read.
    """
    try:
        measurements = load_measurements(logs, model_file.model)
    except BadInputError as error:
        if as_json:
            found = [finding.to_json() for finding in error.findings]
            deliver({"verdict": "bad_input", "input": found}, "", as_json)
        raise
    mild = [str(finding) for finding in measurements.findings if not finding.fatal]
    for sentence in [*measurements.excluded, *mild]:
        typer.echo(f"twinmill: {sentence}", err=True)
    return measurements


def told(measurements: Measurements) -> dict:
    """What JSON output carries of it."""
    return {"input": [finding.to_json() for finding in measurements.findings]}
