# SPDX-License-Identifier: Apache-2.0
"""The turning centre by the sign that is printed and by the one that follows from the equations.

For x' = v cos, y' = v sin, theta' = w the centre z + (v/w)(-sin, +cos) has derivative 0; what is
printed, z + (v/w)(+sin, +cos), is off by (2 v/w) sin(theta) in x.
"""

import numpy as np
from matplotlib.axes import Axes

from twinmill.claims.rows import Claim, Row, mean
from twinmill.claims.swarms import run
from twinmill.report import Figure
from twinmill.report.canvas import FLOOR, MEASURED, PREDICTED, draw
from twinmill.report.phase_figures import paint_paths

SIGNS = {"(-sin, +cos)": -1.0, "(+sin, +cos), as printed": 1.0}
V_MPS, OMEGA_RADPS, RANGE_M = 0.25, np.radians(45), 1.1
SNAPSHOTS = {
    "milling": (6, ["v_mps=0.25", "omega_degps=45"]),
    "diffusing": (8, ["v_mps=0.3", "omega_degps=150"]),
}
RUNS, SHOWN_S = 20, 8.0


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
    snapshots = {}
    for behavior, (n, axes) in SNAPSHOTS.items():
        runs = run(
            [*axes, "theta_a=0", "target_radius_m=0.1", "range_m=1.2"], behavior, n=n, seeds=RUNS
        )
        period_s = runs.request.model.get("base.control_period_s")
        ends = [runs.end(seed, period_s) for seed in runs["seed"][0]]
        for name, sign in SIGNS.items():
            deltas = np.array([_delta(end, period_s, sign) for end in ends])
            rows.append(mean(f"delta, {behavior}, {name}", deltas, None))
        snapshots[behavior] = (runs, ends[0], period_s)
    right, printed, spun, spun_printed = (
        next(r.value for r in rows if r.what == f"delta, {behavior}, {sign}")
        for behavior in SNAPSHOTS
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
        [_figure(snapshots)],
    )


def _centres(trace: np.ndarray, v_mps, omega_radps, sign: float) -> np.ndarray:
    """(T, n, 2) turning centres of (T, n, 3) poses."""
    x, y, theta = np.moveaxis(trace, -1, 0)
    arm_m = np.divide(v_mps, omega_radps)
    return np.stack([x + sign * arm_m * np.sin(theta), y + arm_m * np.cos(theta)], axis=-1)


def _last_centres(end: np.ndarray, period_s: float, sign: float) -> np.ndarray:
    """(n, 2) by the motion of the last step."""
    before, after = end[-2:]
    omega_radps = (after[:, 2] - before[:, 2]) / period_s
    chord = after[:, :2] - before[:, :2]
    ahead = np.stack([np.cos(before[:, 2]), np.sin(before[:, 2])], axis=-1)
    v_mps = np.linalg.norm(chord, axis=1) * np.sign(np.sum(chord * ahead, axis=1)) / period_s
    return _centres(after, v_mps, omega_radps, sign)


def _delta(end: np.ndarray, period_s: float, sign: float) -> float:
    centres = _last_centres(end, period_s, sign)
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=-1)
    return float(apart[~np.eye(len(centres), dtype=bool)].min() / RANGE_M)


def _figure(snapshots: dict) -> Figure:
    def paint(panels: np.ndarray) -> None:
        for axes, (behavior, (runs, end, period_s)) in zip(panels, snapshots.items(), strict=True):
            _paint(axes, end, period_s)
            value = f"c = {runs['circliness'][0][0]:.2g}"
            deltas = ", ".join(f"{_delta(end, period_s, sign):.2f}" for sign in SIGNS.values())
            axes.set_title(f"{behavior}: {value}\ndelta {deltas} as printed", fontsize=8)
        for name, (marker, color) in zip(SIGNS, MARKS, strict=True):
            panels[0].plot([], [], marker, ms=5, mfc="none", mec=color, label=name)
        panels[0].figure.legend(loc="outside lower center", ncols=2, fontsize=8)

    return Figure(
        draw(3.4, paint, ncols=2),
        "Snapshots, with turning centres of both signs",
        f"The last {SHOWN_S:g} s of one run each; dots are the robots, the bar is 1 m. Circliness "
        "c is that of the text.",
    )


MARKS = (("+", FLOOR), ("x", PREDICTED))


def _paint(axes: Axes, end: np.ndarray, period_s: float) -> None:
    paint_paths(axes, end[::4], MEASURED)
    for (marker, color), sign in zip(MARKS, SIGNS.values(), strict=True):
        axes.plot(*_last_centres(end, period_s, sign).T, marker, ms=7, color=color, zorder=5)
