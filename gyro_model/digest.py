"""What names a state of the code: the digest of a folder's files."""

import hashlib
from collections.abc import Collection
from pathlib import Path


def digest_of(*folders: Path, suffixes: Collection[str] = (".py",)) -> str:
    """SHA-256, in hexadecimal, of paths and contents of all files under ``folders`` whose names end in one of
    ``suffixes``. Where the folders lie makes no difference."""
    found = hashlib.sha256()
    for folder in folders:
        for path in sorted(path for path in folder.rglob("*") if path.suffix in suffixes):
            found.update(f"{folder.name}/{path.relative_to(folder).as_posix()}".encode() + path.read_bytes())
    return found.hexdigest()
