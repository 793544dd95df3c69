"""The loop around the gyroscope FMU: observers, controller, angle units, master.

numba checks only the file of a compiled function for changes, not the files of what it calls. So compiled code is
cached in a folder named after the text of the whole package: an edit anywhere compiles anew, and nothing stale runs.
"""

import hashlib
from pathlib import Path

import numba
import platformdirs


def _cache_folder() -> Path:
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return Path(platformdirs.user_cache_dir("gyrotwin")) / "numba" / digest.hexdigest()[:16]


# One that the user has chosen (NUMBA_CACHE_DIR) stays.
if not numba.config.CACHE_DIR:
    numba.config.CACHE_DIR = str(_cache_folder())
