# SPDX-License-Identifier: Apache-2.0
"""Effect of a camera's reach, angle and errors on a mill, and of the simulation's step."""

import numpy as np

from twinmill_lab.claims import figures
from twinmill_lab.claims.published import Points
from twinmill_lab.claims.rows import Claim, Row, share
from twinmill_lab.claims.swarms import KINDS, ROUND, run

AT = ["v_mps=0.25", "omega_degps=45"]
TO_EDGE_M = 0.1  # a disc's nearest part, by which the reference counts, is so much nearer
# What is varied, of which kind, in which words of the sweep: value (the reference's): its share.
CUTS: dict[tuple[str, str, str], dict[float, float | None]] = {
    ("view range (m)", "disc", "range_m"): {0.3: None, 0.5: 0.55, 0.7: 0.87, 0.9: 0.96, 1.1: 0.99},
    ("full cone (degrees)", "point", "cone_deg"): {49: 0.02, 55: 0.76, 60: 0.92, 70: None},
    ("full cone (degrees)", "disc", "cone_deg"): {30: None, 49: 0.978, 60: None, 75: 0.0, 90: 0.0},
    ("missed frames", "disc", "miss_rate"): {0: 0.978, 0.25: None, 0.5: 0.98, 0.75: None},
    ("false frames", "disc", "false_rate"): {0: 0.978, 0.1: 0.98, 0.2: None, 0.3: 0.08},
    ("false frames, vote of 10", "disc", "vote=10 false_rate"): {0.1: None, 0.2: None, 0.3: 0.61},
    ("frames that vote", "disc", "vote"): {1: 0.978, 10: 0.98, 20: 0.96, 31: 0.36},
}
# Forward Euler at 22 ms, as published: deg/s: share at each speed, points that are all alike.
STEP_SPEEDS_MPS = (0.10, 0.20, 0.30)
EULER = {20: (0.82, 0.41, 0.08), 30: (0.96, 0.79, 0.47)}
SHORT_STEP_S, SHORT_STEP_SHARE = 0.005, (0.65, 0.67)  # midpoint rule and Euler


def sensor(seeds: int) -> Claim:
    """Range, cone, errors and vote."""
    rows = []
    for (label, kind, words), reference in CUTS.items():
        *fixed, name = words.split()
        offset = TO_EDGE_M if name == "range_m" and kind == "disc" else 0.0
        values = ",".join(f"{at + offset:g}" for at in reference)
        kept = [axis for axis in KINDS[kind] if not axis.startswith(f"{name}=")]
        runs = run([*AT, *kept, *fixed, f"{name}={values}"], seeds=seeds)
        for (at, percent), hits in zip(reference.items(), runs.mills, strict=True):
            curve = f"{label}, {kind}"
            rows.append(share(f"{curve}: {at:g}", hits, percent, kind=curve, at=at))
    found = {row.what: row for row in rows}
    near, far = (found[f"view range (m), disc: {at}"] for at in (0.5, 1.1))
    narrow, wide = (found[f"full cone (degrees), point: {at}"] for at in (49, 60))
    none, missed = (found[f"missed frames, disc: {at:g}"] for at in (0, 0.5))
    false, voted = (found[w] for w in ("false frames, disc: 0.3", "frames that vote, disc: 31"))
    return Claim(
        "sensor",
        "How far and how wide a robot must see, and how often",
        "Sensing noise, view range, angle and sampling decide whether a behaviour comes about.",
        None,
        f"Whole bodies seen, to whose nearest part ranges are: {_percent(near)} mill at 0.5 m, "
        f"{_percent(far)} at 1.1 m. Of centres alone {_percent(narrow)} mill with a full cone of "
        f"49 degrees and {_percent(wide)} with 60: the next robot of six is 30 degrees beside the "
        f"heading. Of whole bodies, {_percent(none)} without errors, "
        f"{_percent(missed)} with half of all frames missed, {_percent(false)} with 30 % false "
        f"ones, {_percent(voted)} by a vote of 31 frames, which are 0.7 s.",
        rows,
        [figures.cuts(rows)],
    )


def steps(seeds: int) -> Claim:
    """Forward Euler as published beside exact arcs."""
    count = max(seeds // 4, 20)
    rows: list[Row] = []
    cells = [(v, omega) for omega in EULER for v in STEP_SPEEDS_MPS]
    v_mps, omega_degps = (np.repeat(column, count) for column in np.array(cells).T)
    euler = Points(v_mps=v_mps, omega_radps=np.radians(omega_degps))
    mills = (euler.run(len(v_mps), seed=2).circliness < ROUND).reshape(len(cells), count)
    speeds = "v_mps=" + ",".join(map(str, STEP_SPEEDS_MPS))
    turns = "omega_degps=" + ",".join(map(str, EULER))
    arcs = run([speeds, turns, "theta_a=0"], seeds=seeds)
    for (v, omega), hits in zip(cells, mills, strict=True):
        curve, at = f"Euler, {omega} deg/s", STEP_SPEEDS_MPS.index(v)
        rows.append(share(f"{curve}, {v:g} m/s", hits, EULER[omega][at], kind=curve, at=v))
    for (v, omega), hits in zip(cells, arcs.mills, strict=True):
        curve = f"arcs, {omega} deg/s"
        rows.append(share(f"{curve}, {v:g} m/s", hits, None, kind=curve, at=v))
    short = run([*AT, "theta_a=0", f"base.control_period_s={SHORT_STEP_S}"], seeds=seeds)
    rows.append(share("arcs, 45 deg/s, 0.25 m/s, 5 ms", short.mills[0], SHORT_STEP_SHARE))
    lost = [a.value - b.value for a, b in zip(rows[: len(cells)], rows[len(cells) :], strict=False)]
    return Claim(
        "steps",
        "What the step of the simulation does",
        "Robots move by x + v cos(theta) T and so on, forward Euler at T = 22 ms.",
        None,
        f"By forward Euler the share of points that mill is {100 * np.mean(lost):+.0f} percentage "
        f"points off that along exact arcs, the mean over {len(cells)} pairs of speed and turn "
        f"rate ({100 * min(lost):+.0f} to {100 * max(lost):+.0f}): each of Euler's steps ends "
        f"outside of the arc. Along arcs in steps of 5 ms it is {_percent(rows[-1])} at the "
        "published pair.",
        rows,
        [figures.curves(rows[:-1], "speed (m/s)", "share that mills")],
    )


def _percent(row: Row) -> str:
    return f"{100 * row.value:.0f} %"
