# SPDX-License-Identifier: Apache-2.0
"""Other people's tables under our names and in our units, or what must be asked first."""

import math
from collections.abc import Collection, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from twinmill.arguments import option
from twinmill.data.importers.columns import (
    LEFT,
    Guess,
    Mapping,
    by_name,
    explain,
    is_usual,
    lacks,
    mapping_of,
    targets_of,
)
from twinmill.data.importers.side_by_side import in_rows
from twinmill.data.log import LogError
from twinmill.data.measurement_table import Table, read_header, read_table
from twinmill.data.packed_rows import PackedRows
from twinmill.data.units import UNITS, split_unit


def read_columns(path: Path, known: frozenset[str]) -> Table:
    """As `read_table`, robots that stand side by side in rows of their own."""
    return in_rows(read_table(path, known))


def _header(path: Path, known: frozenset[str]) -> list[str]:
    return in_rows(
        Table(path.name, read_header(path), PackedRows(), np.empty(0, int), known)
    ).header


def names_in(tables: Collection[Path], known: frozenset[str], rename: dict[str, str]) -> set[str]:
    """Columns of tables, by their own names, by new ones, and by ours where these say all."""
    names = {name for path in tables for name in _header(path, known)}
    names |= {new for old, new in rename.items() if old in names}
    return names | _ours(names, known)


def _ours(names: Iterable[str], known: frozenset[str]) -> set[str]:
    return {ours for name in names for ours in targets_of(name, known)}


def check_renames(
    rename: dict[str, str], tables: list[Path], known: frozenset[str], mapped: Collection[str] = ()
) -> None:
    """Raises LogError where an old name is in no table, or a new one has no meaning.

    Args:
        rename: column in a file, or one of ours as it was read, to ours.
        tables: the files.
        known: our columns.
        mapped: those that a mapping file names.
    """
    headers = {p.name: _header(p, known) for p in tables} if rename else {}
    names = {*rename.values(), *(name for header in headers.values() for name in header)}
    read = {*mapped, *_ours(names, known)}
    for old, new in rename.items():
        held = any(old in header for header in headers.values())
        if not held and not (old in read and by_name(new, known)):
            names = "; ".join(f"{name} has {', '.join(h)}" for name, h in headers.items())
            raise LogError(
                f"{option('rename', {old: new})}: no table has a column '{old}'"
                f"{f' ({names})' if names else ''}; correct the name."
            )
        if not is_usual(new, known):
            raise LogError(
                f"{option('rename', {old: new})}: {new} is not one of our columns; they are "
                f"{', '.join(sorted(known))}."
            )


def read_mapped(
    path: Path,
    known: frozenset[str],
    *,
    mapping: Mapping | None,
    rename: dict[str, str],
    topic: str | None = None,
) -> Table:
    """A table under our names and in our units.

    Args:
        path: CSV, `.gz` too.
        known: our columns that this kind of table has.
        mapping: what a person decided; None: names that say all, and `rename`.
        rename: column in the file to ours, which may have another unit (`yaw=theta_deg`); or one
            of ours, whatever it is called in the file, to another of ours (`x_m=y_m`).
        topic: whose columns are meant, in a table of several topics; None: there is one.

    Raises:
        LogError: as read_table; a column of the mapping is not there, one looks like ours and
            has no unit, or two hold one quantity.
    """
    table = read_columns(path, known)
    ours = {k: new for k, new in rename.items() if _is_of_ours(k, new, table.header, known)}
    if mapping is None:
        of_file = {k: new for k, new in rename.items() if k not in ours}
        guesses = explain(table, known, of_file, topic)
        for guess in guesses:
            if guess.rival:
                raise _rivals(table.name, guess)
        if unsure := [guess for guess in guesses if not guess.sure and guess.column]:
            raise _unsure(table.name, unsure)
        notes = [guess.note for guess in guesses if guess.note]
        table, mapping = replace(table, notes=table.notes + notes), mapping_of(guesses)
    gone = [s.column for s in mapping.values() if s.column and s.column not in table.header]
    if gone:
        raise LogError(
            f"{table.name}: the mapping names column '{gone[0]}', but the file has "
            f"{', '.join(table.header)}; correct the mapping."
        )
    return table.under(_renamed(table.name, mapping, ours, known))


def _is_of_ours(old: str, new: str, header: Collection[str], known: frozenset[str]) -> bool:
    """True if a new name is for one of our columns, and not for one of the file."""
    in_our_unit = new in known
    return old in known and (in_our_unit or (old not in header and bool(by_name(new, known))))


def _renamed(table: str, mapping: Mapping, ours: dict[str, str], known: frozenset[str]) -> Mapping:
    """Where each of our columns comes from, once one is taken for another, or of another unit."""
    named = {target: (target, source) for target, source in mapping.items()}
    for old, new in ours.items():
        if old not in mapping:
            continue
        (target, *_), factor = by_name(new, known)
        unit = {} if new in known else {"factor": factor}
        named[old] = target, replace(mapping[old], **unit)
        if target in mapping and target not in (old, *ours):
            raise LogError(
                f"{table}: {option('rename', {old: new})}: there is a {target} already; say what "
                "that one is "
                f"as well, as in {option('rename', {target: old})}."
            )
    return dict(named.values())


def _rivals(table: str, guess: Guess) -> LogError:
    if guess.rival == guess.column:
        return LogError(
            f"{table}: two columns are called '{guess.column}'; take one of them out of the file."
        )
    return LogError(
        f"{table}: columns '{guess.rival}' and '{guess.column}' hold one quantity; take one out of "
        f"the file, or choose with a {option('mapping')} file ({option('explain_columns')} "
        "writes one)."
    )


def _unsure(table: str, guesses: list[Guess]) -> LogError:
    """On the first of these; where it lacks but a unit, on all that lack no more."""
    guess = guesses[0]
    if not guess.targets:
        return LogError(f"{table}: column '{guess.column}' {guess.why} of the file.")
    target = guess.targets[0]
    if math.isnan(guess.factor):
        what, factor = lacks(target)
        return LogError(
            f"{table}: column '{guess.column}' is {what}, and ours is {target}; let "
            f"{option('explain_columns')} write down all columns, write the factor there "
            f"({factor}), "
            f"and give that to {option('mapping')}."
        )
    if guess.zero:
        return LogError(
            f"{table}: column '{guess.column}' {guess.why}; let {option('explain_columns')} write "
            "down "
            f"all columns, check factor and zero there, and give that to {option('mapping')}."
        )
    alike = [g for g in guesses if _lacks_unit(g)] if _lacks_unit(guess) else [guess]
    doubt = "no unit" if _lacks_unit(guess) else f"no name of ours, but may be {target}"
    more = " (or _mm, _deg, _ms, _pwm ...)" if _lacks_unit(guess) else ""
    said = ", ".join(f"'{g.column}' ({g.why})" for g in alike)
    have = (
        "columns {} have {}; say what they are" if alike[1:] else "column {} has {}; say what it is"
    )
    return LogError(
        f"{table}: {have.format(said, doubt)} with "
        f"{option('rename', {g.column: _in_likely_unit(g) for g in alike})}{more}, or let "
        f"{option('explain_columns')} write down all columns and give that to {option('mapping')}."
    )


def _lacks_unit(guess: Guess) -> bool:
    """True if only the unit of a column is unknown."""
    known = guess.targets and not math.isnan(guess.factor) and not guess.zero
    return bool(known and split_unit(guess.targets[0])[1])


def _in_likely_unit(guess: Guess) -> str:
    """Our name of a column, in the unit that it looks like."""
    stem, ours = split_unit(guess.targets[0])
    if len(guess.targets) > 1:  # both wheels of a side
        stem = "left" if guess.targets == LEFT else "right"
    unit = next((u for u, known in UNITS.items() if known == (ours, guess.factor)), ours)
    return f"{stem}_{unit}" if unit else guess.targets[0]
