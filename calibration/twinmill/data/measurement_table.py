# SPDX-License-Identifier: Apache-2.0
"""Text tables of measurements, turned to numbers with errors that name the row."""

import codecs
import csv
import difflib
import gzip
import io
import re
from array import array
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import TextIO

import numpy as np

from twinmill.arguments import option
from twinmill.data.log import LogError
from twinmill.data.nameless import messages, trajectory, whole
from twinmill.data.other_files import GZIP, other_file
from twinmill.data.packed_rows import PackedRows
from twinmill.data.units import UNITS, split_unit
from twinmill.data.unpacking import BoundedText

DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}
DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")
THOUSANDS = re.compile(r"\s*[+-]?\d{1,3},\d{3}\s*")
OF_EXCEL = re.compile(r"\s*sep=.\s*", re.IGNORECASE)  # a first line that tells Excel the delimiter
DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d")
DAY_FIRST = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})[T ]+(\d{1,2}:\d\d:\d\d)(?:[.,](\d+))?")
SLASHED = re.compile(  # day and month in the order that the rows tell
    r"(\d{1,2})/(\d{1,2})/(\d{4})[T, ]+(\d{1,2}):(\d\d:\d\d)(?:[.,](\d+))?\s*(?:([AP])M)?",
    re.IGNORECASE,
)
MONTHS = 12  # a larger number is the day
# As programs write them into names of files: all parts in digits, which alone would be a number.
DIGITS = re.compile(
    r"(20\d\d)[_./-]?([01]\d)[_./-]?([0-3]\d)[_T -]?([0-2]\d)[_:.-]?([0-5]\d)[_:.-]?([0-5]\d)"
    r"(?:[_.,:-]?(\d{1,9}))?Z?"
)
TIME_OF_DAY = re.compile(r"\d{1,2}:\d\d:\d\d")
MINUTES = re.compile(r"\d{1,2}:\d\d[.,]\d+")  # and seconds, as Excel shows a time of day
HOUR_S, DAY_S = 3600, 86_400
DAYS = ("date", "day", "datum", "fecha")  # names of columns that hold no time of day
UNITLESS = ("-", "1", "#", "id")  # as they stand in a row of units
LOST = ("", "nan", "null", "none", "na", "n/a", "#n/a", "-")  # as programs write a lost one
FLAGS = {"true": 1.0, "yes": 1.0, "false": 0.0, "no": 0.0}
TIMES = (  # as people name it
    *("t", "time", "timestamp", "stamp", "secs", "frame_time", "__time", "elapsed"),
    "elapsed_time",
)
OF_PANDAS = "Unnamed: 0"  # what pandas calls such a first column, the rows' index
UNNAMED = "column_{}"  # what columns are called in a file that does not name them
BEGINNING_BYTES = 65536  # tell the encoding
MOSTLY = 0.9
NEAR = 0.5  # likeness of names from which one is proposed for the other
OF_TUM = "it has no names; read as a trajectory of TUM: time, x, y, z and a quaternion, w last"
WIDE = 5  # times as many cells in a row as there are rows: of no table of samples
FEWEST_ROWS = 10  # from which on a last cell that is shorter than all above it was cut


@contextmanager
def open_text(path: Path) -> Iterator[TextIO]:
    """Opens a text file, `.gz` too; on a terminal with a progress bar.

    Raises:
        LogError: it cannot be read, is no text or another kind of file, ends in `.gz` and is not
            gzip, unpacks to too much, or has a line without an end.
    """
    from twinmill.terminal import progress_bar  # slow to import, and logs need none

    try:
        with (
            progress_bar(counted=False) as progress,
            progress.open(path, "rb", description=path.name) as raw,
        ):
            buffered = io.BufferedReader(raw, BEGINNING_BYTES)
            is_packed = path.suffix == ".gz" or buffered.peek().startswith(GZIP)
            binary = gzip.GzipFile(fileobj=buffered) if is_packed else buffered
            bounded = BoundedText(path, binary, path.stat().st_size if is_packed else None)
            buffered = io.BufferedReader(bounded, BEGINNING_BYTES)
            beginning, encoding = buffered.peek()[:BEGINNING_BYTES], _encoding(buffered)
            other = other_file(beginning)
            if (
                not other
                and encoding.startswith("utf-8")
                and b"\0" in beginning.partition(b"\n")[0]
            ):
                other = "a binary file", "export it as CSV from the program that wrote it"
            if other:
                what, remedy = other
                raise LogError(f"{path}: is {what}, not a table of text; {remedy}.")
            yield io.TextIOWrapper(buffered, encoding, newline="")
    except (OSError, EOFError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise LogError(
            f"{path}: cannot be read as text ({reason}); check the name and the format."
        ) from error


def _encoding(binary: io.BufferedReader) -> str:
    """By the first bytes: what is no Unicode is Windows' Western encoding.

    UTF-16 has a mark, or every second byte of the digits is zero.
    """
    beginning = binary.peek()[:BEGINNING_BYTES]
    if beginning.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    for encoding, first in (("utf-16-le", 1), ("utf-16-be", 0)):
        high = beginning[first::2]
        if high.count(0) > MOSTLY * len(high) and not beginning[1 - first :: 2].count(0):
            return encoding
    try:
        codecs.getincrementaldecoder("utf-8")().decode(beginning)
    except UnicodeDecodeError:
        return "cp1252" if b"\0" not in beginning else "utf-8"
    return "utf-8-sig"


class CellError(LogError):
    """A cell of a row that is no measurement; the rows of other robots may well be.

    Attributes:
        row: its cells.
        line: of the file that it stands in.
    """

    def __init__(self, sentence: str, table: "Table", k: int) -> None:
        super().__init__(sentence)
        self.row, self.line = table.rows[k], table.line[k]


@dataclass(frozen=True)
class Table:
    """Cells of a file with one header row; row k is line `line[k]` of the file."""

    name: str
    header: list[str]
    rows: PackedRows
    line: np.ndarray
    known: frozenset[str]  # columns that have a meaning: never proposed for renaming
    factor: dict[str, float] = field(default_factory=dict)  # of columns in another unit
    zero: dict[str, float] = field(default_factory=dict)  # what stands for nothing, if not 0
    notes: list[str] = field(default_factory=list)  # sentences on how the file was read
    constants: frozenset[str] = frozenset()  # columns that the file lacks, of one value
    can_rename: bool = True  # who asked for it may name its columns beside the file

    def under(self, sources: dict) -> "Table":
        """Table renamed and in other units; columns that nobody names stay."""
        place = {name: k for k, name in enumerate(self.header)}
        taken = {source.column for source in sources.values()}
        rest = [name for name in self.header if name not in taken and name not in sources]
        rows = self.rows.rearranged(
            [
                *(place[s.column] if s.column else repr(float(s.value)) for s in sources.values()),
                *(place[name] for name in rest),
            ]
        )
        factor = {name: source.factor for name, source in sources.items()}
        zero = {name: source.zero for name, source in sources.items()}
        constants = frozenset(name for name, source in sources.items() if not source.column)
        return replace(
            self,
            header=[*sources, *rest],
            rows=rows,
            factor=factor,
            zero=zero,
            constants=constants,
        )

    def has(self, *columns: str) -> bool:
        """True if all these columns are there."""
        return set(columns) <= set(self.header)

    @property
    def strange(self) -> list[str]:
        """Names of columns that no importer knows."""
        return [name for name in self.header if name not in self.known]

    def where(self, kept: np.ndarray) -> "Table":
        """Some of the rows, (rows,) bool."""
        index = np.flatnonzero(kept)
        return replace(self, rows=self.rows.at(index), line=self.line[index])

    def cells(self, column: str) -> list[str]:
        """(rows,) texts of a column.

        Raises:
            LogError: it is missing.
        """
        return [cell.strip() for cells in self.rows.parts(self._place(column)) for cell in cells]

    def _place(self, column: str) -> int:
        if column not in self.header:
            raise self.missing(column)
        return self.header.index(column)

    def numbers(self, column: str, empty_is_nan: bool = False) -> np.ndarray:
        """(rows,) floats of a column.

        Args:
            column: its name.
            empty_is_nan: take empty cells, LOST words and infinity for lost measurements.

        Raises:
            LogError: the column is missing.
            CellError: a cell is no number (its row is named).
        """
        values, begin = np.empty(len(self.rows)), 0
        for cells in self.rows.parts(self._place(column)):
            end = begin + len(cells)
            values[begin:end] = self._numbers_in(cells, column, begin, empty_is_nan)
            begin = end
        if empty_is_nan:
            values[np.isinf(values)] = np.nan
        return (values - self.zero.get(column, 0.0)) * self.factor.get(column, 1.0)

    def _numbers_in(
        self, cells: list[str], column: str, begin: int, empty_is_nan: bool
    ) -> np.ndarray:
        """Numbers in some cells of a column; the first is of row `begin`."""
        if empty_is_nan:
            cells = ["nan" if cell.strip().lower() in LOST else cell for cell in cells]
        try:
            values = np.fromiter(map(float, cells), float, len(cells))
            if "_" in "".join(cells):
                raise ValueError(column)
        except ValueError:
            bad = next(k for k, cell in enumerate(cells) if not is_number(cell))
            raise CellError(
                f"{self.name}: row {self.line[begin + bad]}: {column} is '{cells[bad].strip()}', "
                "not a number; correct or remove the row.",
                self,
                begin + bad,
            ) from None
        return values

    def finite(self, column: str) -> np.ndarray:
        """Like numbers, but NaN and infinity are errors too."""
        values = self.numbers(column)
        if not np.isfinite(values).all():
            k = int(np.isfinite(values).argmin())
            raise CellError(self._refusal(k, column, values[k], "must be a finite number"), self, k)
        return values

    def flags(self, column: str) -> np.ndarray:
        """(rows,) 0 or 1 of a column of numbers, or of true and false, yes and no."""
        cells = [cell.lower() for cell in self.cells(column)]
        if set(cells) <= set(FLAGS):
            return np.array([FLAGS[cell] for cell in cells])
        return self.finite(column)

    def is_dated(self, column: str) -> bool:
        """True if a column holds dates with times, or times of day."""
        first = self.rows[0][self._place(column)].strip()
        kinds = (DATE, DAY_FIRST, SLASHED, TIME_OF_DAY)
        whole = DIGITS.fullmatch(first) or MINUTES.fullmatch(first)
        return any(kind.match(first) for kind in kinds) or bool(whole)

    def seconds(self, column: str) -> np.ndarray:
        """(rows,) s of a column of numbers, dates or times of day.

        Dates are ISO 8601, in digits alone (20260105_100030_020), day, month and year with points
        between, or these with slashes, where a day above 12 tells the order; UTC if they name no
        zone. Times of day go on over midnight, and minutes and seconds over the hour.

        Raises:
            LogError: no day tells the order.
            CellError: a cell is no time.
        """
        if not self.is_dated(column):
            return self.finite(column)
        import pandas as pd  # slow to import

        cells, period_s = self._with_days(self.cells(column)), DAY_S
        if MINUTES.fullmatch(cells[0]):
            cells, period_s = [f"0:{cell.replace(',', '.')}" for cell in cells], HOUR_S
        cells = _of_digits(self._of_slashed([_day_last(cell) for cell in cells], column))
        if DATE.match(cells[0]):
            stamps = pd.to_datetime(pd.Series(cells), format="ISO8601", utc=True, errors="coerce")
            spans = stamps - pd.Timestamp(0, tz="UTC")
        else:
            spans = pd.to_timedelta(pd.Series(cells), errors="coerce")
        if spans.isna().any():
            bad = int(spans.isna().to_numpy().argmax())
            raise CellError(
                f"{self.name}: row {self.line[bad]}: {column} is '{cells[bad]}', no time like the "
                "rows before; correct or remove the row.",
                self,
                bad,
            )
        seconds = (spans // pd.Timedelta(microseconds=1)).to_numpy(float) / 1e6
        return seconds if DATE.match(cells[0]) else np.unwrap(seconds, period=period_s)

    def _with_days(self, cells: list[str]) -> list[str]:
        """Times of day with the days that stand in a column of their own, if there is one."""
        day = next((name for name in self.header if name.strip().lower() in DAYS), None)
        if day is None or not TIME_OF_DAY.match(cells[0]):
            return cells
        return [f"{date} {time}" for date, time in zip(self.cells(day), cells, strict=True)]

    def _of_slashed(self, cells: list[str], column: str) -> list[str]:
        """Dates with slashes as ISO 8601 has them, if the first cell is one; else as they are."""
        found = [SLASHED.fullmatch(cell.strip()) for cell in cells]
        if not found[0]:
            return cells
        day = next((n for m in found if m for n in (1, 2) if int(m[n]) > MONTHS), None)
        if day is None:
            raise LogError(
                f"{self.name}: {column} is '{cells[0].strip()}', and no row tells whether the day "
                "or the month comes first; write the year first, 2026-01-31 10:00:30, as with "
                "pandas: pd.to_datetime(COLUMN, dayfirst=True)."
            )
        return [_iso(m, day) if m else cell for m, cell in zip(found, cells, strict=True)]

    def refuse(self, bad: np.ndarray, column: str, values: np.ndarray, why: str) -> None:
        """Raises LogError on the first row that is bad, with its value and why."""
        if bad.any():
            k = int(np.argmax(bad))
            raise LogError(self._refusal(k, column, values[k], why))

    def _refusal(self, k: int, column: str, value: float, why: str) -> str:
        return (
            f"{self.name}: row {self.line[k]}: {column} is {value:g}, but {why}; correct or remove "
            "the row."
        )

    def missing(self, column: str) -> LogError:
        """The error to raise where this column is needed and not there."""
        if self.header[:1] == [UNNAMED.format(1)]:
            return LogError(
                f"{self.name}: its first line holds numbers and no names, so its columns are "
                f"called {self.header[0]} to {self.header[-1]}; write a line of names above"
                f"{self._or_rename(', or say what each is, as with ', self.header[0], column)}."
            )
        own = _quantity(column)
        same = [name for name in self.strange if own and _quantity(name) == own]
        open_names = [name for name in self.strange if not _quantity(name)]
        near = difflib.get_close_matches(column, same, n=1, cutoff=0.0)
        near = near or difflib.get_close_matches(column, open_names, n=1, cutoff=NEAR)
        if not near:
            only = self.strange[0] if len(self.strange) == 1 else ""
            which = f"that {only}" if only else f"which of {', '.join(self.strange)}"
            which = self._or_rename(f", or say {which} holds it: ", only or "NAME", column)
            return LogError(
                f"{self.name}: column {column} is missing; add it{which if self.strange else ''}."
            )
        return LogError(
            f"{self.name}: column {column} is missing (nearest is '{near[0]}'); rename it in the "
            f"file{self._or_rename(' or with ', near[0], _in_unit_of(near[0], column))}."
        )

    def _or_rename(self, before: str, old: str, new: str) -> str:
        """The option that names a column anew, behind words; empty where there is none."""
        return f"{before}{option('rename', {old: new})}" if self.can_rename else ""


def _day_last(cell: str) -> str:
    """A time of the day 1.3.2026 as ISO 8601 has it; others as they are."""
    found = DAY_FIRST.fullmatch(cell)
    if not found:
        return cell
    day, month, year, clock, part = found.groups()
    return f"{year}-{int(month):02}-{int(day):02}T{clock.zfill(8)}.{part or 0}"


def _iso(found: re.Match[str], day: int) -> str:
    """A date of SLASHED as ISO 8601 has it; the day is that group of it."""
    hour = int(found[4])
    if half := found[7]:
        hour = hour % 12 + 12 * (half in "Pp")
    date = f"{found[3]}-{int(found[3 - day]):02}-{int(found[day]):02}"
    return f"{date}T{hour:02}:{found[5]}.{found[6] or 0}"


def _of_digits(cells: list[str]) -> list[str]:
    """Dates and times in digits as ISO 8601 has them, if the first cell is one; else as they are.

    What stands behind the second is a part of it; where it has not the same length in all rows it
    is a number of ms, or of us.
    """
    found = [DIGITS.fullmatch(cell) for cell in cells]
    if not found[0] or DATE.match(cells[0]):
        return cells
    widths = {len(match[7] or "") for match in found if match}
    width = next((w for w in (3, 6, 9) if w >= max(widths)), 9) if len(widths) > 1 else 0
    return [
        "{}-{}-{}T{}:{}:{}".format(*match.groups()[:6])
        + (f".{match[7].zfill(width)}" if match[7] else "")
        if match
        else cell
        for match, cell in zip(found, cells, strict=True)
    ]


def _quantity(name: str) -> str:
    """Quantity by the unit in a column's name, as one of our units; empty if it has none."""
    unit = split_unit(name)[1]
    return UNITS[unit][0] if unit else ""


def _in_unit_of(name: str, column: str) -> str:
    """Our column, in the unit that the name has, if that is one of the same quantity."""
    (_, unit), (stem, own) = split_unit(name), split_unit(column)
    same = unit and own and UNITS[unit][0] == UNITS[own][0]
    return f"{stem}_{unit}" if same else column


def read_header(path: Path) -> list[str]:
    """Names of the columns of a table.

    Raises:
        LogError: unreadable.
    """
    with open_text(path) as text:
        lines, _, delimiter, _ = _begin(text)
        reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True)
        header, first = _names(next(reader, [])), next(reader, [])
        return _with_index(_with_units(header, first) or header, first)


def read_table(path: Path, known: frozenset[str], *, can_rename: bool = True) -> Table:
    """Reads a table with one header row: comma-separated, or by another of DELIMITERS.

    Lines that begin with # are comments. A last row that was cut is left out.

    Args:
        path: of the file, `.gz` too.
        known: all columns that have a meaning.
        can_rename: as of Table.

    Raises:
        LogError: unreadable, empty or ragged.
    """
    notes = []
    with open_text(path) as text:
        lines, before, delimiter, taken = _begin(text)
        notes += [f"{path.name}: {taken}."] if taken else []
        last = [""]
        reader = csv.reader(_remembered(lines, last), delimiter=delimiter, skipinitialspace=True)
        header = _names(next(reader, []))
        if [name.lower() for name in header[:1]] == ["format version"]:
            raise LogError(f"{path.name}: is an export of Motive; give it with {option('motive')}.")
        rows, line = PackedRows(), array("q")
        for row in reader:
            if not any(cell.strip() for cell in row) or row[0].lstrip().startswith("#"):
                continue
            if len(row) < len(header) and not last[0].endswith(("\n", "\r")):
                notes.append(_cut(path.name, before + reader.line_num))
                break
            if not rows and not header[-1] and len(row) == len(header) - 1:
                header.pop()  # likewise behind the names
            if not rows and (named := _with_units(header, row)):
                header = named
                notes.append(f"{path.name}: the row under the names is taken for their units.")
                continue
            if not rows and not header[0]:
                header = _with_index(header, row)
                if header[0] in TIMES:
                    notes.append(f"{path.name}: its first column has no name; taken for the time.")
            if len(row) == len(header) + 1 and not row[-1].strip():
                row.pop()  # a separator at the end of the line parts nothing
            if len(row) != len(header):
                raise LogError(
                    f"{path.name}: row {before + reader.line_num}: has {len(row)} cells, but the "
                    f"header has {len(header)}; correct or remove the row."
                )
            rows.append(row)
            line.append(before + reader.line_num)
    if rows and not last[0].endswith(("\n", "\r")) and _ends_short(rows):
        notes.append(_cut(path.name, line.pop()))
        rows.pop()
    if not rows:
        raise LogError(
            f"{path.name}: has no rows of numbers, so there is nothing to import; check "
            "that the export worked."
        )
    _refuse_transposed(path.name, header, rows)
    comma = _has_decimal_commas(rows, delimiter)
    if comma:
        rows = rows.changed(lambda c: c.replace(",", ".") if DECIMAL_COMMA.fullmatch(c) else c)
    if delimiter != "," or comma:
        more = ", and numbers have decimal commas" if comma else ""
        notes.append(f"{path.name}: cells are separated by {DELIMITERS[delimiter]}{more}.")
    kept = {"notes": notes, "can_rename": can_rename}
    return Table(path.name, header, rows, np.array(line), known, **kept)


def _begin(text: Iterable[str]) -> tuple[Iterator[str], int, str, str]:
    """Lines from the header on, how many stand before it, the delimiter, and what it was taken for.

    The header may be the last comment before rows of numbers, as NumPy's `savetxt` writes it. Where
    there is none the columns are called as UNNAMED says.
    """
    lines, before, comment = iter(text), 0, ""
    for line in lines:
        if not line.strip() or line.lstrip().startswith("#"):
            before, comment = before + 1, line.lstrip("\ufeff #")
            continue
        if not before and OF_EXCEL.fullmatch(line):
            before += 1
            continue
        if found := messages(line, chain([line], lines)):
            return chain([found.names], found.lines), before - 1, ",", found.note
        if not (delimiter := _between_values(line)):
            return chain([line], lines), before, _delimiter(line), ""
        named = _delimiter(comment) if comment.strip() else delimiter
        cells = _split(line, delimiter)
        if delimiter == " " and (names := trajectory(cells, _split(comment, named))):
            return chain([f"{names}\n", line], lines), before - 1, " ", OF_TUM
        if comment.strip() and len(_split(comment, named)) == len(_split(line, named)):
            return chain([comment, line], lines), before - 1, named, ""
        columns = range(len(cells))
        if cells == list(map(str, columns)):  # as pandas names an array's
            return chain([line], lines), before, delimiter, ""
        names = delimiter.join(UNNAMED.format(k + 1) for k in columns) + "\n"
        return chain([names, line], lines), before - 1, delimiter, ""
    return iter(()), before, ",", ""


def _between_values(line: str) -> str:
    """Separator between numbers or times in a line that holds nothing else; else empty."""
    for delimiter in (";", "\t", "|", ",", " "):
        cells = _split(line, delimiter)
        if len(cells) > 1 and all(map(_is_value, cells)):
            return delimiter
    return ""


def _is_value(cell: str) -> bool:
    kinds = (DATE, DAY_FIRST, SLASHED, TIME_OF_DAY)
    times = (DECIMAL_COMMA.fullmatch, DIGITS.fullmatch, *(kind.match for kind in kinds))
    return is_number(cell) or any(matches(cell) for matches in times)


def _split(line: str, delimiter: str) -> list[str]:
    return line.strip().split(None if delimiter == " " else delimiter)


def _delimiter(header: str) -> str:
    """Separator found most often between the names; spaces if there is no other."""
    best = max(",;\t|", key=header.count)
    return best if best in header else " " if " " in header.strip() else ","


def _refuse_transposed(name: str, header: list[str], rows: PackedRows) -> None:
    """Raises LogError where the rows are the quantities: few, long, and no names above them."""
    unnamed = header[0] == UNNAMED.format(1) or all(map(is_number, header[1:]))
    if unnamed and len(header) > WIDE * (len(rows) + 1):
        count = len(rows) + (header[0] != UNNAMED.format(1))
        raise LogError(
            f"{name}: has {count} rows of {len(header)} numbers, so its rows are what columns "
            "should be: turn it round, as with pandas: pd.read_csv(FILE, header=None).T, and write "
            "names above the columns."
        )


def _names(header: list[str]) -> list[str]:
    return whole([cell.strip() for cell in header])


def _with_index(header: list[str], row: list[str]) -> list[str]:
    """Names with one for a first column that has none, as pandas writes the rows' index."""
    if not header or header[0]:
        return header
    dated = bool(row) and _is_value(row[0].strip()) and not is_number(row[0])
    timed = any(name.lower() in TIMES or _quantity(name) == "s" for name in header)
    return ["timestamp" if dated and not timed else OF_PANDAS, *header[1:]]


def _with_units(header: list[str], row: list[str]) -> list[str] | None:
    """Names with the units of the row below them; None if that is no row of units."""
    units = [cell.strip().strip("[]()").strip() for cell in row]
    known = [split_unit(f"_ [{unit}]")[1] for unit in units]
    if len(row) != len(header) or not any(known):
        return None
    if any(
        unit and not found and unit not in UNITLESS
        for unit, found in zip(units, known, strict=True)
    ):
        return None
    return [
        f"{name} [{unit}]" if found and not split_unit(name)[1] else name
        for name, unit, found in zip(header, units, known, strict=True)
    ]


def _remembered(lines: Iterator[str], last: list[str]) -> Iterator[str]:
    """Passes lines on; `last[0]` is the newest."""
    for line in lines:
        last[0] = line
        yield line


def _has_decimal_commas(rows: PackedRows, delimiter: str) -> bool:
    """True if commas in cells are decimal points: some are, and no cell has a point as well.

    Between commas cells with a comma stand in quotes; those that all have three digits behind it
    may be thousands.
    """
    if not rows.hold(","):
        return False
    commas = [c for row in rows for c in row if "," in c and DECIMAL_COMMA.fullmatch(c)]
    if delimiter == "," and all(map(THOUSANDS.fullmatch, commas)):
        return False
    return bool(commas) and not any(is_number(cell) and "." in cell for row in rows for cell in row)


def _ends_short(rows: PackedRows) -> bool:
    """True if the last cell of all is shorter than any above it."""
    *above, last = (len(cell.strip()) for cells in rows.parts(-1) for cell in cells)
    return len(above) >= FEWEST_ROWS and last < min(above)


def _cut(name: str, line: int) -> str:
    return f"{name}: ends in the middle of row {line}: it was cut there; what is before is read."


def is_number(cell: str) -> bool:
    """True if a cell can be read as a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell  # which Python lets stand between digits
