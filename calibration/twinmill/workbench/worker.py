# SPDX-License-Identifier: Apache-2.0
"""Long work in a process of its own: fits and diagnoses as the commands do them; can be stopped.

The process keeps the logs that it read. To cancel is to end it; the next work starts another.
"""

import multiprocessing
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from time import monotonic
from typing import Any

from twinmill.arguments import Spelling, spelled, spelling
from twinmill.foreign_text import MESSAGE_MAX, plain_line

PATH_S = 0.1  # between points of a path that is drawn
YIELDS = 2  # niceness: what the user's hands do goes before


@dataclass(frozen=True)
class Work:
    """Task for the worker.

    Attributes:
        kind: read, compare, fit, add, diagnose, next or swarm; most read the logs if that was
            not done.
        model, text: name and text of the model file.
        command: recorded in the file that is made.
        effect: that is added.
        robot_id: of the robot that alone is to have it, or None.
        held: names that a fit leaves alone.
        of: number of the model in the tree.
        words: of the command, without models.
        options: of a next run or a swarm.
        given: text of the model as given, for a swarm beside that of the model.
    """

    kind: str
    model: str
    text: str
    command: str = ""
    effect: str = ""
    held: tuple[str, ...] = ()
    of: int = 0
    words: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    given: str = ""
    robot_id: int | None = None


@dataclass(frozen=True)
class Done:
    """Result of a task: `result` as the command's --json, `text` of the new model; or `failure`."""

    work: Work
    result: Mapping[str, Any]
    text: str = ""
    failure: str = ""


class Worker:
    """Does one work at a time.

    Args:
        logs: what all work is about.
    """

    def __init__(self, logs: list[Path]) -> None:
        self._logs = logs
        self._process: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None
        self.work: Work | None = None
        self.words = ""
        self._since_s = 0.0

    @property
    def busy(self) -> bool:
        """True if there is work under way."""
        return self.work is not None

    @property
    def for_s(self) -> float:
        """How long it has been."""
        return monotonic() - self._since_s if self.busy else 0.0

    def start(self, work: Work) -> None:
        """Begins; what is under way is cancelled."""
        if self.busy:
            self.cancel()
        if self._process is None or not self._process.is_alive():
            context = multiprocessing.get_context("spawn")
            self._pipe, other = context.Pipe()
            self._process = context.Process(
                target=_serve, args=(other, self._logs, spelling()), daemon=True
            )
            self._process.start()
            other.close()
        self.work, self.words, self._since_s = work, "reading the logs", monotonic()
        self._pipe.send(work)

    def poll(self) -> Done | None:
        """Finished task; None while it goes on."""
        if not self.busy:
            return None
        try:
            while self._pipe.poll():
                message = self._pipe.recv()
                if isinstance(message, Done):
                    self.work = None
                    return message
                self.words = message
        except (EOFError, OSError):
            work, self.work = self.work, None
            return Done(work, {}, failure="The work ended without an answer; try again.")
        return None

    def cancel(self) -> None:
        """Ends the process, and what it does."""
        self.work = None
        if self._process is not None:
            self._process.terminate()
            self._process.join()
            self._pipe.close()
            self._process = None


def _serve(pipe: Connection, logs: list[Path], way: Spelling) -> None:
    """Until the other end is closed."""
    import os
    import signal

    os.nice(YIELDS)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the server's
    measurements: dict = {}
    while True:
        try:
            work = pipe.recv()
        except EOFError:
            return
        try:
            with spelled(way):
                pipe.send(perform(work, logs, measurements, pipe.send))
        except BrokenPipeError:  # the server was killed
            return
        except (ValueError, OSError) as error:
            pipe.send(Done(work, {}, failure=plain_line(str(error), MESSAGE_MAX)))


def perform(work: Work, logs: list[Path], known: dict, say: Callable[[str], None]) -> Done:
    """One work, by the same functions as the commands.

    Args:
        work: what is to be done.
        logs: what it is about.
        known: what was read before; filled where that was not done.
        say: told in words what is being done.

    Raises:
        ValueError: it cannot be done, in one sentence.
    """
    if work.kind == "swarm":
        from twinmill.workbench.swarm import phase_diagram, run_swarms

        texts = {"as given": work.given}
        if work.text != work.given:
            texts["now"] = work.text
        swarms = run_swarms(texts, work.options, say)
        return Done(
            work, {"swarms": swarms, "diagram": phase_diagram(work.given, work.options, say)}
        )
    import twinmill_native as native

    from twinmill.data.measurement import load_measurements
    from twinmill.diagnosis.diagnose import diagnose
    from twinmill.experiment.design import check, design
    from twinmill.files import plain
    from twinmill.fitting.add import add_to_model
    from twinmill.fitting.compare import compare
    from twinmill.fitting.fit import Choice, fit_model
    from twinmill.inference.keeping import with_its_error
    from twinmill.model.model_file import ModelFile
    from twinmill.report import judged

    model = native.Model.from_toml(work.text, work.model)
    model_file = ModelFile(Path(work.model), work.text, model)
    if "all" not in known:
        known["all"] = load_measurements(logs, model)
    measurements = known["all"]
    if work.kind == "read":
        return Done(work, {"findings": measurements.findings})
    if work.kind in ("diagnose", "next") and known.get("text") != work.text:
        if work.kind == "next":
            check(measurements, model_file, _limits(work.options))
        known["diagnosis"] = diagnose(measurements, model_file, progress=say)
        known["text"] = work.text
    if work.kind == "diagnose":
        return Done(work, plain(judged.to_json(known["diagnosis"])))
    if work.kind == "next":
        plan = design(known["diagnosis"], model_file, _limits(work.options), say)
        return Done(work, plain(_told(plan)))
    if work.kind == "compare":
        say("comparing")
        return Done(work, plain(compare(measurements, model_file).to_json()))
    path = Path("made.toml")
    say(f"adding {work.effect}" if work.effect else "fitting")
    if work.kind == "add":
        result = add_to_model(
            work.effect,
            measurements,
            model_file,
            path=path,
            command=work.command,
            held=work.held,
            robot_id=work.robot_id,
        )
    else:
        choice = Choice(work.held)
        result = fit_model(measurements, model_file, path, work.command, choice=choice)
    say("what the model misses")
    return Done(work, plain(result.to_json()), with_its_error(result.child, measurements).text)


def _limits(options: Mapping[str, Any]) -> Any:
    from twinmill.experiment.design import Limits

    floor_m = (options["along_m"], options["across_m"])
    return Limits(options["duration_s"], floor_m, options["duty_pct"] / 100)


def _told(plan: Any) -> dict:
    """A planned run as --json tells it, with its script and its way over the floor."""
    import numpy as np

    from twinmill.experiment.played import csv_text

    every = max(1, round(PATH_S / float(np.median(np.diff(plan.pose_t_s)))))
    return {
        **plan.to_json(),
        "script": csv_text(plan.rows),
        "end_s": plan.rows.end_s,
        "floor_m": plan.limits.floor_m,
        "paths": np.round(plan.paths[:, ::every, :2], 3),
        "robot_id": plan.robot_id,
        "drive": plan.rows.kind,
        "cap_pct": round(100 * float(np.abs(plan.rows.command).max())),
    }
