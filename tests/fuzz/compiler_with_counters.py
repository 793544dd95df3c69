"""A C compiler for ``$CC`` whose libraries count the branches that they take: gcc, which keeps the sources beside its
counters in ``$COUNTERS``, because those of a build are deleted."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path


def main() -> int:
    """Compiles as told, from a copy of the sources."""
    arguments = sys.argv[1:]
    sources = Path(arguments[arguments.index("-I") + 1])
    kept = Path(tempfile.mkdtemp(prefix="c-", dir=os.environ["COUNTERS"]))
    shutil.copytree(sources, kept, dirs_exist_ok=True)
    arguments = [a.replace(str(sources), str(kept)) if not a.endswith((".so", ".fmu")) else a for a in arguments]
    # No optimisation: branches of the source are those of the machine. A function written into each of its callers
    # would count once in each, with values that never come there.
    counting = ["-O0", "-Dalways_inline=unused", "--coverage", "-fprofile-update=single", "-dumpdir", f"{kept}/"]
    library = arguments[arguments.index("-o") + 1]
    command = ["gcc", *arguments, *counting]
    assert Path(library).parent.is_dir()
    return subprocess.run(command, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
