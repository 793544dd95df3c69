"""Both FMUs, built once a session, loaded and ready."""

from collections.abc import Iterator

import pytest
from fmu_importer import Fmu, Instance

from gyro_model.build import build


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Fmu]:
    """Both FMUs by version."""
    loaded = [Fmu(path, tmp_path_factory.mktemp(name)) for name, path in build()._asdict().items()]
    return {fmu.version: fmu for fmu in loaded}


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def fmu(request: pytest.FixtureRequest, fmus: dict[int, Fmu]) -> Fmu:
    """Each FMU in turn."""
    return fmus[request.param]


@pytest.fixture
def gyro(fmu: Fmu) -> Iterator[Instance]:
    """A fresh instance of each FMU in turn."""
    with Instance(fmu) as instance:
        yield instance
