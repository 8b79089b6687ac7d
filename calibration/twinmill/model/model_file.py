# SPDX-License-Identifier: Apache-2.0
"""Model files: read by the twin's own reader."""

import difflib
import hashlib
import math
import tomllib
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import twinmill_native as native

from twinmill.files import replacing
from twinmill.foreign_text import first_line
from twinmill.model.covariance import Covariance

UNSURE = 0.05  # share of a speed: one that is told worse may be anything


class ModelError(ValueError):
    """A model file that cannot be read or written; the message is one sentence."""


@dataclass(frozen=True)
class ModelFile:
    """A model and the text it was read from."""

    path: Path
    text: str
    model: native.Model

    @classmethod
    def load(cls, name: str) -> "ModelFile":
        """Looks in the working directory, then among the installed models.

        Raises:
            ModelError: no such file, or it is no valid model.
        """
        try:
            path = Path(native.find_model_file(str(name)))
            text = path.read_text()
        except UnicodeDecodeError as error:
            raise ModelError(
                f"{name}: is no text, so it is no model file; check the name."
            ) from error
        except (ValueError, OSError) as error:
            raise ModelError(str(error).replace(str(name), first_line(name))) from error
        return cls.of_text(path, text, str(name))

    @classmethod
    def of_text(cls, path: Path, text: str, name: str) -> "ModelFile":
        """A model that somebody wrote.

        Args:
            path: of its file.
            text: TOML.
            name: in errors.

        Raises:
            ModelError: it is no valid model.
        """
        try:
            loaded = cls.of(path, text, name)
        except ValueError as error:
            raise ModelError(str(error).replace(name, first_line(name))) from error
        if "base" not in loaded._document:
            raise ModelError(
                f"{name}: has no section [base], so it does not say what the commands are nor how "
                "the robot follows them; write one, or make a model file with twinmill guide."
            )
        return loaded

    @classmethod
    def of(cls, path: Path, text: str, origin: str = "") -> "ModelFile":
        """A model that is in no file yet.

        Args:
            path: where it will be.
            text: TOML.
            origin: named in errors; by default the path.

        Raises:
            ValueError: it is no valid model.
        """
        return cls(path, text, native.Model.from_toml(text, origin or str(path)))

    def write(self, force: bool = True) -> None:
        """Writes its file, whole or not at all; `force` replaces one that is there.

        Raises:
            ModelError: it cannot be written.
        """
        write_whole(self.path, self.text, force)

    @cached_property
    def _document(self) -> dict[str, Any]:
        """Parsed text without its layout, which takes tomlkit long to read."""
        return tomllib.loads(self.text)

    @property
    def clock_logs(self) -> list[str]:
        """Hashes (sha256) of the logs that told the clock offset."""
        return list(self._document.get("clock", {}).get("fitted_on", []))

    def clock_std_s(self, log_sha256: Collection[str]) -> float:
        """How well other logs told the clocks' offset; 0 where none did, or clocks are one."""
        clock = self._document.get("clock", {})
        if clock.get("same") or not self.clock_logs or set(self.clock_logs) & set(log_sha256):
            return 0.0
        return float(clock.get("std", {}).get("offset_s", 0.0))

    def known_from_other_logs(self, log_sha256: Collection[str]) -> set[str]:
        """Names of the base quantities that were fitted, and on none of these logs."""
        base = self._document.get("base", {})
        if not base.get("fitted_on") or set(base["fitted_on"]) & set(log_sha256):
            return set()
        told = set()
        for key, std in base.get("std", {}).items():
            told |= (
                {f"base.{key}.{i}" for i, s in enumerate(std) if not math.isnan(s)}
                if isinstance(std, list)
                else {f"base.{key}"}
            )
        return told

    def unsure_speeds(self) -> dict[str, float]:
        """Speeds of the duty table that logs told badly, or not at all, and their std in m/s."""
        table = self._document.get("base", {}).get("std", {}).get("wheel_speed_mps", ())
        found = {}
        for i, std in enumerate(table):
            name = f"base.wheel_speed_mps.{i}"
            speed_mps = self.model.get(name) if i else 0.0
            if speed_mps > 0 and not std < UNSURE * speed_mps:
                found[name] = float("inf") if math.isnan(std) else float(std)
        return found

    def fitted_on(self, log_sha256: Collection[str]) -> bool:
        """True if the base was fitted to one of these very logs."""
        base = self._document.get("base", {})
        return bool(set(base.get("fitted_on", [])) & set(log_sha256))

    def usual_score(self, log_sha256: Collection[str]) -> float:
        """Score that the model reached on the other logs it was fitted to; 1 without any.

        No less than 1: on its own log a fit can look better than it is.
        """
        score = self.fit.get("score_after")
        if score is None or not self.known_from_other_logs(log_sha256):
            return 1.0
        return max(1.0, float(score))

    def left_over(self, log_sha256: Collection[str]) -> dict[str, float]:
        """Residual structure in other logs: fall of chi2 per step by what it depends on."""
        table = self.fit.get("left_over", {})
        if set(table.get("fitted_on", [])) & set(log_sha256):
            return {}
        return {str(g): float(v) for g, v in table.items() if g != "fitted_on"}

    @property
    def recorded_noise(self) -> dict[str, float]:
        """Noise that a fit recorded, by key: sensor_m, sensor_rad, drive_mps and others."""
        return {key: float(v) for key, v in self._document.get("noise", {}).items()}

    @property
    def noise_speed_mps(self) -> float:
        """RMS speed of the log that told the noise, while it drove; 0 where that is not known."""
        return float(self.fit.get("noise_speed_mps", 0.0))

    @property
    def fit(self) -> dict[str, Any]:
        """Record of the last fit: `logs`, scores, and tables that others keep there."""
        return dict(self._document.get("fit", {}))

    @property
    def fitted_logs(self) -> str:
        """Names of the logs that it was fitted to, of many the first; empty without a fit."""
        first, *others = self.fit.get("logs", []) or [""]
        return f"{first} and {len(others)} more" if len(others) > 1 else ", ".join([first, *others])

    @property
    def covariance(self) -> Covariance:
        """Covariance of the estimates; empty without a fit, or in a file of an older version.

        Raises:
            ModelError: what stands there is none, or is of quantities that the model has not.
        """
        table = self.fit.get("covariance", {})
        try:
            found = Covariance.from_toml(table)
        except ValueError as error:
            raise ModelError(f"{self.path}: [fit.covariance] {error}") from error
        known = quantity_names(self.model)
        for name in found.names:
            if name not in known:
                near = difflib.get_close_matches(name, sorted(known), n=1)
                hint = f"; the nearest known is '{near[0]}'" if near else ""
                raise ModelError(
                    f"{self.path}: [fit.covariance] '{name}' is no quantity of this model{hint}."
                )
        return found

    @property
    def hash(self) -> str:
        """Hash of the text, by which a child names its parent."""
        return hashlib.sha256(self.text.encode()).hexdigest()


def quantity_names(model: native.Model) -> set[str]:
    """Names of all quantities; those of effects as `wheel_gain.fl`."""
    return {v["name"] for v in model.values()}


def write_whole(path: Path, text: str, force: bool = True) -> None:
    """Writes a file through a temporary one beside it; `force` replaces one that is there.

    Raises:
        ModelError: the folder does not exist or cannot be written.
    """
    try:
        with replacing(path, force) as temporary:
            temporary.write_text(text)
    except ValueError as error:
        raise ModelError(str(error)) from error
