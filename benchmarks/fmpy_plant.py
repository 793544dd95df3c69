"""The plant as fmpy's classes give it, the usual way to run an FMU from Python."""

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Slave


@contextmanager
def fmpy_slave(path: Path, parameters: Mapping[str, float]) -> Iterator[FMU3Slave]:
    """An initialised instance of the FMU at ``path`` with ``parameters`` (SI)."""
    description = read_model_description(path)
    variables = {variable.name: variable for variable in description.modelVariables}
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        extract(path, folder)
        slave = FMU3Slave(
            guid=description.instantiationToken,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="fmpy",
        )
        slave.instantiate()
        for name, value in parameters.items():
            reference = [variables[name].valueReference]
            if variables[name].type == "Int32":
                slave.setInt32(reference, [int(value)])
            else:
                slave.setFloat64(reference, [value])
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        try:
            yield slave
        finally:
            slave.freeInstance()
