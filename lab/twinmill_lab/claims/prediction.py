# SPDX-License-Identifier: Apache-2.0
"""Sealed predictions against a hundred simulated laboratories whose robots are another plant's.

What is predicted comes from a model whose gains are known to a fifth, as `lab predict` does it. A
laboratory's robots have gains of its own, drawn from the same errors. They are points that move by
forward Euler, in NumPy; or bodies in MuJoCo, with mass, wheels that slip and hulls.
"""

import hashlib
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from twinmill.programs import available_cores
from twinmill.report import Figure
from twinmill.report.canvas import FLOOR, MEASURED, draw
from twinmill.swarm.axes import Axis
from twinmill.swarm.forecast.choose import choose
from twinmill.swarm.forecast.draws import OUTCOMES, Forecast, forecast
from twinmill.swarm.model_text import with_values
from twinmill.swarm.request import Request, run_part
from twinmill.swarm.store import Store, read_sweep
from twinmill.swarm.sweep import make_request, run_missing
from twinmill_lab.claims.published import Points
from twinmill_lab.claims.rows import Claim, Row, mean

STD, SPREAD, SECONDS, LABS, CELLS = 0.2, 0.02, 45.0, 100, 9
MODEL = f"""
name = "known_to_a_fifth"
[robot]
body_radius_m = 0
[base]
drive = "twist"
wheels = "none"
speed_per_input_mps = 0.0025
turn_per_input_radps = 1.5707963267949
control_period_s = 0.022
[base.std]
forward_gain = {STD}
yaw_gain = {STD}
[sensor]
range_m = 1.2
cone_rad = 0.8552113334772
target_radius_m = 0.1
[idiosyncrasy]
theta_a1_std = {SPREAD}
theta_a2_std = {SPREAD}
"""
BODIED = MODEL.replace("body_radius_m = 0", "body_radius_m = 0.1")
AXES = ["cone_deg=40:80:5", "range_m=0.5,0.8,1.2"]
EDGES = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)  # of what was said


@dataclass(frozen=True)
class Trial:
    """Prediction for one laboratory beside the outcome there.

    Attributes:
        said: of the chosen cells.
        saw: (LABS, cells) places in OUTCOMES.
    """

    said: Forecast
    saw: np.ndarray


def gains() -> np.ndarray:
    """(2, LABS) on speed and on turn rate, drawn by N(1, STD)."""
    return np.clip(1 + STD * np.random.default_rng(7).standard_normal((2, LABS)), 0.2, 2)


def laboratories(cells: np.ndarray) -> np.ndarray:
    """(LABS, cells) what each saw: points by forward Euler."""
    gain = gains()
    v, omega = (np.repeat(g, len(cells)) for g in (0.25 * gain[0], np.radians(45) * gain[1]))
    cone, range_m = (np.tile(column, LABS) for column in cells.T)
    points = Points(
        v_mps=v,
        omega_radps=omega,
        cone_rad=np.radians(cone),
        range_m=range_m,
        target_radius_m=0.1,
        spread=SPREAD,
    )
    ended = points.run(LABS * len(cells), seed=3, duration_s=SECONDS).classes
    return np.vectorize(OUTCOMES.index)(ended).reshape(LABS, len(cells))


def laboratories_in_mujoco(
    request: Request, cells: np.ndarray, folder: Path, tell: Callable[[int, int], None]
) -> np.ndarray:
    """(LABS, cells) what each saw: bodies in MuJoCo. Each laboratory is kept as it ends.

    Args:
        request: of the sweep, whose robots those of the laboratories are but for their gains.
        cells: (C, axes) that they run.
        folder: of all runs; stopped half way, they go on where they were.
        tell: is given how many laboratories are done, and how many there are.
    """
    asked = replace(request, plant="mujoco", seeds=1)
    known = hashlib.sha256(asked.to_json().encode() + cells.tobytes()).hexdigest()
    store = Store(folder / known[:16])
    store.open(asked)
    todo = [] if store.result.exists() else store.missing(LABS)

    def ends(lab: int) -> tuple[int, list[str]]:
        names = ("base.forward_gain", "base.yaw_gain")
        own = dict(zip(names, gains()[:, lab], strict=True))
        text = with_values(asked.model_text, asked.model, own)
        ended = []
        for k, cell in enumerate(cells):
            at = zip(asked.axes, cell, strict=True)
            axes = [Axis(axis.name, (float(value),)) for axis, value in at]
            seed = 1_000_000 + lab * len(cells) + k
            one = replace(asked, model_text=text, axes=axes, first_seed=seed)
            ended += run_part(one, range(1))["class"]
        return lab, ended

    with ThreadPoolExecutor(available_cores()) as pool:
        waiting = [pool.submit(ends, lab) for lab in todo]
        try:
            for done, future in enumerate(as_completed(waiting), 1):
                lab, ended = future.result()
                store.keep(lab, {"lab": [lab] * len(ended), "class": ended})
                tell(LABS - len(todo) + done, LABS)
        finally:
            pool.shutdown(cancel_futures=True)  # at Ctrl-C only those that run go on
    if not store.result.exists():
        store.finish(asked, LABS)
    _, table = read_sweep(store.folder)
    return np.vectorize(OUTCOMES.index)(table["class"].to_pylist()).reshape(LABS, len(cells))


def sealed_prediction(folder: Path, model: str = MODEL) -> tuple[Request, Forecast]:
    """Sweeps and predicts in a folder of its own, by the steps of `lab predict`."""
    (folder / "m.toml").write_text(model)
    request = make_request("milling", str(folder / "m.toml"), AXES, seeds=40, duration_s=SECONDS)
    run_missing(request, folder / "sweep", lambda worlds: None)
    request, table = read_sweep(folder / "sweep")
    whole = forecast(request, table, 60, 6, seed=1, folder=folder / "draws")
    return request, whole.cells([cell for cell, _ in choose(whole, CELLS, 1, seed=1)])


def trial(folder: Path) -> Trial:
    """Predicts, and lets all laboratories run."""
    _, said = sealed_prediction(folder)
    return Trial(said, laboratories(said.points))


def prediction(_seeds: int) -> Claim:
    """How often each class came, against how probable it was said to be."""
    with tempfile.TemporaryDirectory(prefix="twinmill.") as folder:
        return reliability(trial(Path(folder)))


def prediction_in_mujoco(folder: Path, tell: Callable[[int, int], None]) -> Claim:
    """Claim about predictions for robots that are bodies in MuJoCo, by a planar model."""
    with tempfile.TemporaryDirectory(prefix="twinmill.") as swept:
        request, said = sealed_prediction(Path(swept), BODIED)
    found = reliability(Trial(said, laboratories_in_mujoco(request, said.points, folder, tell)))
    return replace(found, name="prediction_in_mujoco", title="The same, of robots in MuJoCo")


def reliability(found: Trial) -> Claim:
    """By bins of what was said; intervals from the scatter of laboratories."""
    said = found.said.share  # (C, K)
    came = found.saw[:, :, None] == np.arange(said.shape[1])  # (LABS, C, K)
    rows = []
    for low, high in pairwise(EDGES):
        inside = (said > low) & (said <= high)
        if not inside.any():
            continue
        told = float(said[inside].mean())
        what = f"came, said with {100 * low:.0f} to {100 * high:.0f} %"
        rows.append(mean(what, came[:, inside].mean(axis=1), told, at=told))
    gain = np.log(said[np.arange(CELLS), found.saw]).mean(axis=1)
    gain -= np.log(found.said.base_rate[found.saw]).mean(axis=1)
    rows.append(mean("log score above the base rate's", gain, None))
    told, seen = (
        ", ".join(f"{100 * value:.0f}" for value in values)
        for values in zip(*((row.reference[0], row.value) for row in rows[:-1]), strict=True)
    )
    return Claim(
        "prediction",
        "A prediction that can fail",
        "A calibrated model predicts what becomes of a swarm before it is run.",
        None,
        f"In {LABS} laboratories of another plant, {CELLS} runs each, what was said with {told} % "
        f"came in {seen} %. The log score is {rows[-1].value:.2f} above that of the base rate "
        f"({rows[-1].low:.2f} to {rows[-1].high:.2f}).",
        rows,
        [_figure(rows[:-1])],
    )


def _figure(rows: list[Row]) -> Figure:
    def paint(axes: Axes) -> None:
        at = [row.by["at"] for row in rows]
        ends = np.array([[row.value - row.low, row.high - row.value] for row in rows]).T
        axes.plot([0, 1], [0, 1], color=MEASURED, lw=0.8)
        axes.errorbar(at, [row.value for row in rows], ends, fmt="o", ms=5, color=FLOOR)
        axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal")
        axes.set(xlabel="probability that was said", ylabel="share that came")

    return Figure(
        draw(3.6, paint),
        "Reliability",
        f"Classes of {CELLS} cells in {LABS} laboratories, by what was said; bars are 95 % "
        "intervals over laboratories. On the line each came as often as was said.",
    )
