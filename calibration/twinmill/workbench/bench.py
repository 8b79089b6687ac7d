# SPDX-License-Identifier: Apache-2.0
"""The workbench without its screen: the session, its worker, its state file, and what has changed.

A screen asks `changes` a few times a second and draws anew what has another number than before.
"""

import asyncio
import json
from collections import Counter
from collections.abc import Callable
from time import monotonic
from typing import Any

from twinmill.charts.arrays import RESTARTS, measured_path
from twinmill.charts.packed import pack, pack_log, pack_prediction, pack_robot
from twinmill.data.camera_frames import frames_of
from twinmill.data.log import LogError
from twinmill.files import plain
from twinmill.model.parameters import is_of_camera
from twinmill.workbench.session import Session, beside_label
from twinmill.workbench.state_file import StateFile
from twinmill.workbench.swarm import has_poses
from twinmill.workbench.worker import Done, Work, Worker

RETRY_S = 2.0  # until the session is written again, after it could not be
AWAITED = ("fit", "add", "diagnose", "next", "swarm")  # work that the user waits for


def moves(effect: str) -> bool:
    """True if an effect changes the motion, as all but those of the camera do."""
    return not is_of_camera(effect)


class Bench:
    """Session, worker and state.

    Args:
        session: whose logs are read; `open` does the rest.
        state: where the session is kept.

    Attributes:
        changes: counts by what has changed: `robots`, `names`, `model`, `prediction`, `score`,
            `work`, `findings`, `plan`, `swarm`, `beside`.
        opening: what is being opened, in words; empty when all is there.
        failure: what went wrong last.
        unkept: why the session is not kept at present; empty while it is.
        view: what the screen shows: cursor, stretch, robot, tab.
        told: a page has said why nothing can be opened.
        threads: how many are at work.
    """

    def __init__(self, session: Session, state: StateFile) -> None:
        self.session, self.state = session, state
        self.worker = Worker(session.paths)
        self.changes: Counter[str] = Counter(robots=1)
        self.opening, self.failure, self.unkept = "starting", "", ""
        self.view: dict[str, Any] = state.read("view", {})
        self._waiting: Work | None = None
        self.threads = 0
        self._written: tuple = ()
        self._tried_s = 0.0
        self._reading, self._read = False, asyncio.Event()
        self._checks: Done | None = None
        self.told = asyncio.Event()
        self._acting = asyncio.Lock()
        session.restore(state.read("session", {}))

    # -- opening --------------------------------------------------------------------------------

    async def open(self) -> None:
        """Cleans the logs and judges the robots, that which is looked at first; in a thread.

        Raises:
            ValueError: nothing in them can be judged.
        """
        self.opening = f"cleaning {', '.join(p.name for p in self.session.paths)}"
        self.changed("work")
        await self.aside(self.session.measure)
        while left := self.session.unjudged:
            index = self.picked if self.picked in left else left[0]
            label = self.session.measurements[index].label
            self.opening = f"finding the noise floor of {label} ({len(left)} to go)"
            self.changed("work")
            await self.aside(self.session.judge, index)
            self.changed("names")
            if index == self.picked:
                self.changed("robots", "model", "findings")
            if not self._reading:
                self._reading = True
                self.worker.start(self.session.work("read"))
            self._exclude_wrong()
        self._show_worst()
        self.opening = "checking the commands against the motion"
        self.changed("work")
        await self._read.wait()
        self._exclude_wrong()
        await self.aside(self.session.conclude)
        self.opening = ""
        self.changed("work", "model", "score", "prediction")
        await self._look_ahead()

    def _exclude_wrong(self) -> None:
        """Leaves out the robots whose commands the worker found to be wrong, once it told."""
        if self._checks is None or self.session.checked:
            return
        if self._checks.failure:
            raise LogError(self._checks.failure)
        picked = self.session.measurements[self.picked]
        self.session.exclude_wrong(self._checks.result["findings"])
        places = [k for k, m in enumerate(self.session.measurements) if m is picked]
        if "robot" in self.view:
            self.view["robot"] = places[0] if places else 0
        self.changed("robots", "names", "model", "findings")

    def _show_worst(self) -> None:
        """The robot that the model misses most, unless the user has begun to do something."""
        known = {k: score for k, score in self.session.own_scores().items() if score > 0}
        begun = self.view.keys() & {"robot", "t"} or self.session.tree.current.number
        if known and not (begun or self.session.is_passing):
            self.view["robot"] = max(known, key=known.get)
            self.changed("robots")

    async def aside(self, act: Callable[..., Any], *arguments: Any) -> Any:
        """Runs a slow act in a thread of its own."""
        self.threads += 1
        try:
            return await asyncio.to_thread(act, *arguments)
        finally:
            self.threads -= 1

    def changed(self, *what: str) -> None:
        """Notes what a screen must draw anew."""
        self.changes.update(what)

    # -- what the screen does -------------------------------------------------------------------

    @property
    def picked(self) -> int:
        """Robot that is shown."""
        return min(self.view.get("robot", 0), max(len(self.session.measurements) - 1, 0))

    @property
    def ready(self) -> bool:
        """True if the robot that is shown was judged."""
        return self.picked in self.session.robots

    def drag(self, name: str, value: float) -> None:
        """A hand is on a knob."""
        self.session.drag(name, value)
        self.changed("score", "prediction")

    async def act(self, act: Callable[..., None], *arguments: Any) -> None:
        """Does what moves the session to another model; one after another."""
        async with self._acting:
            await self.aside(act, *arguments)
        await self._settled()

    # -- long work ------------------------------------------------------------------------------

    @property
    def doing(self) -> Work | None:
        """The work that the user waits for."""
        work = self._waiting or self.worker.work
        return work if work and work.kind in AWAITED else None

    @property
    def progress(self) -> str:
        """Worker's task and its time so far, in words."""
        if self._waiting:
            before = self.worker.work
            scores = before is not None and before.kind == "compare"
            return f"waiting for the score of {before.model}" if scores else "waiting for the logs"
        return f"{self.worker.words} · {self.worker.for_s:.0f} s"

    async def start(self, kind: str, effect: str = "", options: dict | None = None) -> None:
        """Work of `AWAITED` on the model where the tree stands."""
        self.failure = ""
        self._waiting = work = self.session.work(kind, effect, options)
        self.changed("work")
        if kind in ("fit", "add") and moves(effect):
            asked = (effect, self.picked, work.robot_id)
            previewed = await self.aside(self.session.preview, *asked)
            if self.doing is work:  # not done or cancelled before
                self.session.show(previewed)
                self.changed("score", "prediction", "beside")
        self._next()

    async def try_beside(self, effect: str, robot_id: int | None = None) -> None:
        """Draws beside the model what an effect would change; once more takes it away."""
        beside = self.session.beside
        if beside and beside.label == beside_label(effect, robot_id):
            return self.leave_beside()
        await self.aside(self.session.try_beside, effect, self.picked, robot_id)
        self.changed("prediction", "beside")

    def leave_beside(self) -> None:
        """Only the model itself is drawn."""
        self.session.beside = None
        self.changed("prediction", "beside")

    def cancel(self) -> None:
        """Stops what the user waits for."""
        self._waiting = None
        if self.doing:
            self.worker.cancel()
        self.session.forget()
        self.session.beside = None
        self.changed("work", "score", "prediction", "beside")

    async def tick(self) -> None:
        """To be called a few times a second."""
        if done := self.worker.poll():
            await self._take(done)
        self._next()
        self._write()

    async def _take(self, done: Done) -> None:
        if done.work.kind == "read":
            self._checks = done
            self._read.set()
        elif done.failure:
            self.cancel()
            self.failure = done.failure
        elif done.work.kind in ("fit", "add"):
            self.session.take(done)
            await self._settled()
        else:
            self.session.take(done)
            self.changed("work", "score", "findings", "plan", "swarm")
            if done.work.kind == "diagnose":
                await self._look_ahead()

    async def _look_ahead(self) -> None:
        """Foresees what a click on each finding will show, before it comes."""
        for finding in (self.session.diagnosis or {"findings": ()})["findings"]:
            if self.ready and moves(finding["effect"]):
                await self.aside(self.session.preview, finding["effect"], self.picked)

    async def _settled(self) -> None:
        """The session stands at another model: its prediction first, then what takes longer."""
        self.changed("prediction", "beside")
        await self.aside(self.session.score_now)
        await self.aside(self.session.own_scores)
        self.changed("work", "model", "score")

    def _next(self) -> None:
        """Starts waiting work; else the exact score of a model that a hand made."""
        if self.worker.busy:
            return
        if self._waiting:
            self.worker.start(self._waiting)
            self._waiting = None
            return
        score = self.session.tree.scores.get(self.session.tree.current.number)
        if score and not (score.exact or self.failure or self.session.unjudged):
            self.worker.start(self.session.work("compare"))

    # -- state ----------------------------------------------------------------------------------

    def _write(self) -> None:
        now = (sum(self.changes.values()), json.dumps(self.view), sorted(self.session.held))
        again = self.unkept and monotonic() - self._tried_s > RETRY_S
        if now != self._written or again:
            kept = {"view": self.view, "session": self.session.to_json()}
            data = plain(kept)
            self._written, self._tried_s = now, monotonic()
            before, self.unkept = self.unkept, ""
            try:
                self.state.write(json.dumps(data, allow_nan=False))
            except ValueError as error:
                self.unkept = f"What you do is not kept: {error}"
            if self.unkept != before:
                self.changed("work")
                self._written = (sum(self.changes.values()), *now[1:])

    def close(self) -> None:
        """Ends the worker; keeps the state."""
        self._write()
        self.worker.cancel()
        self.state.close()

    # -- arrays for the browser -----------------------------------------------------------------

    def log_bytes(self, place: int) -> bytes:
        """Paths of all robots of one log."""
        if place not in range(len(self.session.logs)):
            raise LookupError("no such log")
        log = self.session.logs[place]
        paths = {n: measured_path(r.pose_t_s, r.pose, r.valid) for n, r in log.robots.items()}
        headings = {n: r.has_heading for n, r in log.robots.items()}
        radius_m = self.session.given.model.get("robot.body_radius_m")
        return pack_log(log.path.name, paths, headings, radius_m)

    def robot_bytes(self, index: int) -> bytes:
        """Speeds, commands and band of one robot."""
        raw = self.session.raw(index)
        return pack_robot(self.session.robots[index], raw, frames_of(raw), self.session.given.model)

    def prediction_bytes(self, index: int) -> bytes:
        """Prediction of one robot by the model shown; under a hand of fewer moments, at once."""
        shown, beside = self.session.shown(index).model, self.session.beside_of(index)
        revision = self.changes["prediction"]
        view, seen = self.session.robots[index], self.session.detections(index)
        every = RESTARTS if self.session.is_dragged else 1
        return pack_prediction(view, shown, beside, seen, every=every, revision=revision)

    def swarm_bytes(self) -> bytes:
        """Poses of the twin's swarms."""
        if self.session.swarm is None or not has_poses(self.session.swarm):
            raise LookupError("no swarm")
        swarms = self.session.swarm["swarms"]
        poses = {
            f"pose{k}": s["pose"].reshape(len(s["pose"]), -1) for k, s in enumerate(swarms.values())
        }
        t_s = next(iter(swarms.values()))["t_s"]
        radius_m = self.session.given.model.get("robot.body_radius_m")
        return pack(poses, labels=[*swarms], step_s=float(t_s[1] - t_s[0]), radius_m=radius_m)

    def log_of(self, index: int) -> int:
        """Place of the log that a robot is in."""
        if not self.session.measurements:
            return self.view.get("log", 0)
        sha256 = self.session.measurements[index].log_sha256
        return next(k for k, log in enumerate(self.session.logs) if log.sha256 == sha256)
