"""Tables in files that are no text: each reader turns one into columns by name.

Columns of one length make a table; of several lengths, the longest that two or more share.
"""

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np
import polars as pl

from gyro_model.errors import InputError

Columns = dict[str, np.ndarray]


def npy(path: Path, content: bytes) -> Columns:
    """A numpy array: columns of its second axis, or of its fields."""
    return _of_array("column", np.load(io.BytesIO(content), allow_pickle=False))


def npz(path: Path, content: bytes) -> Columns:
    """Several numpy arrays."""
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        return {key: column for name in archive.files for key, column in _of_array(name, archive[name]).items()}


def mat(path: Path, content: bytes) -> Columns:
    """MATLAB: variables that are vectors or matrices, also within structs, by path; version 7.3 is HDF5."""
    from scipy.io import loadmat

    if content[:8] == b"\x89HDF\r\n\x1a\n" or content[512:520] == b"\x89HDF\r\n\x1a\n":
        return hdf5(path, content)
    found = loadmat(io.BytesIO(content), chars_as_strings=True)
    arrays = {name: value for name, value in found.items() if not name.startswith("__")}
    return {key: column for name, value in arrays.items() for key, column in _of_array(name, np.asarray(value)).items()}


def hdf5(path: Path, content: bytes) -> Columns:
    """HDF5: its data sets, by path."""
    h5py = _extra("h5py", path)
    found: Columns = {}

    def visit(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and node.dtype.kind in "fiu":
            found.update(_of_array(name, np.asarray(node)))

    with h5py.File(io.BytesIO(content), "r") as file:
        file.visititems(visit)
    return found


def tdms(path: Path, content: bytes) -> Columns:
    """TDMS of LabVIEW: channels by group and name, with their unit."""
    nptdms = _extra("nptdms", path)
    found: Columns = {}
    for group in nptdms.TdmsFile.read(io.BytesIO(content)).groups():
        for channel in group.channels():
            unit = str(channel.properties.get("unit_string", "")).strip()
            found[f"{channel.name} [{unit}]" if unit else channel.name] = np.asarray(channel[:])
    return found


READERS: Final[Mapping[str, Callable[[Path, bytes], Columns]]] = {
    ".npy": npy, ".npz": npz, ".mat": mat, ".h5": hdf5, ".hdf5": hdf5, ".tdms": tdms}  # fmt: skip
"""By what a name ends in."""


def frame_of(path: Path, content: bytes) -> pl.DataFrame:
    """The table in such a file. Raises InputError where it is none, or the package that reads it is not installed."""
    try:
        columns = READERS[path.suffix.lower()](path, content)
    except InputError:
        raise
    except Exception as error:  # a damaged file makes each of these packages raise its own
        raise InputError(f"table {path} can't be read: {type(error).__name__}: {error}") from None
    lengths = [len(column) for column in columns.values()]
    shared = [n for n in lengths if lengths.count(n) > 1 or len(lengths) == 1]
    if not shared:
        raise InputError(f"table {path} holds no columns of one length ({', '.join(columns) or 'nothing'})")
    return pl.DataFrame({name: column for name, column in columns.items() if len(column) == max(shared)})


def _of_array(name: str, array: np.ndarray) -> Columns:
    if array.dtype.names and array.dtype.hasobject:  # a struct of MATLAB
        names = array.dtype.names if array.size == 1 else ()
        fields = [(f"{name}.{field}", np.asarray(array[field].item())) for field in names]
        return {key: column for path, inner in fields for key, column in _of_array(path, inner).items()}
    if array.dtype.names:
        return {field: np.ravel(array[field]) for field in array.dtype.names if array[field].dtype.kind in "fiu"}
    if array.dtype.kind not in "fiub" or array.ndim not in (1, 2) or array.size < 2:
        return {}
    if array.ndim == 1 or min(array.shape) == 1:
        return {name: array.ravel()}
    array = array.T if array.shape[0] < array.shape[1] else array
    return {f"{name} {number}": column for number, column in enumerate(array.T, 1)}


def _extra(package: str, path: Path) -> ModuleType:
    from importlib import import_module

    try:
        return import_module(package)
    except ImportError:
        raise InputError(f"table {path}: reading it needs {package}: install gyrotwin[tables]") from None
