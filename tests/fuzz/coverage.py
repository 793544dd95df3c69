"""`python -m tests.fuzz.coverage`: the branches of ``fmu_src`` that ``tests/fmu`` alone takes, file by file, by gcov.

The tests run on a copy of the checkout whose FMUs are compiled with counters. A branch counts once however many FMUs
share its file. Needs gcc with gcov.
"""

import argparse
import gzip
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[2]
SKIPPED = ("dist", "results", "build", "site", ".*", "*.egg-info", "__pycache__")
Branch = tuple[str, int, int]
"""File in fmu_src by name, line, number of the branch in it."""


def run_tests(folder: Path, arguments: list[str]) -> int:
    """Runs tests of the C on libraries that count into ``folder``; pytest's exit code."""
    checkout = folder / "checkout"
    (folder / "counters").mkdir()
    shutil.copytree(ROOT, checkout, ignore=shutil.ignore_patterns(*SKIPPED))
    compiler = f"{sys.executable} {Path(__file__).with_name('compiler_with_counters.py')}"
    own = {"CC": compiler, "COUNTERS": str(folder / "counters"), "XDG_CACHE_HOME": str(folder / "cache")}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    return subprocess.run(command, cwd=checkout, env=os.environ | own, check=False).returncode


def committed(compiled: Path) -> str | None:
    """Where in fmu_src the compiled file lies, byte for byte; None for headers of the system and what tests made up.

    Layers have files of the same name, and models of one's own other effects."""
    folder = ROOT / "fmu_src"
    for path in folder.rglob(compiled.name):
        if path.read_bytes() == compiled.read_bytes():
            return path.relative_to(folder).as_posix()
    return None


def taken(counters: Path) -> dict[Branch, int]:
    """How often each branch was taken, over all libraries."""
    counts: dict[Branch, int] = defaultdict(int)
    for notes in sorted(counters.glob("*/*.gcno")):
        if not notes.with_suffix(".gcda").is_file():
            continue
        command = ["gcov", "--json-format", "--branch-probabilities", "--stdout", notes.name]
        said = subprocess.run(command, cwd=notes.parent, capture_output=True, check=True).stdout
        text = gzip.decompress(said) if said[:2] == b"\x1f\x8b" else said
        for file in json.loads(text)["files"]:
            if (name := committed((notes.parent / file["file"]).resolve())) is not None:
                for line in file["lines"]:
                    for number, branch in enumerate(line["branches"]):
                        counts[name, line["line_number"], number] += branch["count"]
    return counts


def report(counts: dict[Branch, int], *, missed: bool) -> float:
    """Prints a line a file, and the lines with branches never taken; the share that was taken."""
    files: dict[str, list[tuple[Branch, int]]] = defaultdict(list)
    for branch, count in sorted(counts.items()):
        files[branch[0]].append((branch, count))
    for name, branches in files.items():
        done = sum(count > 0 for _, count in branches)
        print(f"{name}: {done} of {len(branches)} branches, {done / len(branches):.1%}")
        lines = sorted({branch[1] for branch, count in branches if count == 0})
        if missed and lines:
            print("    never on line", *lines)
    done = sum(count > 0 for count in counts.values())
    print(f"all: {done} of {len(counts)} branches, {done / len(counts):.2%}")
    return done / len(counts)


def main() -> int:
    """Exit code 1 where a test fails or less than the wanted share is covered."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wanted", type=float, default=0.95, help="share of branches")
    parser.add_argument("--missed", action="store_true", help="name the lines too")
    parser.add_argument("tests", nargs="*", default=["tests/fmu"])
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="coverage-") as name:
        code = run_tests(Path(name), options.tests)
        share = report(taken(Path(name) / "counters"), missed=options.missed)
    return code or int(share < options.wanted)


if __name__ == "__main__":
    sys.exit(main())
