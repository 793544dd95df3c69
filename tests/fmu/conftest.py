"""All FMUs, built once a session, loaded and ready."""

from collections.abc import Iterator

import pytest
from fmu_importer import Fmu, Instance

from gyro_model.build import build, build_form, forms
from gyro_model.model import load_model

FORMS = {form.NAME: form for form in forms(load_model())}


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Fmu]:
    """Both FMUs by version."""
    loaded = [Fmu(path, tmp_path_factory.mktemp(name)) for name, path in build()._asdict().items()]
    return {fmu.version: fmu for fmu in loaded}


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def fmu(request: pytest.FixtureRequest, fmus: dict[int, Fmu]) -> Fmu:
    """Each FMU in turn."""
    return fmus[request.param]


@pytest.fixture(scope="session")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[int, Fmu]]:
    """The FMUs of every form, by its name and version."""
    return {
        name: {
            fmu.version: fmu
            for fmu in (Fmu(path, tmp_path_factory.mktemp(fmi)) for fmi, path in build_form(form).items())
        }
        for name, form in FORMS.items()
    }


ALL = [(name, int(fmi[3:])) for name, form in FORMS.items() for fmi in form.STANDARDS]


@pytest.fixture(params=ALL, ids=[f"{name}-fmi{version}" for name, version in ALL])
def any_fmu(request: pytest.FixtureRequest, loaded: dict[str, dict[int, Fmu]]) -> Fmu:
    """Each FMU of every form in turn."""
    name, version = request.param
    return loaded[name][version]


@pytest.fixture
def gyro(fmu: Fmu) -> Iterator[Instance]:
    """A fresh instance of each FMU in turn."""
    with Instance(fmu) as instance:
        yield instance
