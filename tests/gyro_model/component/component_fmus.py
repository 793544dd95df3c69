"""FMUs with a WebAssembly component: what they are of, and the code in them.

What imports this is skipped where nothing makes or runs a component."""

import zipfile
from pathlib import Path

import pytest

from gyro_model.build import forms, model_token
from gyro_model.form import Form
from gyro_model.model import load_model
from gyro_model.platforms import COMPONENT

wasmtime = pytest.importorskip("wasmtime", reason="needs the package wasmtime")
pytest.importorskip("ziglang", reason="needs the package ziglang")

MODELS: dict[str, Form] = {form.NAME: form for form in forms(load_model())}
FULL = MODELS["Gyroscope"]
VR = {q.name: index for index, q in enumerate(FULL.quantities)}
TOKENS = {name: model_token(form) for name, form in MODELS.items()}


def code_of(folder: Path, name: str) -> bytes:
    with zipfile.ZipFile(folder / "fmi3" / f"{name}.fmu") as archive:
        return archive.read(f"binaries/{COMPONENT.fmi3}/{name}.wasm")
