"""`python -m tests.fuzz`: runs the fuzzers of all FMUs in both standards for a time and prints what they tried.

Each is clang's libFuzzer over tests/fuzz/fuzz.c with the FMU's C, under AddressSanitizer and
UndefinedBehaviorSanitizer. An input that fails is kept as a file and replayed by `FOLDER/NAME/fuzz FILE`.
"""

import argparse
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from gyro_model.build import c_files, forms, write_sources
from gyro_model.compiling import STRICT, fmi_headers
from gyro_model.form import Form
from gyro_model.model import load_model

SANITIZERS = "address,undefined,float-cast-overflow"


def targets() -> dict[str, tuple[Form, str]]:
    """Model and standard by name."""
    return {f"{model.NAME}-{fmi}": (model, fmi) for model in forms(load_model()) for fmi in model.STANDARDS}


def compile_target(name: str, folder: Path) -> Path:
    """Compiles one fuzzer and gives its path."""
    model, fmi = targets()[name]
    sources = folder / name / "c"
    sources.mkdir(parents=True, exist_ok=True)
    write_sources(model, sources)
    program = folder / name / "fuzz"
    command = [
        "clang",
        "-std=c99",
        "-g",
        "-O2",
        *STRICT,
        f"-fsanitize=fuzzer,{SANITIZERS}",
        "-fno-sanitize-recover=all",
    ]
    command += ["-D_GNU_SOURCE", *(["-DFMI2"] if fmi == "fmi2" else []), "-isystem", str(fmi_headers())]
    command += ["-I", str(sources), str(Path(__file__).with_name("fuzz.c"))]
    subprocess.run([*command, *(str(sources / file) for file in c_files(sources, fmi)), "-o", str(program)], check=True)
    return program


def run_target(name: str, folder: Path, seconds: int, seed: int) -> tuple[str, int, bool]:
    """What one fuzzer says: its last line, the number of inputs, whether none failed."""
    program = compile_target(name, folder)
    corpus = folder / name / "corpus"
    corpus.mkdir(exist_ok=True)
    options = [
        f"-max_total_time={seconds}",
        "-max_len=600",
        "-timeout=20",
        "-rss_limit_mb=4096",
        "-print_final_stats=1",
    ]
    options += [f"-seed={seed}"]
    result = subprocess.run(
        [str(program), *options, str(corpus)], cwd=folder / name, capture_output=True, text=True, check=False
    )
    (folder / name / "log").write_text(result.stderr, encoding="utf-8")
    done = re.search(r"stat::number_of_executed_units: (\d+)", result.stderr)
    covered = re.findall(r"cov: (\d+) ft: (\d+)", result.stderr)
    last = f"{covered[-1][0]} edges" if covered else "no coverage"
    failure = next((line for line in result.stderr.splitlines() if "ERROR:" in line or "runtime error" in line), "")
    return f"{last}{'; ' + failure if failure else ''}", int(done[1]) if done else 0, result.returncode == 0


def main() -> int:
    """Prints a line a fuzzer; exit code 1 where one found something."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=int, default=300, help="time for each of them [s]")
    parser.add_argument("--jobs", type=int, default=2, help="fuzzers at a time")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path("results/fuzz"))
    options = parser.parse_args()
    if shutil.which("clang") is None:
        parser.error("needs clang with its runtime libraries: apt-get install clang")
    options.folder.mkdir(parents=True, exist_ok=True)
    folder = options.folder.resolve()
    total, good = 0, True
    with ThreadPoolExecutor(options.jobs) as pool:
        runs = {name: pool.submit(run_target, name, folder, options.seconds, options.seed) for name in targets()}
        for name, run in runs.items():
            text, count, fine = run.result()
            total, good = total + count, good and fine
            print(f"{name}: {count} inputs, {text}, {'nothing found' if fine else 'FAILED'}", flush=True)
    print(f"{total} inputs in {options.seconds} s each, {len(runs)} fuzzers, seed {options.seed}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
