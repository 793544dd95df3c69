"""The loop around the gyroscope FMU: observers, controllers, angle units, master.

numba checks only the file of a compiled function for changes, not the files of what it calls. So what it compiles is
cached in a folder named after the text of the whole package: an edit anywhere compiles anew, and nothing stale runs.
"""

import os
import sys
from pathlib import Path

import platformdirs

from gyro_model.digest import digest_of


def _cache_folder() -> Path:
    return Path(platformdirs.user_cache_dir("gyrotwin")) / "numba" / digest_of(Path(__file__).parent)[:16]


# By the environment, so that a run that needs no numba does not load it. A folder that the user has chosen stays.
if "NUMBA_CACHE_DIR" not in os.environ:
    os.environ["NUMBA_CACHE_DIR"] = str(_cache_folder())
    if "numba" in sys.modules:
        sys.modules["numba"].config.reload_config()
