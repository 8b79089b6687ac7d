# SPDX-License-Identifier: Apache-2.0
"""`twinmill robot characterise`: drives one robot by a script, open loop, and logs it."""

from __future__ import annotations

import shlex
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from twinmill.counted import counted
from twinmill.defaults import DEFAULT_MODEL, URL
from twinmill_cli.done import decide
from twinmill_cli.lazy import working
from twinmill_cli.options import (
    Arm,
    KeyFile,
    LcmUrl,
    Model,
    Prefix,
    ScriptAs,
    ScriptForm,
    SshConfig,
)
from twinmill_cli.output import AsJson, deliver, say

if working():  # not for --help
    import numpy as np
    import turbopi

    from twinmill.data.log import LogError
    from twinmill.data.measurement_table import read_header, read_table
    from twinmill.data.recorder import Recorder
    from twinmill.experiment.played import Rows
    from twinmill.export.script import TwistScript
    from twinmill.files import check_new_file
    from twinmill.model.mixing import duties_from_inputs
    from twinmill.model.model_file import ModelFile
    from twinmill.robots import tell
    from twinmill.robots.fleet import RUN_PERIOD_S, Fleet
    from twinmill.robots.hold import SCRIPT_OVER, Held
    from twinmill.robots.key import of_operator
    from twinmill.robots.remote import Remote
    from twinmill.terminal import progress_bar
    from twinmill_cli.ctrl_c import kept_free
    from twinmill_cli.keyboard import any_key
    from twinmill_cli.ros_script import write_script
    from twinmill_cli.swarm_door import check_clocks, refuse_doubles
    from twinmill_cli.swarm_signals import ended_by_signals
    from twinmill_cli.swarm_verdict import Saying, of_busy, of_stop
    from twinmill_cli.voice import Voice

LOST_S = 0.5  # without telemetry, or without a valid pose: stop
AFTER_S = 1.0  # logged after the end: the robot still rolls
INPUTS = ("speed_input", "turn_input")
DUTIES = ("fl_pct", "fr_pct", "rl_pct", "rr_pct")
TWIST = ("vx_mps", "vy_mps", "omega_radps")


class Abort(Exception):
    """Why the robot must stop now, as the end of a sentence."""


def register(app: typer.Typer) -> None:
    """Adds the command to the application."""
    app.command("characterise")(_characterise)


def _characterise(
    robot: Annotated[int, typer.Option("--robot", min=0, max=99, help="Its number.")],
    script: Annotated[
        str,
        typer.Option("--script", metavar="CSV", help="Input script, or its name there."),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="LOG", help="The log to write; with --script-as, that file."
        ),
    ],
    *,
    host: Annotated[
        str, typer.Option("--host", help="Copy the script there first, by ssh: pi@robot03.local.")
    ] = "",
    cap_pct: Annotated[
        int, typer.Option("--cap-pct", min=1, max=100, help="Refuse scripts with larger duties.")
    ] = 60,
    countdown_s: Annotated[float, typer.Option("--countdown-s", min=1, max=60)] = 3.0,
    ssh_config: SshConfig = None,
    arm: Arm = False,
    key: KeyFile = None,
    lcm_url: LcmUrl = URL,
    channel_prefix: Prefix = "",
    script_as: ScriptAs = None,
    model: Model = DEFAULT_MODEL,
    force: Annotated[bool, typer.Option("--force", help="Replace LOG if it exists.")] = False,
    as_json: AsJson = False,
) -> int:
    """Play an input script on one robot's wheels, and log its telemetry and poses.

    Any key, Ctrl-C, lost telemetry or lost poses stop the robot; what was
    logged until then is kept. Without --host, the script must lie on the robot
    (/etc/turbopi/scripts) or in twin_run's --script-dir under the same name.

    With --script-as nothing is driven: the script is written for ROS, its
    duties as the velocities that the model reaches at them. A script of
    vx_mps, vy_mps, omega_radps is written as it is.

    Example: twinmill robot characterise --robot 3 --script steps.csv --out run.lcmlog
    """
    if script_as:
        return _for_ros(
            script=Path(script),
            form=script_as,
            out=out,
            model=model,
            cap_pct=cap_pct,
            force=force,
            as_json=as_json,
        )
    check_new_file(out, force, [Path(script)])
    end_s = check_script(Path(script), cap_pct)
    name = Path(script).name
    if host:
        copy_script(Remote(host, ssh_config), Path(script), name)
    fleet, voice = Fleet(lcm_url, channel_prefix, key=of_operator(key, say)), Voice()
    try:
        with Recorder(out, force) as recorder, any_key() as pressed:
            run = Run(fleet, recorder, robot, channel_prefix, voice, arm)
            why = run.drive(name, end_s, countdown_s, pressed)
    finally:
        voice.end(1)
    if recorder.failed and not why:
        why = f"played to its end, but the end of the log is lost: {recorder.failed}"
    ended = why or "played to its end"
    decide(1 if why else 0)
    data = {"log": str(out), "events": recorder.events, "ok": not why, "ended": ended}
    deliver(data, f"{ended}\n{out}: {counted(recorder.events, 'message')}", as_json)
    return 1 if why else 0


def _for_ros(
    script: Path,
    form: ScriptForm,
    out: Path,
    model: str,
    *,
    cap_pct: int,
    force: bool,
    as_json: bool,
) -> int:
    """Writes the script as a bag or a publisher."""
    if not script.exists():
        raise ValueError(f"{script}: no such script here; --script-as needs the file itself.")
    if set(TWIST) <= set(read_header(script)):
        t_s, twist = _read_velocities(script)
        twists, end_s = TwistScript(t_s, twist, float(t_s[-1])), float(t_s[-1])
    else:
        check_script(script, cap_pct)
        t_s, duties_pct = read_script(script)
        end_s = float(t_s[-1])
        twists = TwistScript.of(ModelFile.load(model).model, Rows(t_s, duties_pct / 100, end_s))
    words = ["twinmill", "robot", "characterise", "--script", str(script), "--script-as", form]
    command = shlex.join([*words, "--model", model])
    write_script(twists, form, out, force, command=command, inputs=[script])
    deliver({"script_as": str(out), "duration_s": end_s}, f"Written: {out}", as_json)
    return 0


def _read_velocities(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(K,) times in s and (K, 3) velocities of a script that ends at rest.

    Raises:
        ValueError: it is no such script.
    """
    try:
        table = read_table(path, frozenset({"t_s", *TWIST}), can_rename=False)
        t_s = table.finite("t_s")
        twist = np.column_stack([table.finite(name) for name in TWIST])
    except LogError as error:
        raise ValueError(str(error)) from error
    if t_s[0] < 0 or (np.diff(t_s) <= 0).any() or twist[-1].any() or len(t_s) < 2:
        raise ValueError(
            f"{path}: must have rows whose t_s ascend from 0 on, and end with a row of zeros, "
            "which stops the robot."
        )
    return t_s, twist


def read_script(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(K,) times in s and (K, 4) duties in percent of a script.

    Raises:
        ValueError: it is no script.
    """
    try:
        table = read_table(path, frozenset({"t_s", *INPUTS, *DUTIES}), can_rename=False)
        columns = INPUTS if table.has(INPUTS[0]) else DUTIES
        t_s, values = table.finite("t_s"), [table.finite(name) for name in columns]
    except LogError as error:
        raise ValueError(str(error)) from error
    rows = list(zip(*values, strict=True))
    duties = [duties_from_inputs(*row) for row in rows] if columns == INPUTS else rows
    return t_s, np.array(duties, float)


def check_script(path: Path, cap_pct: int) -> float | None:
    """How long a script takes, or None if it is not here but on the robot.

    Raises:
        ValueError: it is no script, or drives faster than the cap.
    """
    if not path.exists():
        if path.name != str(path):
            raise ValueError(f"{path}: no such script; a name without folder is one on the robot.")
        return None
    t_s, duties_pct = read_script(path)
    for at_s, row in zip(t_s, duties_pct, strict=True):
        if max(map(abs, row)) > cap_pct:
            raise ValueError(
                f"{path}: a wheel's duty is {max(map(abs, row)):g} % at {at_s:g} s, above the cap "
                f"of {cap_pct} %; if there is room for it, raise --cap-pct."
            )
    return float(t_s[-1])


def copy_script(remote: Remote, path: Path, name: str) -> None:
    """Puts a script where the robot's program looks for it."""
    if not path.exists():
        raise ValueError(f"{path}: no such script to copy.")
    upload = remote.run("upload")["upload"]
    remote.copy(path, upload)
    remote.run("script", name, upload)


@dataclass
class Run:
    """One robot that plays a script while all it says is logged."""

    fleet: Fleet
    recorder: Recorder
    robot_id: int
    channel_prefix: str
    voice: Voice
    arm: bool = False  # though it was stopped
    pose_s: float = -1e9  # when a valid one came last, by time.monotonic()

    def drive(
        self,
        script: str,
        end_s: float | None,
        countdown_s: float,
        pressed: Callable[[], bool],
    ) -> str:
        """Plays the script and stops the robot, whatever happens.

        Returns:
            Why it was cut short; empty if it was not.

        Raises:
            ValueError: the robot is not there, drives already, or refuses.
        """
        self._listen()
        tell.find(self.fleet, {self.robot_id})
        self._check_ready("" if end_s is not None else script)
        check_clocks(self.fleet, {self.robot_id}, countdown_s, may_differ=True)
        refuse_doubles(self.fleet, {self.robot_id})
        if busy := tell.find_busy(self.fleet, {self.robot_id}):
            raise ValueError(
                f"{of_busy(busy)}; it is left alone. Stop it first (twinmill swarm stop), then do "
                "this again with --arm."
            )
        if self.arm:
            tell.arm(self.fleet, {self.robot_id})
        with ended_by_signals(self.fleet, self.voice.check), kept_free(self.fleet):
            try:
                with self._watched("starts; any key stops", countdown_s, pressed):
                    held = self._start(script, countdown_s)
                with self._watched("plays; any key stops", end_s, pressed):
                    self._play(held, end_s)
                why = ""
            except Abort as abort:
                why = f"stopped: {abort}"
            except KeyboardInterrupt:
                why = "stopped: Ctrl-C, or another signal"
            finally:
                given = tell.stop(self.fleet, {self.robot_id})
                with self.fleet.unwatched():
                    self.fleet.listen(AFTER_S)
        stopped = of_stop(given, Saying(reach=self.fleet.reach))
        return why if stopped.ok else "; ".join(filter(None, [why, stopped.sentence]))

    def _listen(self) -> None:
        prefix = f"{self.channel_prefix}R{self.robot_id:02d}_"

        def on_message(channel: str, data: bytes) -> None:
            self.recorder.add(channel, data)
            with suppress(ValueError, struct.error):  # half a message, or another program's
                if channel == f"{prefix}POSE" and turbopi.pose_t.decode(data).valid:
                    self.pose_s = time.monotonic()

        self.fleet.bus.subscribe(prefix + ".*", on_message)

    def _check_ready(self, elsewhere: str) -> None:
        """Raises ValueError if it is not there or not seen.

        Args:
            elsewhere: a script that is not here; empty: it is.
        """
        if self.robot_id not in self.fleet.here():
            raise ValueError(
                f"robot {self.robot_id} is not heard; `twinmill swarm status` shows who is."
            )
        self.fleet.listen(1.0, lambda: self.pose_s > 0)
        if self.pose_s < 0:
            script = (
                f"{elsewhere}: no such script here, so the robot has to have it (--host copies "
            )
            script = f"{script}one there); besides, " if elsewhere else ""
            raise ValueError(
                f"{script}no pose of robot {self.robot_id} is heard; does motion capture publish "
                f"R{self.robot_id:02d}_POSE, and does it see the robot?"
            )
        # So that the log says whose it is.
        self.fleet.listen(RUN_PERIOD_S, lambda: self.fleet.robots[self.robot_id].run is not None)

    def _start(self, script: str, countdown_s: float) -> Held:
        begun = tell.start(
            self.fleet,
            {self.robot_id},
            script,
            ahead_s=countdown_s,
            partial=False,
            verb=tell.VERBS.VERB_SCRIPT,
        )
        (answer,) = begun.answers
        if begun.called_off:
            out = begun.dropouts.words.get(self.robot_id)
            why = f"it was {out}" if out else answer.reason
            raise ValueError(f"robot {self.robot_id} does not play {script}: {why}.")
        return Held(self.fleet, begun)

    def _play(self, held: Held, end_s: float | None) -> None:
        robot, begin_s = self.fleet.robots[self.robot_id], time.monotonic()
        while robot.last_mode == "script":
            self.fleet.listen(0.1)
            held.news()
        passed_s = time.monotonic() - begin_s
        if robot.last_mode == "fault":
            raise Abort("the robot reports a fault (camera, board or battery)")
        self.fleet.listen(LOST_S, lambda: not held.news() and held.is_over)
        (state,) = held.states.values()
        if state.stands and state != SCRIPT_OVER:
            raise Abort(state.words)
        if robot.last_mode == "running" or (end_s is not None and passed_s < end_s - 1):
            raise Abort(f"the robot left the script after {passed_s:.1f} s")

    @contextmanager
    def _watched(
        self, what: str, duration_s: float | None, pressed: Callable[[], bool]
    ) -> Iterator[None]:
        """Shows how long something takes on stderr, and ends it by Abort if it must not go on."""
        progress = progress_bar(counted=False)  # which the voice draws
        task, begin_s = progress.add_task(what, total=duration_s), time.monotonic()
        watch_signals = self.fleet.watch

        def watch() -> None:
            watch_signals()
            progress.update(task, completed=time.monotonic() - begin_s)
            self.voice.show(progress.get_renderable)
            if why := self._why_stop(pressed):
                raise Abort(why)

        self.fleet.watch = watch
        try:
            yield
        finally:
            self.fleet.watch = watch_signals
            self.voice.clear()

    def _why_stop(self, pressed: Callable[[], bool]) -> str:
        if pressed():
            return "a key was pressed"
        if self.recorder.failed:
            return f"the log cannot be written: {self.recorder.failed}"
        now_s = time.monotonic()
        heard_s = {"telemetry": self.fleet.robots[self.robot_id].heard_s, "pose": self.pose_s}
        if now_s - min(heard_s.values()) <= LOST_S:
            return ""
        # Where both stop at once, which one came last says nothing.
        lost = [what for what, at_s in heard_s.items() if now_s - at_s > LOST_S / 2]
        why = ": motion capture has lost the robot" if lost == ["pose"] else ""
        return f"no {' and no '.join(lost)} for {LOST_S:g} s{why}"
