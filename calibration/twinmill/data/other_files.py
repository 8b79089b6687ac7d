# SPDX-License-Identifier: Apache-2.0
"""Files that are not what they were given as, told by their first bytes, each with its way out."""

import re
from pathlib import Path

from twinmill.data.lcm_log import LogError

LOOKED_AT = 65536  # bytes
RAW = "get the file itself, as by the button for raw contents or a download"
TO_CSV = "save it as CSV"
OF_PANDAS = "write its table as CSV, as with pandas: to_csv; or give frames to tm.Log.from_frames"
OF_NUMPY = "write it as CSV: numpy.savetxt with delimiter and header"
LCM_LOG = "an LCM log"
OF_BAG = "import it as a bag"
# What it begins with, what it is, and what to do. From the formats' own specifications.
BEGINNINGS = (
    (
        b"version https://git-lfs.github.com/spec/",
        "a Git LFS pointer",
        "get the file: git lfs pull",
    ),
    (b"/annex/objects/", "a pointer of git-annex", "get the file: git annex get"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an Excel file of the old kind", TO_CSV),
    (b"#ROSBAG V", "a ROS bag", OF_BAG),
    (b"\x89MCAP0\r\n", "an MCAP file", OF_BAG),
    (b"SQLite format 3\0", "an SQLite database, as of a ROS 2 bag", OF_BAG),
    (b"\xed\xa1\xda\x01", LCM_LOG, "it needs no import: give it to compare, metrics and others"),
    (b"MATLAB 5.0 MAT-file", "a MATLAB file", "write a table there: writetable(T, 'poses.csv')"),
    (b"MATLAB 7.3 MAT-file", "a MATLAB file", "write a table there: writetable(T, 'poses.csv')"),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file", OF_PANDAS),
    (b"PAR1", "a Parquet file", OF_PANDAS),
    (b"ARROW1", "a Feather file", OF_PANDAS),
    (b"\x93NUMPY", "a NumPy array", OF_NUMPY),
    (b"ULog\x01\x12\x35", "a log of PX4", "write its topics as CSV: ulog2csv"),
    (b"%PDF-", "a PDF document", "give the table that it was made of"),
    (b"\x89PNG\r\n", "a picture", "give the numbers that it was made of"),
    (b"7z\xbc\xaf\x27\x1c", "an archive", "unpack it"),
    (b"BZh", "a file packed by bzip2", "unpack it: bunzip2"),
    (b"\xfd7zXZ\0", "a file packed by xz", "unpack it: unxz"),
    (b"\x28\xb5\x2f\xfd", "a file packed by zstd", "unpack it: zstd -d"),
)
ZIP, GZIP = b"PK\x03\x04", b"\x1f\x8b"
PICKLE = re.compile(rb"\x80[\x02-\x05]")  # protocol of Python's pickle
C3D = re.compile(rb"[\x02-\x08]\x50")  # in which block its parameters begin, and its key
KEY = re.compile(rb"[ \t-]*[A-Za-z_][\w/]*:([ \t].*)?")
HTML = re.compile(rb"\s*(<!doctype html|<html)", re.IGNORECASE)
JSON = re.compile(rb'\s*(\{\s*["}]|\[\s*[\[{"\d-])')
FEWEST_KEYS = 3  # lines of a message in YAML


def other_file(beginning: bytes) -> tuple[str, str] | None:
    """Kind of file with this beginning, and advice; None if it may be the kind that is wanted.

    Args:
        beginning: its first LOOKED_AT bytes, or fewer.
    """
    for start, what, remedy in BEGINNINGS:
        if beginning.startswith(start):
            return what, remedy
    if beginning.startswith(ZIP):
        return _zipped(beginning)
    if PICKLE.match(beginning):
        return "a pickle of Python", OF_PANDAS
    if C3D.match(beginning):
        return "a C3D file", "export the rigid bodies as CSV from the program that captured them"
    if HTML.match(beginning):
        return "a web page", RAW
    if JSON.match(beginning):
        return "JSON", "write its numbers as a table, as with pandas: to_csv"
    if _is_echo(beginning):
        return (
            "the output of `ros2 topic echo`, or other YAML, whose messages have no times of their "
            "own",
            "record a bag, or write a table as echo can, with commas",
        )
    return None


def _zipped(beginning: bytes) -> tuple[str, str]:
    if b"opendocument.spreadsheet" in beginning[:100]:
        return "a spreadsheet of OpenDocument", TO_CSV
    if b"xl/" in beginning or b"[Content_Types].xml" in beginning[:100]:
        return "an Excel file", TO_CSV
    if b".npy" in beginning[:100]:
        return "an archive of NumPy", OF_NUMPY
    return "a ZIP archive", "unpack it"


def _is_echo(beginning: bytes) -> bool:
    """True if all lines are keys, values of lists and ends of messages."""
    lines = [line.rstrip() for line in beginning.splitlines()[:-1] if line.strip()]
    lines = lines or [beginning.strip()]
    keys = sum(bool(KEY.fullmatch(line)) for line in lines)
    items = sum(line.lstrip().startswith(b"- ") or line in (b"---", b"...") for line in lines)
    return keys >= FEWEST_KEYS and keys + items == len(lines)


def refuse_other_file(path: Path, wanted: str) -> None:
    """Raises LogError where a file is of a kind that is told here, and no bag.

    Args:
        path: a file, or a folder of which none is looked at.
        wanted: what it should be.
    """
    found = other_file(beginning_of(path))
    if found and found[1] != OF_BAG:
        raise LogError(f"{path}: is {found[0]}, not {wanted}; {found[1]}.")


def beginning_of(path: Path) -> bytes:
    """The first bytes of a file; empty if it cannot be read."""
    try:
        with path.open("rb") as stream:
            return stream.read(LOOKED_AT)
    except OSError:
        return b""
