"""Fixtures of the tests of the model and of the FMU's physics."""

import pytest
from gyro_runner import RestingRunner, Runner

from gyro_model.build import Fmus, build
from gyro_model.envelope import envelope_model


@pytest.fixture(scope="session")
def runners(fmus: Fmus, tmp_path_factory: pytest.TempPathFactory) -> dict[int, Runner]:
    """Both FMUs of the packaged model by version."""
    pair = [Runner(path, tmp_path_factory.mktemp(name)) for name, path in fmus._asdict().items()]
    return {runner.version: runner for runner in pair}


@pytest.fixture(scope="session")
def plant(runners: dict[int, Runner]) -> Runner:
    """The FMU for FMI 3.0."""
    return runners[3]


@pytest.fixture(scope="session")
def envelope(tmp_path_factory: pytest.TempPathFactory) -> Runner:
    """The FMU of the envelope form for FMI 3.0, at rest where nobody says otherwise."""
    return RestingRunner(build(envelope_model()).fmi3, tmp_path_factory.mktemp("envelope"))
