# SPDX-License-Identifier: Apache-2.0
"""The run of one robot that narrows most what a swarm is predicted to do.

Models drawn from what the fits leave open end differently; the slope g of the share that reaches
the goal by the numbers drawn, and their covariance S, make its variance g' S g. A run whose
one-step errors have the Fisher information F leaves (S^-1 + F)^-1 of S. Moves are chosen one by one
so that g sees least of what is left, then exchanged one for another while that helps: c-optimal
design (Atkinson, Donev and Tobias 2007, ch. 10 and 12).

No fit does better than that F, and ours, which is robust and of predictions over whole horizons,
tells less. What is promised is therefore what the fit itself would say of the run, as it may be
seen.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyarrow as pa
import twinmill_native as native

from twinmill.arguments import option
from twinmill.data.measurement import Measurement
from twinmill.data.steady_table import SteadyTable
from twinmill.experiment.design import CENTRE, Floor, Limits, check, choose, log_of
from twinmill.experiment.moves import Move, duty_axes, family
from twinmill.experiment.one_step_fit import System
from twinmill.experiment.played import LEAD_S, Played, Rows, rows_of
from twinmill.fitting.fit import base_names, fitted
from twinmill.fitting.opening import judged, open_measurements
from twinmill.model.covariance import Covariance
from twinmill.model.model_file import ModelFile
from twinmill.model.parameters import (
    BASE_GAINS,
    LAG,
    Parameter,
    all_effect_parameters,
    base_parameters,
    duty_table,
)
from twinmill.model.ranges import Ranges, ranges
from twinmill.predict.modelled_log import ModelledLog
from twinmill.programs import available_cores
from twinmill.swarm.classes import goal_of, reached
from twinmill.swarm.forecast.draws import drawn_models, file_of
from twinmill.swarm.request import Request, run_part

CLOCKS = 2  # offset and rate of a run
LEAST_GAIN = 0.01  # of the variance: less is not worth another move
LEAST_STD = 0.01  # of the share: less is nothing to narrow
REPLICAS = 3  # of the run, with noise, that are fitted to


@dataclass(frozen=True)
class Spread:
    """How the share that reaches the goal depends on the numbers of the model.

    Attributes:
        names: (P,) of the numbers that are drawn.
        covariance: (P, P) of what the fits leave open.
        shares: (D,) of the models drawn.
        slope: (P,) of the share by each number.
        foretold: part of the scatter of shares that the line tells of models which were left out
            when it was drawn; 0 or less: it is no better than their mean, so the slope is chance.
    """

    names: list[str]
    covariance: np.ndarray
    shares: np.ndarray
    slope: np.ndarray
    foretold: float = 1.0

    @classmethod
    def of(cls, known: Ranges, shares: np.ndarray) -> "Spread":
        """By least squares over the draws, numbers in units of their standard errors.

        A prior of the size of all the scatter holds numbers that the draws hardly tell.
        """
        kept = [i for i, q in enumerate(known.quantities) if q.source != "robots"]
        std = np.array([known.quantities[i].std for i in kept])
        rows = known.samples[:, kept] / std
        rows, centred = rows - rows.mean(axis=0), shares - shares.mean()
        size = max(float(shares.std()), 1e-6)
        left = max(float(centred @ centred) / len(shares) / 2, 1e-9)
        gram = rows.T @ rows + left / size**2 * np.eye(len(kept))
        scaled = np.linalg.solve(gram, rows.T @ centred)
        # Errors of each model's share where the line is drawn through the others (Allen 1974).
        leverage = np.einsum("dp,pd->d", rows, np.linalg.solve(gram, rows.T)) + 1 / len(shares)
        missed = (centred - rows @ scaled) / np.maximum(1 - leverage, 1e-9)
        alone = centred / (1 - 1 / len(shares))  # by the mean of the others
        foretold = 1 - float(missed @ missed) / max(float(alone @ alone), 1e-12)
        slope = scaled / std
        names = [known.quantities[i].name for i in kept]
        return cls(names, known.covariance[np.ix_(kept, kept)], shares, slope, foretold)

    def std(self, covariance: np.ndarray) -> float:
        """Standard error of the share, as far as it is linear in the numbers."""
        return float(np.sqrt(self.slope @ covariance @ self.slope))

    def parts(self) -> dict[str, float]:
        """Share of the variance by number, largest first; with what goes together with it."""
        part = self.slope * (self.covariance @ self.slope)
        part = part / max(part.sum(), 1e-12)
        order = np.argsort(-np.abs(part))
        return {self.names[i]: float(part[i]) for i in order}

    def known_takes(self) -> dict[str, float]:
        """Share of the variance that goes where a number, and it alone, is known; largest first.

        Numbers that the fits tell together take the same part, so that their sum may exceed 1.
        """
        along = self.covariance @ self.slope
        takes = along**2 / np.maximum(np.diag(self.covariance) * (self.slope @ along), 1e-300)
        return {self.names[i]: float(takes[i]) for i in np.argsort(-takes)}


def spread_of(
    request: Request, goal: str, *, draws: int, seed: int, tell: Callable[[], None]
) -> Spread:
    """Runs models drawn from the request's uncertainty, with the same seeds, on all cores.

    Raises:
        ValueError: the model knows no errors, or all draws end alike.
    """
    file = file_of(request)
    known = ranges(file, file.model, draws, seed)
    asked = [replace(request, model_text=text) for text in drawn_models(request, draws, seed)]

    def share(one: Request) -> float:
        columns = run_part(one, range(one.world_count))
        tell()
        return float(reached(pa.table(columns), goal).mean())

    with ThreadPoolExecutor(available_cores()) as pool:
        shares = np.array(list(pool.map(share, asked)))
    found = Spread.of(known, shares)
    if found.std(found.covariance) < LEAST_STD:
        raise ValueError(
            f"{option('for', request.behavior)}: models drawn from what the fits leave open end "
            "alike "
            f"({shares.min():.0%} to {shares.max():.0%} reach the goal), so no run of a robot can "
            f"narrow that; design for what is missing, without {option('for')}."
        )
    return found


@dataclass(frozen=True)
class Narrowing:
    """The script and what is predicted of it.

    Attributes:
        spread: before it.
        goal: class that is wanted.
        moves, rows: the script.
        covariance: (P, P) of what a fit to it would leave.
        bound: (P, P) of what no fit could go below.
        untold: part of the variance by numbers that no drive of one robot shows.
        robot_id: of the log.
    """

    spread: Spread
    goal: str
    moves: list[Move]
    rows: Rows
    covariance: np.ndarray
    bound: np.ndarray
    untold: float
    robot_id: int

    @property
    def stds(self) -> tuple[float, float]:
        """Standard errors of the share, before the run and after it."""
        return self.spread.std(self.spread.covariance), self.spread.std(self.covariance)

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        before, after = self.stds
        return {
            "goal": self.goal,
            "share": float(self.spread.shares.mean()),
            "std_before": before,
            "std_after": after,
            "std_bound": self.spread.std(self.bound),
            "parts": self.spread.parts(),
            "known_takes": self.spread.known_takes(),
            "foretold": self.spread.foretold,
            "untold": self.untold,
            "draws": len(self.spread.shares),
            "moves": [m.name for m in self.moves],
            "duration_s": self.rows.end_s,
        }


def narrow(
    measurements: Sequence[Measurement | SteadyTable],
    file: ModelFile,
    limits: Limits,
    swarm: Request,
    *,
    draws: int,
    tell: Callable[[], None] = lambda: None,
) -> Narrowing:
    """Runs swarms of models that the fits leave open, and designs the run that narrows them most.

    Args:
        measurements: logs of one robot.
        file: of the model.
        limits: time, floor, duty.
        swarm: what is run.
        draws: models that are drawn.
        tell: is called after each of them.

    Raises:
        ValueError: no script of duties can be within these limits, or none would narrow it.
    """
    check(measurements, file, limits)
    if file.model.drive != "duty":
        raise ValueError(
            f"{option('for')}: the model is driven by {file.model.drive}, and what narrows a "
            "swarm's "
            f"prediction is a script of wheel duties; leave {option('for')} out."
        )
    goal = goal_of(swarm)
    spread = spread_of(swarm, goal, draws=draws, seed=1, tell=tell)
    logs = [o for o in open_measurements(measurements, file) if o.floor]
    excess = file.usual_score([o.measurement.log_sha256 for o in logs]) ** 2
    modelled = log_of([m for o in logs if isinstance(m := o.modelled(), ModelledLog)])
    return design_for(spread, goal, file=file, modelled=modelled, limits=limits, excess=excess)


def design_for(
    spread: Spread,
    goal: str,
    *,
    file: ModelFile,
    modelled: ModelledLog,
    limits: Limits,
    excess: float,
) -> Narrowing:
    """Designs the run.

    Args:
        spread: of the share over the numbers.
        goal: class that is wanted.
        file: of the model, as it will be fitted to the run.
        modelled: a log, whose clock, noise and rate of poses the next run is taken to have.
        limits: time, floor, duty; as `check` let them pass.
        excess: how much more errors scatter than the noise alone: the square of the usual score.

    Raises:
        ValueError: the share depends on numbers that no drive of one robot shows.
    """
    free = _told_by_drives(modelled.model, spread.names)
    place = [spread.names.index(p.name) for p in free]
    untold = sum(
        part for name, part in spread.parts().items() if name not in {p.name for p in free}
    )
    if not free or untold > 1 - 1e-3:
        names = ", ".join(list(spread.parts())[:3])
        raise ValueError(
            f"what the swarm does depends on {names}, which no drive of one robot shows; measure "
            "these by themselves (twinmill twin effects NAME)."
        )
    moves, floor = (
        family(duty_axes(limits.max_duty, modelled.model.wheel_kind)),
        Floor(limits, modelled, []),
    )
    prior = np.linalg.inv(spread.covariance)

    def left(grams: np.ndarray) -> np.ndarray:
        """(..., P, P) covariance after runs of these products, each with a clock of its own."""
        information = np.broadcast_to(prior, (*grams.shape[:-2], *prior.shape)).copy()
        rows, columns = np.ix_(place, place)
        information[..., rows, columns] += _without_clock(grams, len(free)) / excess
        return np.linalg.inv(information)

    def worth(grams: np.ndarray) -> np.ndarray:
        return -np.einsum("i,...ij,j->...", spread.slope, left(grams), spread.slope)

    nothing = np.zeros((len(free) + CLOCKS,) * 2)
    predicted = _products(
        Played.of([[m] for m in moves], modelled).modelled(modelled, CENTRE), free
    )
    chosen = _exchanged(
        choose(moves, worth, told=nothing, predicted=predicted, floor=floor),
        moves,
        worth_of=worth,
        predicted=predicted,
        floor=floor,
    )
    (whole,) = _products(Played.of([chosen], modelled).modelled(modelled, CENTRE), free)
    fits = _left_by_fits(spread, file, modelled, moves=chosen, excess=excess)
    robot_id = modelled.measurement.track.robot_id
    return Narrowing(
        spread=spread,
        goal=goal,
        moves=chosen,
        rows=rows_of(chosen),
        covariance=fits,
        bound=left(whole),
        untold=untold,
        robot_id=robot_id,
    )


def _left_by_fits(
    spread: Spread, file: ModelFile, modelled: ModelledLog, *, moves: list[Move], excess: float
) -> np.ndarray:
    """(P, P) covariance that fits to the run leave, mean over REPLICAS of it with noise."""
    planned = driven(moves, modelled)
    prior, noisy = np.linalg.inv(spread.covariance), modelled.model.copy()
    for name, value in (modelled.noise.to_json() if modelled.noise else {}).items():
        noisy.set(f"noise.{name}", value)
    left = []
    for seed in range(1, REPLICAS + 1):
        seen = planned.with_pose(native.replica(noisy, planned.played, seed))
        told = _fit_to(seen, file, spread.names)
        known = [name for name in told.names if name in spread.names]
        at = [told.names.index(name) for name in known]
        information = prior.copy()
        rows, columns = np.ix_(*[[spread.names.index(name) for name in known]] * 2)
        information[rows, columns] += np.linalg.inv(told.values[np.ix_(at, at)]) / excess
        left.append(np.linalg.inv(information))
    return np.mean(left, axis=0)


def driven(moves: list[Move], modelled: ModelledLog) -> Measurement:
    """The run as the log's robot would drive it."""
    return Played.of([moves], modelled).modelled(modelled, CENTRE).measurement


def _fit_to(seen: Measurement, file: ModelFile, names: list[str]) -> Covariance:
    """Covariance that a fit of all quantities to a measurement would give."""
    opened = judged(open_measurements([seen], file))
    model = file.model
    # One number stands for all speeds of the duty table, or they stand for it.
    rivals = duty_table(model) if BASE_GAINS[0] in names else [BASE_GAINS[0]]
    own = [name for name in base_names(model, opened) if name not in rivals]
    base = base_parameters(model, dict.fromkeys([*own, *(n for n in BASE_GAINS if n in names)]))
    _, fit = fitted(opened, [*base, *all_effect_parameters(model)])
    return fit.shared_covariance()


def _exchanged(
    chosen: list[Move],
    moves: list[Move],
    *,
    worth_of: Callable[[np.ndarray], np.ndarray],
    predicted: np.ndarray,
    floor: Floor,
) -> list[Move]:
    """One move for another as long as the whole run tells more and fits (Fedorov 1972).

    Moves chosen by what they tell per second leave time that a longer one would use.
    """
    place = {id(move): k for k, move in enumerate(moves)}
    run = [place[id(move)] for move in chosen]
    duration_s = np.array([move.duration_s for move in moves])
    most_s = floor.limits.duration_s - 2 * LEAD_S
    while True:
        whole, best = predicted[run].sum(axis=0), None
        least = worth_of(whole) * (1 - LEAST_GAIN)
        for at, old in enumerate(run):
            worth = worth_of(whole - predicted[old] + predicted)
            fits = duration_s <= most_s - duration_s[run].sum() + duration_s[old]
            for new in np.argsort(np.where(fits, worth, -np.inf))[::-1]:
                if not fits[new] or worth[new] <= least:
                    break
                changed = [*run[:at], int(new), *run[at + 1 :]]
                if floor.holds([moves[k] for k in changed]):
                    best, least = changed, worth[new]
                    break
        if best is None:
            return [moves[k] for k in run]
        run = best


def _told_by_drives(model: native.Model, names: list[str]) -> list[Parameter]:
    """Those of the numbers that the path of one robot shows."""
    base = [n for n in (*BASE_GAINS, LAG, *duty_table(model)) if n in names]
    effects = [p for p in all_effect_parameters(model) if p.name in names]
    return [*base_parameters(model, base), *effects]


def _products(planned: ModelledLog, free: list[Parameter]) -> np.ndarray:
    """(K, F + CLOCKS, F + CLOCKS) products of slopes of each part's errors, its clock's last."""
    system = System([planned], free)
    slopes = system.jacobian(system.start)[: -len(system.unknowns)]
    if not planned.clock_free:
        slopes = np.hstack([slopes, np.zeros((len(slopes), CLOCKS))])
    parts = [slice(3 * p.start, 3 * p.stop) for p in planned.grid.slices]
    return np.array([slopes[p].T @ slopes[p] for p in parts])


def _without_clock(grams: np.ndarray, count: int) -> np.ndarray:
    """(..., F, F) what is told of the numbers where the clock must be found from the same run."""
    own = grams[..., count:, count:] + 1e-9 * np.eye(CLOCKS)
    cross = grams[..., count:, :count]
    told = grams[..., :count, :count]
    return told - np.swapaxes(cross, -1, -2) @ np.linalg.solve(own, cross)
