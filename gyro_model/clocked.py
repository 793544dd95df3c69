"""The full model as an FMU with a clock: for importers of FMI 3.0 that schedule by clocks."""

from dataclasses import dataclass
from typing import ClassVar

from gyro_model.form import OutputClock
from gyro_model.model import Model, load_model


@dataclass(frozen=True, eq=False)
class ClockedModel(Model):
    """The model of the same ``effects`` whose samples a clock announces."""

    NAME: ClassVar[str] = "GyroscopeClocked"
    DESCRIPTION: ClassVar[str] = f"{Model.DESCRIPTION}; a clock ticks at each sample"
    CONVENTIONS: ClassVar[tuple[str, ...]] = (
        *Model.CONVENTIONS,
        "sample_clock ticks at each sample instant, the start included: in event mode it is active, and v_x, v_y are "
        "those of the sample, until fmi3UpdateDiscreteStates. A step ends there where the importer lets it return "
        "early. Without event mode v_x, v_y are latched, as in Gyroscope.",
    )
    LAYERS: ClassVar[tuple[str, ...]] = ("device", "full", "clocked")
    TRACES: ClassVar[str] = Model.NAME
    STANDARDS: ClassVar[tuple[str, ...]] = ("fmi3",)
    CLOCKS: ClassVar[tuple[OutputClock, ...]] = (
        OutputClock("sample_clock", "ticks when v_x and v_y are sampled", ("v_x", "v_y")),
    )


def clocked_model(full: Model | None = None) -> ClockedModel:
    """The form with a clock of ``full``, by default of the packaged model; it starts as that does."""
    full = full or load_model()
    return ClockedModel(full.effects, full.starts)
