"""Builds the FMUs of all forms in dist/fmi2 and dist/fmi3; `--update` first writes the committed generated C anew."""

import sys

from gyro_model.build import build_all, update_generated
from gyro_model.errors import InputError

if __name__ == "__main__":
    try:
        for path in update_generated() if "--update" in sys.argv[1:] else []:
            print(f"updated {path}")
        for path in build_all():
            print(path)
    except InputError as error:
        sys.exit(f"gyrotwin: {error}")
