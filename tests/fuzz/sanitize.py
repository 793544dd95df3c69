"""`python -m tests.fuzz.sanitize`: 64 instances in as many threads under ThreadSanitizer, and ten thousand lives under
LeakSanitizer, of all FMUs (tests/fuzz/lives.c)."""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from gyro_model.build import c_files, forms, write_sources
from gyro_model.compiling import STRICT, fmi_headers
from gyro_model.form import Form
from gyro_model.model import load_model

MODES = {"thread": "threads", "address": "10000"}


def run(model: Form, sanitizer: str, argument: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Compiles lives.c with the FMU's C under one sanitizer and runs it."""
    sources = folder / f"{model.NAME}-{sanitizer}"
    sources.mkdir()
    write_sources(model, sources)
    program = sources / "lives.bin"
    command = ["clang", "-std=c99", "-g", "-O1", *STRICT, f"-fsanitize={sanitizer}", "-pthread"]
    command += ["-isystem", str(fmi_headers()), "-I", str(sources), str(Path(__file__).with_name("lives.c"))]
    command += [*(str(sources / file) for file in c_files(sources, "fmi3")), "-o", str(program)]
    subprocess.run(command, check=True)
    return subprocess.run([str(program), argument], capture_output=True, text=True, check=False)


def main() -> int:
    """Prints a line a run; exit code 1 where a sanitizer complains."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    good = True
    with tempfile.TemporaryDirectory() as name:
        for model in forms(load_model()):
            for sanitizer, argument in MODES.items():
                result = run(model, sanitizer, argument, Path(name))
                good = good and result.returncode == 0
                verdict = "nothing found" if result.returncode == 0 else result.stderr[-2000:]
                print(f"{model.NAME} under -fsanitize={sanitizer}: {result.stdout.strip()}, {verdict}", flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
