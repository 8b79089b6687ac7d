# SPDX-License-Identifier: Apache-2.0
"""Effects that a model could lack, and how the errors change with each of their parameters."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import twinmill_native as native
from twinmill.calibration.freedom import catalogue
from twinmill.calibration.problem import Scene

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

    def columns(self, scenes: list[Scene], priors: int) -> np.ndarray:
        """(R, k) fall of the whitened errors per unit of each column, then zeros for the priors."""
        parts = []
        for scene in scenes:
            model = scene.model.copy()
            model.add_effect(self.effect)
            richer = scene.with_model(model)
            rows = np.array([self.origin, *self.target])
            names = [f"{_instance(model, self.effect)}.{n}" for n in self.names]
            white = richer.whitened(names, rows).reshape(len(rows), -1)
            parts.append((white[0] - white[1:]).T)
        columns = np.concatenate(parts)
        return np.concatenate([columns, np.zeros((priors, columns.shape[1]))]) / self._scale()

    def _scale(self) -> np.ndarray:
        """Length of each step, in the parameter's unit; 1 for a corner."""
        if self.corner:
            return np.ones(1)
        return np.array([t[i] - self.origin[i] for i, t in enumerate(self.target)])


def _instance(model: native.Model, effect: str) -> str:
    count = list(model.effects).count(effect)
    return effect if count == 1 else f"{effect}#{count}"


def candidates(
    scenes: list[Scene], barred: Collection[str] = ()
) -> tuple[list[Candidate], list[str]]:
    """Candidates for the scenes' model, and effects that leave no trace in these logs.

    Args:
        scenes: measurements with their models.
        barred: effects that are not to be thought of.
    """
    model = scenes[0].model
    found, blind = [], []
    for name, entry in catalogue().items():
        if name in model.effects or name in barred or entry["stage"] not in STAGES:
            continue
        if entry["duty_only"] and model.drive != "duty":
            continue
        if entry["texts"]:  # a formula is the user's own, and no candidate
            continue
        candidate, energy = _best_columns(scenes, entry)
        if np.any(energy > BLIND):
            found.append(candidate)
        else:
            blind.append(name)
    return found, blind


def _best_columns(scenes: list[Scene], entry: dict) -> tuple[Candidate, np.ndarray]:
    """Derivatives at the neutral value, or the way to the default where these say nothing of it."""
    smooth, corner = _smooth(entry), _corner(entry)
    columns, whole = smooth.columns(scenes, 0), corner.columns(scenes, 0)[:, 0]
    energy = np.sum(columns**2, axis=0) * smooth.strength**2
    foreseen = columns @ smooth.strength
    alike = foreseen @ whole / max(np.linalg.norm(foreseen) * np.linalg.norm(whole), 1e-12)
    longer = np.linalg.norm(foreseen) / max(np.linalg.norm(whole), 1e-12)
    if alike < ALIKE or not 1 / MISJUDGED < longer < MISJUDGED:
        return corner, np.array([whole @ whole])
    if not np.all(energy > BLIND):
        return _smooth(entry, energy > BLIND), energy
    return smooth, energy


def _smooth(entry: dict, shown: np.ndarray | None = None) -> Candidate:
    parameters = entry["parameters"]
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


def _corner(entry: dict) -> Candidate:
    parameters = entry["parameters"]
    return Candidate(
        entry["name"],
        tuple(p["name"] for p in parameters),
        tuple(p["neutral"] for p in parameters),
        (tuple(p["default"] for p in parameters),),
        np.ones(1),
        True,
    )
