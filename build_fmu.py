"""Builds dist/fmi2/Gyroscope.fmu and dist/fmi3/Gyroscope.fmu; `--update` first writes the committed generated C
anew."""

import sys

from gyro_model.build import build, update_generated
from gyro_model.errors import InputError

if __name__ == "__main__":
    try:
        for path in update_generated() if "--update" in sys.argv[1:] else []:
            print(f"updated {path}")
        for path in build():
            print(path)
    except InputError as error:
        sys.exit(f"gyrotwin: {error}")
