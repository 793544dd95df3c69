"""The full model as a diagnosis runs it: an FMU whose library also follows the variation of a motion."""

from dataclasses import dataclass
from typing import ClassVar

from gyro_model.model import Model, load_model


@dataclass(frozen=True, eq=False)
class VariedModel(Model):
    """The model of the same ``effects``; its library exports gyro_follow and gyro_vary too (``fmu_src/varied``).

    brief: whether it serves for some seconds alone, so that it is compiled in a third of the time for steps that take a
    third longer; the bits are the same.
    """

    brief: bool = False

    NAME: ClassVar[str] = "GyroscopeVaried"
    DESCRIPTION: ClassVar[str] = f"{Model.DESCRIPTION}; for diagnoses"
    LAYERS: ClassVar[tuple[str, ...]] = ("device", "full", "varied")
    TRACES: ClassVar[str] = Model.NAME
    STANDARDS: ClassVar[tuple[str, ...]] = ("fmi3",)

    @property
    def compiler_flags(self) -> tuple[str, ...]:
        """See Form."""
        return ("-O1",) if self.brief else ()


def varied_model(full: Model | None = None, *, brief: bool = False) -> VariedModel:
    """That form of ``full``, by default of the packaged model; it starts as that does."""
    full = full or load_model()
    return VariedModel(full.effects, full.starts, brief)
