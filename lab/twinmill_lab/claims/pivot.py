# SPDX-License-Identifier: Apache-2.0
"""The turning centre by the sign that is printed and by the one that follows from the equations.

Snapshots show both at rungs of circliness and delta, the published limits among them.

For x' = v cos, y' = v sin, theta' = w the centre z + (v/w)(-sin, +cos) has derivative 0; what is
printed, z + (v/w)(+sin, +cos), is off by (2 v/w) sin(theta) in x.
"""

import numpy as np

from twinmill.report import Figure
from twinmill.report.canvas import FLOOR, MEASURED, PREDICTED, draw
from twinmill.report.phase_figures import around, paint_paths
from twinmill_lab.claims.rows import Claim, Row, mean
from twinmill_lab.claims.swarms import ROUND, run

RIGHT = "(-sin, +cos)"
SIGNS = {RIGHT: -1.0, "(+sin, +cos), as printed": 1.0}
V_MPS, OMEGA_RADPS, RANGE_M = 0.25, np.radians(45), 1.1
BEHAVIORS = {
    "milling": (6, ["v_mps=0.25", "omega_degps=45"]),
    "diffusing": (8, ["v_mps=0.3", "omega_degps=150"]),
}
# A good mill, then the limits of a mill and of an ellipsoidal one; delta's limit is 1.
CIRCLINESS, DELTA = (0.05, ROUND, 1.0), (0.25, 0.5, 1.0)
UNEVEN = ["v_mps=0.25", "omega_degps=20,45", "theta_a=0.02,0.1,0.2"]  # where all circlinesses occur
TARGET = ["target_radius_m=0.1", "range_m=1.2"]
RUNS, SHOWN_S, STEP_S = 20, 8.0, 0.022
STRAIGHT_RADPS = 0.01  # slower than this there is no turning centre but the robot itself


def pivot(_seeds: int) -> Claim:
    """Both signs: along an arc, and in snapshots of both behaviours."""
    theta = np.linspace(0, 2 * np.pi, 721)
    radius_m = V_MPS / OMEGA_RADPS
    arc = np.stack([radius_m * np.sin(theta), -radius_m * np.cos(theta), theta], axis=1)[:, None]
    rows = []
    for (name, sign), algebra_m in zip(SIGNS.items(), (0.0, 4 * radius_m), strict=True):
        way_m = float(np.ptp(_centres(arc, V_MPS, OMEGA_RADPS, sign)[..., 0]))
        agrees = abs(way_m - algebra_m) < 1e-9
        reference = (algebra_m, algebra_m)
        what = f"how far the centre wanders on a circle, {name}"
        rows.append(Row(what, way_m, way_m, way_m, reference, agrees, "algebra", "m"))
    for behavior, (n, axes) in BEHAVIORS.items():
        runs = run([*axes, "theta_a=0", *TARGET], behavior, n=n, seeds=RUNS)
        ends = [runs.end(seed, STEP_S)[-2:] for seed in runs["seed"][0]]
        for name, sign in SIGNS.items():
            deltas = np.array([_deltas(end, STEP_S, sign)[-1] for end in ends])
            rows.append(mean(f"delta, {behavior}, {name}", deltas, None))
    right, printed, spun, spun_printed = (
        next(r.value for r in rows if r.what == f"delta, {behavior}, {sign}")
        for behavior in BEHAVIORS
        for sign in SIGNS
    )
    return Claim(
        "pivot",
        "The turning centre, and its sign",
        "Delta is the least distance of two turning centres over the view range; the centre is "
        "printed as z + (v/w)(sin, cos).",
        None,
        f"By the equations it is z + (v/w)(-sin, cos): as printed it wanders by {4 * radius_m:.2f} "
        f"m while the robot drives one circle. A mill of six has delta {right:.2f}, {printed:.2f} "
        f"as printed. Diffused robots spin where they stand: delta {spun:.2f} by the one and "
        f"{spun_printed:.2f} by the other.",
        rows,
        [_figure(mills(), diffusings())],
    )


def _centres(trace: np.ndarray, v_mps, omega_radps, sign: float) -> np.ndarray:
    """(T, n, 2) turning centres of (T, n, 3) poses."""
    x, y, theta = np.moveaxis(trace, -1, 0)
    arm_m = np.divide(v_mps, omega_radps)
    return np.stack([x + sign * arm_m * np.sin(theta), y + arm_m * np.cos(theta)], axis=-1)


def _moving_centres(trace: np.ndarray, period_s: float, sign: float) -> np.ndarray:
    """(T - 1, n, 2) by each step's motion; who goes straight is its own centre."""
    before, after = trace[:-1], trace[1:]
    omega_radps = (after[..., 2] - before[..., 2]) / period_s
    chord = after[..., :2] - before[..., :2]
    ahead = np.stack([np.cos(before[..., 2]), np.sin(before[..., 2])], axis=-1)
    v_mps = np.linalg.norm(chord, axis=-1) * np.sign(np.sum(chord * ahead, axis=-1)) / period_s
    turns = np.abs(omega_radps) > STRAIGHT_RADPS
    return _centres(after, np.where(turns, v_mps, 0), np.where(turns, omega_radps, 1), sign)


def _deltas(trace: np.ndarray, period_s: float, sign: float) -> np.ndarray:
    """(T - 1,) least distances of two turning centres over the view range."""
    centres = _moving_centres(trace, period_s, sign)
    apart = np.linalg.norm(centres[:, :, None] - centres[:, None], axis=-1)
    others = ~np.eye(centres.shape[1], dtype=bool)
    return apart[:, others].min(axis=1) / RANGE_M


def _circliness(trace: np.ndarray) -> np.ndarray:
    """(T,) of the text: of distances from the centroid, how far they range over the least."""
    apart = trace[..., :2] - trace[..., :2].mean(axis=1, keepdims=True)
    radius = np.linalg.norm(apart, axis=-1)
    return np.ptp(radius, axis=1) / radius.min(axis=1)


def mills() -> list[np.ndarray]:
    """Snapshots of mills: for each rung of circliness the moment that comes nearest to it."""
    runs = run([*UNEVEN, *TARGET], seeds=RUNS)
    found = []
    for rung in CIRCLINESS:
        off = np.abs(np.log(runs["circliness"] / rung))
        cell, k = np.unravel_index(off.argmin(), off.shape)
        end = runs.end(runs["seed"][cell, k], STEP_S, 2 * SHOWN_S, cell)
        steps = len(end) // 2
        at = steps + np.abs(np.log(_circliness(end[steps:]) / rung)).argmin()
        found.append(end[at - steps : at + 1])
    return found


def diffusings() -> list[np.ndarray]:
    """One swarm on its way, as it first reaches each rung of delta."""
    n, axes = BEHAVIORS["diffusing"]
    trace = run([*axes, "theta_a=0", *TARGET], "diffusing", n=n, seeds=1).trace(120.0, STEP_S)
    deltas = _deltas(trace, STEP_S, SIGNS[RIGHT])
    steps = round(SHOWN_S / STEP_S)
    ends = [int(np.argmax(deltas >= rung)) + 2 for rung in DELTA]
    return [trace[max(end - steps, 0) : end] for end in ends]


def _figure(mills: list[np.ndarray], diffusings: list[np.ndarray]) -> Figure:
    def paint(panels: np.ndarray) -> None:
        for axes, trace in zip(panels.flat, [*mills, *diffusings], strict=True):
            paint_paths(axes, trace[::4], MEASURED)
            centres = [_moving_centres(trace[-2:], STEP_S, sign)[-1] for sign in SIGNS.values()]
            for (marker, color), of in zip(MARKS, centres, strict=True):
                axes.plot(*of.T, marker, ms=7, color=color, zorder=5)
            axes.set(**around(np.concatenate([trace[..., :2], [*centres]])))
            delta, printed = (_deltas(trace[-2:], STEP_S, sign)[-1] for sign in SIGNS.values())
            value = _circliness(trace[-1:])[0]
            axes.set_title(
                f"c = {value:.2g}\ndelta {delta:.2f}, {printed:.2f} as printed", fontsize=8
            )
        for name, (marker, color) in zip(SIGNS, MARKS, strict=True):
            panels.flat[0].plot([], [], marker, ms=5, mfc="none", mec=color, label=name)
        panels.flat[0].figure.legend(loc="outside lower center", ncols=2, fontsize=8)

    return Figure(
        draw(5.0, paint, nrows=2, ncols=len(CIRCLINESS)),
        "Snapshots, with turning centres of both signs",
        f"The last {SHOWN_S:g} s until a moment; dots are the robots then, the bar is 1 m. Above, "
        "six robots with the rule of milling, the last two at the limits of a mill and of an "
        "ellipsoidal one; below, one swarm that diffuses, as delta reaches 0.25, 0.5 and its "
        "limit 1.",
    )


MARKS = (("+", FLOOR), ("x", PREDICTED))
