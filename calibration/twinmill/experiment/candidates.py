# SPDX-License-Identifier: Apache-2.0
"""Effects that a model could lack, and how the errors change with each of their parameters."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
import twinmill_native as native

from twinmill.model.parameters import catalogue_of
from twinmill.predict.modelled_log import ModelledLog

STAGES = ("duty", "wheel", "ground", "observe")
SMALL = 0.05  # of a parameter's plausible strength: the step of a derivative
ALIKE, MISJUDGED = 0.5, 3.0  # cosine and ratio beyond which a derivative says nothing of the whole
BLIND = 1e-9  # of chi2: a column that is smaller does not show


@dataclass(frozen=True)
class Candidate:
    """One effect.

    Attributes:
        effect: its name.
        names: parameters that act near the neutral value; all if the effect starts at a corner.
        origin: (k,) values from which the steps are taken.
        target: (k, parameters) values stepped to; a corner's one step goes to all defaults.
        corner: nothing happens near the neutral value, so the whole way to the default is taken.
        strength: (k,) plausible strength in units of the columns.
    """

    effect: str
    names: tuple[str, ...]
    origin: tuple[float, ...]
    target: tuple[tuple[float, ...], ...]
    strength: np.ndarray
    corner: bool

    def columns(self, logs: list[ModelledLog], without: list[np.ndarray]) -> np.ndarray:
        """(R, k) fall of the whitened errors per unit of each column.

        Args:
            logs: measurements with their models.
            without: (S, 3) whitened errors of each without the effect: those at its neutral values.
        """
        parts = []
        for modelled, white in zip(logs, without, strict=True):
            model = modelled.model.copy()
            model.add_effect(self.effect)
            names = [f"{_instance(model, self.effect)}.{n}" for n in self.names]
            moved = modelled.with_model(model).whitened(names, np.array(self.target))
            parts.append((white - moved).reshape(len(moved), -1).T)
        return np.concatenate(parts) / self._scale()

    def _scale(self) -> np.ndarray:
        """Length of each step, in the parameter's unit; 1 for a corner."""
        if self.corner:
            return np.ones(1)
        return np.array([t[i] - self.origin[i] for i, t in enumerate(self.target)])


def _instance(model: native.Model, effect: str) -> str:
    count = list(model.effects).count(effect)
    return effect if count == 1 else f"{effect}#{count}"


def candidates(
    logs: list[ModelledLog], excluded: Collection[str] = ()
) -> tuple[list[tuple[Candidate, np.ndarray]], list[str]]:
    """Candidates with their columns (R, k), and effects that leave no trace in these logs.

    Args:
        logs: measurements with their models.
        excluded: effects that are not to be thought of.
    """
    model = logs[0].model
    without = [s.white_errors() for s in logs]
    found, blind = [], []
    for name, entry in catalogue_of(model).items():
        if name in model.effects or name in excluded or entry["stage"] not in STAGES:
            continue
        if entry["texts"]:  # a formula is the user's own, and no candidate
            continue
        candidate, columns = _best_columns(logs, entry, without)
        if np.any(_energy(candidate, columns) > BLIND):
            found.append((candidate, columns))
        else:
            blind.append(name)
    return found, blind


def _best_columns(
    logs: list[ModelledLog], entry: dict[str, Any], without: list[np.ndarray]
) -> tuple[Candidate, np.ndarray]:
    """Derivatives at the neutral value, or the way to the default where these say nothing of it."""
    smooth, corner = _smooth(entry), _corner(entry)
    columns, whole = smooth.columns(logs, without), corner.columns(logs, without)
    predicted = columns @ smooth.strength
    size, reached = float(np.linalg.norm(predicted)), float(np.linalg.norm(whole))
    alike = predicted @ whole[:, 0] / max(size * reached, 1e-12)
    if alike < ALIKE or not 1 / MISJUDGED < size / max(reached, 1e-12) < MISJUDGED:
        return corner, whole
    shown = _energy(smooth, columns) > BLIND
    return (smooth, columns) if shown.all() else (_smooth(entry, shown), columns[:, shown])


def _energy(candidate: Candidate, columns: np.ndarray) -> np.ndarray:
    """(k,) fall of chi2 if each parameter had its plausible strength."""
    return np.sum(columns**2, axis=0) * candidate.strength**2


def _smooth(entry: dict[str, Any], shown: np.ndarray | None = None) -> Candidate:
    # One whose usual value does nothing has no plausible strength, and no derivative is taken.
    parameters = [p for p in entry["parameters"] if p["default"] != p["neutral"]]
    if shown is not None:
        parameters = [p for p, s in zip(parameters, shown, strict=True) if s]
    origin = tuple(p["neutral"] for p in parameters)
    strength = np.array([p["default"] - p["neutral"] for p in parameters])
    target = tuple(
        tuple(
            o + SMALL * s * (i == k) for k, (o, s) in enumerate(zip(origin, strength, strict=True))
        )
        for i in range(len(origin))
    )
    return Candidate(
        entry["name"], tuple(p["name"] for p in parameters), origin, target, strength, False
    )


def _corner(entry: dict[str, Any]) -> Candidate:
    parameters = entry["parameters"]
    return Candidate(
        entry["name"],
        tuple(p["name"] for p in parameters),
        tuple(p["neutral"] for p in parameters),
        (tuple(p["default"] for p in parameters),),
        np.ones(1),
        True,
    )
