"""Fixtures of the tests of the component. They import an importer where they are used, which may not be installed."""

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gyro_model import compiling
from gyro_model.build import build_form, forms
from gyro_model.model import load_model
from gyro_model.platforms import COMPONENT, own_platform
from tests.fmu.fmu_importer import Fmu

if TYPE_CHECKING:
    from component_host import Host


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of FMUs with a component and a library for this machine."""
    made = tmp_path_factory.mktemp("components")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiling, "FLAGS", (*compiling.FLAGS, "-Werror"))
        for form in forms(load_model()):
            build_form(form, made, platforms=[COMPONENT.fmi3, own_platform()])
    return made


@pytest.fixture(scope="session")
def code(folder: Path) -> bytes:
    """The component of the full model."""
    from component_fmus import FULL, code_of

    return code_of(folder, FULL.NAME)


@pytest.fixture
def host(code: bytes) -> "Host":
    from component_host import Host

    return Host(code)


@pytest.fixture(scope="session")
def native(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    """The same FMU by its library."""
    from component_fmus import FULL

    return Fmu(folder / "fmi3" / f"{FULL.NAME}.fmu", tmp_path_factory.mktemp("native"))
