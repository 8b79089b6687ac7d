# SPDX-License-Identifier: Apache-2.0
"""What was published of these swarms, and what an independent program makes of the same equations.

The reference is a C program of Vega et al. 2024 (arXiv 2410.16444), 100 seeds a cell unless said;
"mills" there is circliness below 0.2 over the last 10 of 120 s, started in a square of 1.2 m.
`disc`: a target of 0.1 m radius and bodies that push apart. `robot`: a point target, bodies, 4 %
missed and 10 % false detections, a vote of 10. Both with a spread of 0.04.
"""

import numpy as np
import pytest
from twinmill.tools.sweep.command import make_request
from twinmill.tools.sweep.request import run_part

BODIES = ["robot.body_radius_m=0.1"]
DISC = [*BODIES, "target_radius_m=0.1"]
ROBOT = [*BODIES, "miss_rate=0.04", "false_rate=0.1", "vote=10"]
V_MPS = (0.10, 0.15, 0.20, 0.25, 0.30, 0.35)
SEEDS = 100


def run(axes: list[str], **changes) -> dict[str, np.ndarray]:
    """Columns of a sweep, rows in its order."""
    given = {"seeds": SEEDS, **changes}
    request = make_request(given.pop("behavior", "milling"), "paper.toml", axes, **given)
    columns = run_part(request, range(request.world_count))
    return {name: np.array(values) for name, values in columns.items()}


def mills(rows: dict[str, np.ndarray]) -> np.ndarray:
    """(cells,) share by the reference's criterion."""
    return (rows["circliness"].reshape(-1, SEEDS) < 0.2).mean(axis=1)


def off_by(ours: np.ndarray, reference: np.ndarray, reference_seeds: int = 100) -> np.ndarray:
    """Difference in standard deviations of two binomial samples, pooled, held off 0 and 1."""
    a, b = SEEDS, reference_seeds
    pooled = (ours * a + reference * b + 1) / (a + b + 2)
    return (ours - reference) / np.sqrt(pooled * (1 - pooled) * (1 / a + 1 / b))


@pytest.mark.parametrize(
    ("kind", "omega_degps", "percent"),
    [
        (DISC, 20, (100, 98, 97, 70, 29, 18)),
        (DISC, 30, (100, 100, 98, 97, 96, 86)),
        (DISC, 90, (100, 100, 100, 99, 99, 98)),
        (ROBOT, 20, (31, 27, 23, 19, 10, 4)),
        (ROBOT, 30, (100, 71, 66, 59, 64, 53)),
        (ROBOT, 40, (99, 100, 84, 82, 82, 86)),
        (ROBOT, 50, (100, 100, 98, 89, 90, 86)),
    ],
)
def test_the_phase_diagram_is_the_references(kind, omega_degps, percent):
    speeds = "v_mps=" + ",".join(map(str, V_MPS))
    rows = run([speeds, f"omega_degps={omega_degps}", *kind])
    off = off_by(mills(rows), np.array(percent) / 100)
    print(omega_degps, "deg/s:", 100 * mills(rows), "off by", off.round(1), "sigma")
    assert np.abs(off).max() < 3.5
    assert np.sqrt(np.mean(off**2)) < 2


def test_six_robots_mill_at_the_published_speeds():
    rows = run(["v_mps=0.25", "omega_degps=45", *DISC])
    assert abs(off_by(mills(rows), 0.978, 1000)) < 3.5
    assert np.median(rows["radius_m"]) == pytest.approx(1.06, rel=0.05)
    assert (rows["class"] == "milling").mean() == pytest.approx(mills(rows)[0], abs=0.02)


def test_more_robots_are_not_always_better():
    reference = np.array([0.98, 0.99, 0.94, 0.04, 0.0])
    share = mills(run(["n=5:9:5", *DISC]))
    assert np.abs(off_by(share, reference)).max() < 3.5
    assert share[1] > 0.9 > 0.2 > share[3]


def test_unlike_speeds_shear_the_ring_in_proportion():
    # A locked ring has radii in proportion to speeds: circliness is the mean range of six standard
    # normal numbers, 2.53 (Tippett 1925), times the spread.
    rows = run(["theta_a=0.01,0.02,0.03", *DISC])
    found = np.array([c[c < 0.2].mean() for c in rows["circliness"].reshape(-1, SEEDS)])
    assert found == pytest.approx(2.53 * np.array([0.01, 0.02, 0.03]), rel=0.12)


@pytest.mark.parametrize(("duration_s", "reference"), [(30.0, 0.98), (120.0, 1.0)])
def test_eight_robots_diffuse(duration_s, reference):
    rows = run(["v_mps=0.3", "omega_degps=150"], behavior="diffusing", n=8, duration_s=duration_s)
    assert abs(off_by((rows["least_diffusion"] > 1).mean(), reference)) < 3.5


# The published sign, -3 times the turn rate of milling, gives an inner orbit at 0.76 of the ring's
# radius in the reference; +3 times gives 0.34 to 0.62, by variant. Both are to 0.04.
@pytest.mark.parametrize(("turn", "ratio"), [(-1.5, (0.72, 0.80)), (1.5, (0.30, 0.66))])
def test_one_odd_robot_orbits_inside_the_mill(turn, ratio):
    rows = run(
        ["theta_a=0", *DISC],
        behavior="milling:5,odd:1",
        tables=[f"odd=0,{turn},100,0.5"],
        duration_s=180.0,
    )
    inside = np.median(rows["odd_ratio"])
    print("odd robot at", inside, "of the ring's radius", np.median(rows["radius_m"]))
    assert ratio[0] < inside < ratio[1]
    if turn < 0:
        assert np.median(rows["radius_m"]) == pytest.approx(0.59, rel=0.05)


def test_a_slice_over_speed_and_turn_rate_has_the_four_published_classes():
    rows = run(["v_mps=0.1:0.35:7", "omega_degps=20:90:8"], seeds=20)
    assert {"milling", "ellipsoidal", "cluster", "separated"} <= set(rows["class"])


def test_bodies_in_contact_are_no_mill_however_round():
    # At 0.1 m/s and 40 deg/s and more the reference's mills are six bodies in contact on 0.2 m.
    rows = run(["v_mps=0.1", "omega_degps=60", *ROBOT])
    assert mills(rows)[0] > 0.9
    assert np.median(rows["radius_m"]) == pytest.approx(0.2, abs=0.01)
    assert (rows["class"] == "jammed").mean() > 0.9
