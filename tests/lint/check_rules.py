# SPDX-License-Identifier: Apache-2.0
"""Checks house rules that no compiler and no formatter checks.

Usage: check_rules.py RULE ROOT [--library FILE] [--compile-commands FILE]

Each rule is one function: it yields one sentence per offence. Exit status 1 if there is any.
"""

import argparse
import ast
import json
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

FOLDERS = (
    "lcm_types",
    "firmware",
    "twin",
    "calibration",
    "lab",
    "tools",
    "scripts",
    "examples",
    "benchmarks",
    "tests",
    "cmake",
    "docs",
)
CODE_SUFFIXES = {".c", ".h", ".cpp", ".py"}
# What the core may ask of its surroundings: no heap, clock or I/O is among it.
CORE_HEADERS = {"limits.h", "stdbool.h", "stddef.h", "stdint.h", "string.h"}
CORE_HEADERS |= {"arm_neon.h", "tmmintrin.h"}  # names of the processor's instructions, no more
# Built with the kernel's headers, and for the kernel alone.
GPL_FILES = {"tests/hil/guest/hilboard.c"}
CORE_SYMBOLS = {"memcmp", "memcpy", "memmove", "memset", "strcmp", "strcspn", "strlen"}
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
OPENING = re.compile(r"(Of|The same|What|Whether)\b")
MACHINE_PATH = re.compile(r"(?<![\w.])/(work|root|home/(?!pi\b)\w+)/")


def ours(root: Path) -> Iterator[Path]:
    """Yields every text file of the project's folders, sorted."""
    for folder in FOLDERS:
        for path in sorted((root / folder).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                yield path


def is_code(path: Path) -> bool:
    """Tells whether a file is source code: by its suffix, or a script by its first line."""
    if path.suffix:
        return path.suffix in CODE_SUFFIXES
    return path.read_bytes().startswith(b"#!")


def without_comments(source: str) -> str:
    """Blanks comments and string literals of C, keeping the lines."""
    pattern = r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"'
    return re.sub(pattern, lambda m: "\n" * m[0].count("\n"), source, flags=re.DOTALL)


def core_source(args: argparse.Namespace) -> Iterator[str]:
    """The core includes only what needs no operating system, and has no floating point."""
    for path in sorted((args.root / "firmware/core").rglob("*.[ch]")):
        source = path.read_text(encoding="utf-8")
        for header in re.findall(r"^#include <([^>]+)>", source, flags=re.MULTILINE):
            if header not in CORE_HEADERS:
                yield f"{path}: includes <{header}>; the core may include {sorted(CORE_HEADERS)}"
        for number, line in enumerate(without_comments(source).splitlines(), 1):
            if re.search(r"\b(float|double)\b|\b\d+\.\d", line):
                yield f"{path}:{number}: floating point; the core computes in integers"


def core_state(args: argparse.Namespace) -> Iterator[str]:
    """The core's objects have no writable data: all state is in the context."""
    sizes = subprocess.run(["size", "-A", args.library], capture_output=True, text=True, check=True)
    for line in sizes.stdout.splitlines():
        if match := re.match(r"\.t?(data|bss)(?!\.rel\.ro)\S*\s+([1-9]\d*)\s", line):
            yield f"{args.library}: {match[2]} bytes in {match[1]}: a static or global variable"


def core_symbols(args: argparse.Namespace) -> Iterator[str]:
    """The core calls nothing but itself and a few functions on bytes."""
    names = subprocess.run(
        ["nm", "-u", args.library], capture_output=True, text=True, check=True
    ).stdout
    for name in sorted(set(re.findall(r"^\s+U (\w+)", names, flags=re.MULTILINE))):
        if not name.startswith(("fw_", "_")) and name not in CORE_SYMBOLS:
            yield f"{args.library}: calls {name}(); the core may call {sorted(CORE_SYMBOLS)}"


def include_flags(compile_commands: Path) -> list[str]:
    """Returns the include folders of all targets, each once."""
    flags: dict[str, None] = {}
    for entry in json.loads(compile_commands.read_text(encoding="utf-8")):
        words = iter(shlex.split(entry["command"]))
        for word in words:
            if word == "-isystem":
                flags["-isystem" + next(words)] = None
            elif word.startswith("-I"):
                flags[word] = None
    return list(flags)


def object_circles(args: argparse.Namespace) -> Iterator[str]:
    """No two files of C or C++ need each other's functions, directly or through others."""
    defined: dict[str, Path] = {}
    needed: dict[Path, list[str]] = {}
    for entry in json.loads(args.compile_commands.read_text(encoding="utf-8")):
        source, words = Path(entry["file"]), shlex.split(entry["command"])
        made = Path(entry["directory"]) / words[words.index("-o") + 1]
        ours = any(source.is_relative_to(args.root / folder) for folder in ("firmware", "twin"))
        if not ours or not made.exists():
            continue
        names = subprocess.run(["nm", "-g", made], capture_output=True, text=True, check=True)
        symbols = re.findall(r"([TDBRU]) (\S+)$", names.stdout, flags=re.MULTILINE)
        defined.update((name, source) for kind, name in symbols if kind != "U")
        needed[source] = [name for kind, name in symbols if kind == "U"]
    users = {
        source: {defined[name] for name in names if name in defined} - {source}
        for source, names in needed.items()
    }
    try:
        TopologicalSorter(users).prepare()
    except CycleError as error:
        circle = " <- ".join(str(path.relative_to(args.root)) for path in error.args[1])
        yield f"{circle}: these files need each other; move what both need into a third"


def included_first(compile_commands: Path) -> set[str]:
    """Headers that a source of the twin includes before all else, compiled with all warnings."""
    found = set()
    for entry in json.loads(compile_commands.read_text(encoding="utf-8")):
        words = entry["command"].split()
        if {"-std=c++20", "-Wall", "-Wextra", "-Werror"} <= {*words}:
            text = Path(entry["file"]).read_text(encoding="utf-8")
            first = re.search(r'^#include (?:"([^"]+)"|<)', text, re.MULTILINE)
            if first and first[1]:
                found.add(first[1])
    return found


def headers_alone(args: argparse.Namespace) -> Iterator[str]:
    """Every public header compiles by itself: firmware as C11 and as C++20, the twin as C++20.

    The build has compiled those of the twin that a source includes before all else.
    """
    flags = [*include_flags(args.compile_commands), "-fsyntax-only", "-Wall", "-Wextra", "-Werror"]
    as_c, as_cpp = ["gcc", "-std=c11"], ["g++", "-std=c++20"]
    firmware = sorted((args.root / "firmware").glob("**/include/**/*.h"))
    twin = sorted((args.root / "twin").glob("**/include/**/*.h"))
    built = included_first(args.compile_commands)
    jobs = [(h, c) for h in firmware for c in (as_c, as_cpp)]
    jobs += [(h, as_cpp) for h in twin if str(h).partition("/include/")[2] not in built]

    def compile_alone(job: tuple[Path, list[str]]) -> str | None:
        header, compiler = job
        with tempfile.TemporaryDirectory() as folder:
            source = Path(folder) / ("alone.c" if compiler is as_c else "alone.cpp")
            source.write_text(f'#include "{header}"\n', encoding="utf-8")
            run = subprocess.run(
                [*compiler, *flags, str(source)], capture_output=True, text=True, check=False
            )
        return f"{header}: not with {' '.join(compiler)}: {run.stderr}" if run.returncode else None

    with ThreadPoolExecutor() as pool:
        yield from filter(None, pool.map(compile_alone, jobs))


def lcm_comments(args: argparse.Namespace) -> Iterator[str]:
    """Comments stand above a field or a group: lcm-gen gives one after a field to the next."""
    for path in sorted((args.root / "lcm_types").glob("*.lcm")):
        previous = ""
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            code, _, comment = (part.strip() for part in line.partition("//"))
            if code and comment:
                yield f"{path}:{number}: comment after code; put it on the line above"
            is_field = code.endswith(";") and not code.startswith(("package ", "const "))
            if is_field and not previous.startswith("//") and not previous.endswith(";"):
                yield f"{path}:{number}: no comment above '{code}' or the group it belongs to"
            previous = line.strip()


def licence_line(args: argparse.Namespace) -> Iterator[str]:
    """Every source file names its licence in its first line, or in its second after #!."""
    for path in filter(is_code, ours(args.root)):
        lines = path.read_text(encoding="utf-8").splitlines() or [""]
        first = lines[1] if lines[0].startswith("#!") and len(lines) > 1 else lines[0]
        is_gpl = str(path.relative_to(args.root)) in GPL_FILES
        licence = "GPL-2.0-only" if is_gpl else "Apache-2.0"
        if not re.fullmatch(rf"(//|#) SPDX-License-Identifier: {re.escape(licence)}", first):
            yield f"{path}: the first line is not the SPDX line"


def is_python(path: Path) -> bool:
    """Tells Python by its suffix, or a script by its first line."""
    if path.suffix:
        return path.suffix == ".py"
    return re.match(rb"#!.*\bpython", path.read_bytes()) is not None


def docstring_openings(args: argparse.Namespace) -> Iterator[str]:
    """Docstrings, of modules too, begin with what the thing is."""
    for path in filter(is_python, ours(args.root)):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            told = ast.get_docstring(node) if isinstance(node, DOCUMENTED) else None
            if opening := OPENING.match(told or ""):
                line = getattr(node, "lineno", 1)
                yield f"{path}:{line}: a docstring begins with '{opening[0]}'; name the thing"


def machine_paths(args: argparse.Namespace) -> Iterator[str]:
    """No file names a folder of somebody's machine."""
    for path in [*ours(args.root), *sorted(args.root.glob("*.md")), args.root / "CMakeLists.txt"]:
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except UnicodeDecodeError:
            continue
        for number, line in enumerate(lines, 1):
            if match := MACHINE_PATH.search(line):
                yield f"{path}:{number}: names '{match[0]}', a folder of one machine"


RULES: dict[str, Callable[[argparse.Namespace], Iterator[str]]] = {
    rule.__name__: rule
    for rule in (
        core_source,
        core_state,
        core_symbols,
        docstring_openings,
        headers_alone,
        lcm_comments,
        licence_line,
        machine_paths,
        object_circles,
    )
}


def main() -> int:
    """Runs one rule."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("rule", choices=RULES)
    parser.add_argument("root", type=lambda path: Path(path).resolve())
    parser.add_argument("--library", help="the core's static library")
    parser.add_argument("--compile-commands", type=Path, help="of the build")
    args = parser.parse_args()
    offences = list(RULES[args.rule](args))
    for offence in offences:
        print(offence, file=sys.stderr)
    return 1 if offences else 0


if __name__ == "__main__":
    sys.exit(main())
