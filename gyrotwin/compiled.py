"""The first run compiles the loop, some fifteen seconds; it is done in a process of its own, and said.

In a process of its own because the compiler's memory, some 100 MB, would stay with the run.
"""

import subprocess
import sys
from pathlib import Path

import numba
from rich.console import Console


def compile_once(console: Console, observer: str, controller: str) -> None:
    """Compiles what a run with these two needs, unless that has been done since the package last changed."""
    import cosim  # noqa: F401  (places the cache)

    done = Path(numba.config.CACHE_DIR) / f"{Path(observer).stem}-{Path(controller).stem}.compiled"
    if done.is_file():
        return
    with console.status("compiling the loop, once for this version"):
        command = [sys.executable, "-m", "gyrotwin.compiled", observer, controller]
        result = subprocess.run(command, capture_output=True, check=False)
    # Where it failed, the run itself says why.
    if result.returncode == 0:
        done.parent.mkdir(parents=True, exist_ok=True)
        done.touch()


def _short_run(observer: str, controller: str) -> None:
    from cosim.master import simulate
    from gyrotwin.run import Request, prepare

    simulate(prepare(Request("constant", duration=0.01, observer=observer, controller=controller)))


if __name__ == "__main__":
    _short_run(*sys.argv[1:])
