# SPDX-License-Identifier: Apache-2.0
"""Positions and commands of joints from tables: CSV, npz, and LeRobot's Parquet."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from twinmill.arguments import option
from twinmill.data.lcm_log import LogError
from twinmill.data.measurement_table import TIMES
from twinmill.data.units import UNITS, plain_name, split_unit, unit_of_stamps
from twinmill.extras import needing
from twinmill.joints.files import COMMAND, POSITION, TIME, VELOCITY
from twinmill.joints.importers.signals import Recording, Signal

OBSERVED, ACTION = "observation.state", "action"  # of LeRobot's data sets, v2 and v3
STAMP, EPISODE = "timestamp", "episode_index"
INFO = Path("meta") / "info.json"  # above a data set's files: names of what these hold
DELIMITERS = (",", ";", "\t")
SHOWN = 8  # names in a sentence


def read_table(path: Path, stamp: str = "") -> list[Recording]:
    """The run of a table, or those of the episodes of a data set.

    Args:
        path: of the file.
        stamp: the column of a CSV that is its time; empty for the only one that may be.

    Raises:
        LogError: it cannot be read, or has no stamps.
        MissingExtra: Parquet, and its package is not installed.
    """
    try:
        if path.suffix == ".parquet":
            return _episodes(path)
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as held:
                return [_arrays({key: held[key] for key in held.files}, path.name)]
        with path.open(encoding="utf-8-sig") as stream:
            head = stream.readline()
        table = pd.read_csv(path, sep=max(DELIMITERS, key=head.count), skipinitialspace=True)
    except (OSError, ValueError, UnicodeDecodeError, pd.errors.ParserError) as error:
        if isinstance(error, LogError):
            raise
        said = " ".join(str(error).split())
        raise LogError(
            f"{path}: cannot be read ({said}); give a CSV with a line of names, npz, LeRobot's "
            "Parquet, or a ROS bag."
        ) from error
    return [_columns(table, path.name, stamp)]


def _columns(table: pd.DataFrame, name: str, stamp: str) -> Recording:
    """Each column that holds numbers, at the stamps of the one that is time."""
    table.columns = [str(c).strip() for c in table.columns]
    if stamp in table.columns:
        unit = split_unit(stamp)[1]
    else:
        stamp, unit = _stamp(list(table.columns), name)
    t_s, notes = _seconds(table[stamp], unit, name, stamp)
    numbers = [c for c in table.columns if c != stamp and pd.api.types.is_numeric_dtype(table[c])]
    signals = [Signal(c, "", c, t_s, table[c].to_numpy(float)) for c in numbers]
    return Recording(name, signals, notes)


def _stamp(columns: list[str], name: str) -> tuple[str, str]:
    """The column of stamps, and its unit if it says one."""
    if TIME in columns:
        return TIME, "s"
    likely = [(c, split_unit(c)) for c in columns if plain_name(c) in TIMES]
    likely += [(c, (stem, unit)) for c in columns for stem, unit in [split_unit(c)]
               if stem in TIMES and unit and UNITS[unit][0] == "s"]  # fmt: skip
    if len(dict(likely)) != 1:
        told = f"each of {', '.join(dict(likely))}" if likely else "none"
        raise LogError(
            f"{name}: {told} of its columns may be the time ({', '.join(columns[:SHOWN])}); call "
            f"one of them {TIME}, in seconds, with {option('rename', f'OLD={TIME}')}."
        )
    return likely[0][0], likely[0][1][1]


def _seconds(
    given: pd.Series, unit: str, name: str, column: str
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Stamps in s, as the file counts them, or since 1970.

    Raises:
        LogError: they are neither numbers nor dates.
    """
    if pd.api.types.is_numeric_dtype(given):
        values = given.to_numpy(float)
        said = unit or unit_of_stamps(float(np.nanmax(np.abs(values))))
        notes = () if unit or said == "s" else (f"{name}: '{column}' is taken to be in {said}.",)
        return values * UNITS[said][1], notes
    try:
        dates = pd.to_datetime(given).to_numpy("datetime64[ns]").astype(np.int64)
    except (ValueError, TypeError) as error:
        raise LogError(
            f"{name}: column '{column}' is neither numbers nor dates ({given.iloc[0]}); give "
            "seconds."
        ) from error
    return dates * 1e-9, ()


def _arrays(held: Mapping[str, np.ndarray], name: str) -> Recording:
    """Arrays by the names of `JointLog`; those of names if they are there.

    Raises:
        LogError: one is missing, or has another number of rows.
    """
    for needed in (TIME, "ctrl", "qpos"):
        if needed not in held:
            raise LogError(
                f"{name}: has no array '{needed}', but {', '.join(held) or 'none'}; save t_s, "
                "ctrl and qpos."
            )
    t_s, signals = np.asarray(held[TIME], float).reshape(-1), []
    for key, kind, names in (
        ("qpos", POSITION, "joints"),
        ("qvel", VELOCITY, "joints"),
        ("ctrl", COMMAND, "actuators"),
    ):
        if key in held:
            told = [str(n) for n in np.atleast_1d(held[names])] if names in held else []
            signals += _table(name, key, kind, t_s, columns=held[key], names=told)
    return Recording(name, signals)


def _table(
    file: str, source: str, kind: str, t_s: np.ndarray, *, columns: np.ndarray, names: list[str]
) -> list[Signal]:
    """A signal of each column of an array.

    Raises:
        LogError: it has other numbers of rows or columns than there are stamps or names.
    """
    table = np.asarray(columns, float)
    table = table[:, None] if table.ndim == 1 else table
    if table.ndim != 2 or len(table) != len(t_s):
        raise LogError(
            f"{file}: {source} is of shape {np.shape(columns)}, and there are {len(t_s)} stamps; "
            "it needs one row for each."
        )
    if names and len(names) != table.shape[1]:
        raise LogError(
            f"{file}: {source} has {table.shape[1]} columns, and there are {len(names)} names for "
            "them; give one for each."
        )
    return [
        Signal(f"{source}[{k}]", kind, names[k] if names else "", t_s, column)
        for k, column in enumerate(table.T)
    ]


def _episodes(path: Path) -> list[Recording]:
    """A recording of each episode of LeRobot's.

    Raises:
        LogError: a column is missing.
    """
    with needing("export"):  # slow to import
        import pyarrow.parquet as parquet
    there = parquet.read_schema(path).names
    missing = [c for c in (STAMP, OBSERVED, ACTION) if c not in there]
    if missing:
        raise LogError(
            f"{path.name}: has no column '{missing[0]}', as LeRobot's data has; its columns are "
            f"{', '.join(there[:SHOWN])}."
        )
    wanted = [c for c in (STAMP, OBSERVED, ACTION, EPISODE) if c in there]
    table = parquet.read_table(path, columns=wanted).to_pandas()
    names = _names(path)
    groups = table.groupby(EPISODE) if EPISODE in table else [("", table)]
    found = []
    for episode, rows in groups:
        own = f"{path.name} episode {episode}" if len(groups) > 1 else path.name
        t_s = rows[STAMP].to_numpy(float)
        signals = []
        for key, kind in ((OBSERVED, POSITION), (ACTION, COMMAND)):
            columns, told = np.stack(list(rows[key])), names.get(key, [])
            signals += _table(own, key, kind, t_s, columns=columns, names=told)
        found.append(Recording(own, signals))
    return found


def _names(path: Path) -> dict[str, list[str]]:
    """Names of what a data set's arrays hold; empty where it does not say."""
    for folder in path.absolute().parents:
        if (folder / INFO).is_file():
            features = json.loads((folder / INFO).read_text(encoding="utf-8")).get("features", {})
            return {key: _flat(f.get("names")) for key, f in features.items()}
    return {}


def _flat(names: object) -> list[str]:
    """A list of names, which some versions put into a mapping."""
    if isinstance(names, Mapping):
        names = next(iter(names.values()), [])
    return [str(n) for n in names] if isinstance(names, list) else []
