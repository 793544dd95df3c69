"""What every FMU of this package is described by: a name, a table of variables, the layers of C that it is made of."""

from functools import cached_property
from typing import ClassVar, NamedTuple

from gyro_model.anatomy import Effect
from gyro_model.errors import InputError, nearest
from gyro_model.quantities import Quantity


class OutputClock(NamedTuple):
    """A triggered clock of FMI 3.0 that the FMU lets tick; the outputs ``clocked`` change when it does."""

    name: str
    description: str
    clocked: tuple[str, ...]


class Form:
    """An FMU's description. ``effects`` that it is made of; ``starts``: parameters (name, value) [SI] that start at
    another value than the table of quantities says."""

    NAME: ClassVar[str]
    DESCRIPTION: ClassVar[str]
    CONVENTIONS: ClassVar[tuple[str, ...]]
    """Said in the FMU's documentation, a paragraph each."""
    STEP_SIZE: ClassVar[str]
    """What an importer should start with [s]."""
    LAYERS: ClassVar[tuple[str, ...]]
    """Folders of ``fmu_src`` whose C the FMU is made of, beside what all share; in the last one lies what is generated
    for it alone."""
    EQUATION: ClassVar[bool] = False
    """Whether it shows its differential equation: model exchange, derivatives, events."""
    STANDARDS: ClassVar[tuple[str, ...]] = ("fmi2", "fmi3")
    """The standards that there are FMUs for."""
    CLOCKS: ClassVar[tuple[OutputClock, ...]] = ()
    """What has clocks is for co-simulation alone."""
    TRACES: ClassVar[str] = ""
    """The form whose reference traces it meets too, by its name; "": it has its own."""

    effects: tuple[Effect, ...]
    starts: tuple[tuple[str, float], ...]

    @property
    def compiler_flags(self) -> tuple[str, ...]:
        """For its library on this machine, beside those of all; the last of a kind counts."""
        return ()

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """Every FMI variable; the index is its value reference, inputs come first."""
        raise NotImplementedError

    @cached_property
    def tunable(self) -> frozenset[str]:
        """The parameters that may change while it runs."""
        return frozenset()

    @cached_property
    def by_name(self) -> dict[str, Quantity]:
        """The quantities by name."""
        return {q.name: q for q in self.quantities}

    def start(self, quantity: Quantity) -> float:
        """The value of ``quantity`` where nobody sets it."""
        return dict(self.starts).get(quantity.name, quantity.start)

    def parameter(self, name: str) -> Quantity:
        """The parameter of that name. Raises InputError with the nearest name where there is none."""
        settable = {q.name: q for q in self.quantities if q.role not in ("input", "output")}
        if name not in settable:
            raise InputError(f"parameter {name!r} is unknown{nearest(name, settable)}")
        return settable[name]
