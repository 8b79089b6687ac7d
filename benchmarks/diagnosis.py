# SPDX-License-Identifier: Apache-2.0
"""A diagnosis against the whole catalogue, and mujoco.sysid on the same log."""

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import sysid_fit
from ratio import Ratio, single

from twinmill.data.measurement import Measurement, load_measurements
from twinmill.data.track import command_at
from twinmill.diagnosis.diagnose import diagnose
from twinmill.experiment.rich_script import write_rich_script
from twinmill.fitting.fit import fit
from twinmill.inference.always import always_of
from twinmill.inference.kept import with_kept
from twinmill.model.model_file import ModelFile
from twinmill.report.judged import sentence

DUTY_PCT = [0, 12.5, 25, 37.5, 50, 75, 100]
ROBOT = f"""
[base]
duty_pct = {DUTY_PCT}
wheel_speed_mps = [0, 0.11, 0.18, 0.24, 0.28, 0.33, 0.37]
sideways_gain = 0.89
yaw_gain = 0.85
motor_lag_s = 0.09

[noise]
sensor_m = 0.0003
sensor_rad = 0.0017
drive_mps = 0.003
drive_radps = 0.03
drive_s = 0.15
drive_turn_s = 0.15
"""
DURATION_S, GOAL_S = 150.0, 10.0
COMMAND_S, TEN_S = 2.0, 20.0  # goals of the whole command, of one robot and of ten
RUNS = 3  # of which the least counts: other programs take caches, too
REST_S = 1.2  # shorter than the script's rests, longer than wheels need to stand
HIDDEN = {
    "nothing": "",
    "friction": '[[effect]]\nname = "coulomb_friction"\nloss_mps = 0.012\n',
}


def measure(build: Path) -> Iterator[Ratio]:
    """With nothing hidden, and with an effect; the base is fitted to another log before."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_rich_script(folder / "script.csv", DURATION_S, 1)
        base = _base(build, folder)
        always = always_of(load_measurements([folder / "base.lcmlog"]), base)
        known = with_kept(base, always, folder / "known.toml", "")
        for seed, (hidden, effect) in enumerate(HIDDEN.items(), 2):
            (run,) = _drive(build, folder, hidden, effect, seed=seed)
            runs = _from_rest(run, base)
            ours_s, found = _timed(lambda run=run: diagnose([run], known))
            theirs_s, theirs = _timed(lambda runs=runs: _sysid(runs, base))
            says = f"{', '.join(theirs['insights'])} ({1e3 * theirs['rms_m']:.0f} mm)"
            yield single(f"diagnosis, {hidden} : {GOAL_S:g} s", ours_s, GOAL_S, "s",
                         at_most=1, says=sentence(found))  # fmt: skip
            yield single(f"sysid, {hidden} : diagnosis", theirs_s, ours_s, "s", says=says)
            yield single(f"command, {hidden} : {COMMAND_S:g} s", _command_s(folder, hidden),
                         COMMAND_S, "s", at_most=1)  # fmt: skip
        _drive(build, folder, "ten", HIDDEN["friction"], seed=9, robots=10)
        yield single(f"command, ten robots : {TEN_S:g} s", _command_s(folder, "ten"), TEN_S, "s",
                     at_most=1)  # fmt: skip


def _timed(work: Callable) -> tuple[float, Any]:
    """Seconds of processor time of all threads, and the result."""
    started_s = time.process_time()
    result = work()
    return time.process_time() - started_s, result


def _command_s(folder: Path, name: str) -> float:
    """Seconds of processor time, user's and system's, of `diagnose --json` as a user runs it."""
    log, base = folder / f"{name}.lcmlog", folder / "base.toml"
    words = [sys.executable, "-P", "-m", "twinmill_cli.main", "diagnose", log, "--model", base]
    taken_s = []
    for _ in range(RUNS):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([*words, "--json"], check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        taken_s.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(taken_s)


def _base(build: Path, folder: Path) -> ModelFile:
    """The model, fitted to a log with nothing hidden, from rough speeds."""
    rough, fitted = folder / "rough.toml", folder / "base.toml"
    rough.write_text(
        f"[base]\nduty_pct = {DUTY_PCT}\nwheel_speed_mps = [0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4]\n"
    )
    fit(_drive(build, folder, "base", "", seed=1), ModelFile.load(str(rough)), fitted, "")
    return ModelFile.load(str(fitted))


def _drive(
    build: Path, folder: Path, name: str, effect: str, *, seed: int, robots: int = 1
) -> list[Measurement]:
    """Lets the twin drive the script."""
    model, log = folder / f"{name}.toml", folder / f"{name}.lcmlog"
    model.write_text(ROBOT + effect)
    command = [build / "bin/twin_run", "--plant", "planar", "--model", model]
    command += ["--n", robots, "--seed", seed, "--script", folder / "script.csv", "--log", log]
    subprocess.run([str(word) for word in command], check=True, capture_output=True)
    return load_measurements([log])


def _from_rest(run: Measurement, base: ModelFile) -> list[tuple]:
    """Stretches from rest to rest on an even grid: s, rim speeds asked for, poses."""
    track, model = run.track, base.model
    step_s = track.timing.pose_period_s
    t_s = np.arange(track.pose_t_s[0], track.pose_t_s[-1], step_s)
    pose = np.column_stack([np.interp(t_s, track.pose_t_s, p) for p in track.pose.T])
    pose[:, 2] = np.interp(t_s, track.pose_t_s, np.unwrap(track.pose[:, 2]))
    speeds = [model.get(f"base.wheel_speed_mps.{k}") for k in range(1, len(DUTY_PCT))]
    duty = command_at(t_s - model.get("clock.offset_s"), track.command_t_s, track.command)
    rims = np.sign(duty) * np.interp(100 * np.abs(duty), DUTY_PCT, [0, *speeds])
    moving = np.any(duty != 0, axis=1)
    since = t_s - np.maximum.accumulate(np.where(moving, t_s, -np.inf))
    starts = np.flatnonzero(moving[1:] & (since[:-1] > REST_S))
    return [
        (t_s[a:b] - t_s[a], rims[a:b], pose[a:b], np.zeros(4))
        for a, b in zip(starts, [*starts[1:], len(t_s)], strict=True)
    ]


def _sysid(runs: list[tuple], base: ModelFile) -> dict:
    """As many free quantities as a diagnosis has with one effect: three gains and a lag."""
    get = base.model.get
    start = {
        "forward": get("base.forward_gain"),
        "sideways": get("base.sideways_gain"),
        "yaw": get("base.yaw_gain"),
        "lag_s": get("base.motor_lag_s"),
    }
    lever_m = get("robot.half_wheelbase_m") + get("robot.half_track_m")
    rad_in_m = get("noise.sensor_m") / get("noise.sensor_rad")
    return sysid_fit.fit(runs, start, sysid_fit.mecanum(lever_m), rad_in_m)
