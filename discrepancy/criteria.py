"""Every threshold by which a diagnosis decides, in one checked record."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import isfinite
from pathlib import Path
from typing import Any, Final

from gyro_model.errors import InputError, nearest
from gyro_model.toml_text import read_toml_file

Bounds = tuple[float, float]


@dataclass(frozen=True)
class Criteria:
    """Thresholds of a diagnosis; ``--criteria FILE`` sets them by name (TOML), report.json says which were used.

    Raises InputError, naming the threshold and its bounds, where one is out of them.
    """

    effect_chance: float = 1e-6
    """Probability of one test by chance at which an effect counts as significant. 60 effects and 400 null sets make
    0.02 false alarms; the points of a grid count as tests."""
    term_chance: float = 1e-8
    """The same for a term of the library: with some 300 tests a search, 400 null sets make 0.001 false alarms."""
    clip_chance: float = 1e-6
    """Probability by chance of what a clip is said to have cut off."""
    material: float = 3e-4
    """Share of the residual's square that an effect has to take away to be worth a parameter."""
    even: float = 9.0
    """Chi-square by which a rival may fit worse and still count as not told apart: three standard deviations."""
    simpler: float = 12.0
    """Chi-square that a further parameter must bring."""
    unseen: float = 3.0
    """Standard deviations by which data that a fit did not see must improve with an effect for it to be named: one
    needless effect in 700 gets as far, after it has passed ``effect_chance``."""
    left: float = 0.05
    """Share of the refit's residual power, noise taken off, from which something is left, if that is significant."""
    open_white: float = 1.2
    """Final misfit over that of the noise from which a gap is significant where the noise is white: in 742 sets two
    were above, whose noise was known."""
    open_coloured: float = 1.5
    """The same where noise has a memory: its mean square over a run scatters by as much as a third."""
    far_above: float = 5.0
    """The same from which something is left however small a share that is: a louder run shows what it is of."""
    noise_chance: float = 1e-8
    """Probability by chance at which innovations count as not white, by the largest of their spectral lines."""
    white: float = 3.0
    """Times the mean density that an octave of what is left may have, beside what chance allows, where nothing but
    white noise is: what a model lacks is in some of them."""
    faint_force: float = 0.015
    """Share of the force's rms that noise in its record may be where the force is nowhere quiet, so that the record
    does not show it: of four records 0.001 to 0.013 were."""
    worse: float = 1.0
    """Held-out misfit with an effect over that without, beyond which the effect is doubtful. The same noise is in both,
    so a difference is the effect's however small it is: of 237 sets of blind trials one got worse, by 0.4 %."""
    improbable: float = 0.3
    """Probability of a name, together with those of its ``either``, below which it is doubtful: of 163 names of blind
    trials none had less."""
    thermal: float = 5.0
    """Times the physical thermal force: a motion stronger than that is no noise of a package at 300 K and its
    damping."""
    jitter: float = 0.05
    """Of a sample period: sampling instants that scatter more are no noise of a clock. A crystal's are below 1e-4, a
    software timer's some per cent."""
    timer: float = 0.005
    """Of a sample period: time stamps that scatter more, from sample to sample, are the record's, not the noise of a
    converter's clock, which is below 2e-3 at the worst."""
    coloured: float = 7.0
    """Times that an octave of the residual is over or below the flicker that comes nearest, from which it is none but
    hum, a drift or what else wanders. Noise in proportion to f^-1 stayed below 2.3 at any strength, f^-0.8 and f^-1.2,
    as of amplifiers, below 6.4; with the power of the white noise, hum and wandering temperatures had 7.8 and more, a
    random walk 17."""
    prior_none: float = 0.01
    """Probability, before the data, that what is missing is in no file though a name fits: 3 of 252 single effects were
    named wrong in blind trials."""
    half_left: float = 0.5
    """Share of the refit's residual power, from which what the response shows of a resonator is no more than what
    others show: of two sensors and one force one was named at a frequency of its own where 0.57 was left."""
    unsettled: float = 100.0
    """Variances that a further step would gain, from which values are not those of the likeliest model: two matrices of
    gains were named at 0.96 and 0.99 in the place of a third and a delay, 350 short of it."""
    believed: float = 0.05
    """Probability below which an effect is not named where something is left: what leaves most of what it was to
    explain is one of many that imitate a part. Chosen on two measured sets, whose wrong names had 0.03 and 0.01."""
    time_limit: float = 100.0
    """Seconds after which a diagnosis ends with what it knows, and says what it has not tried: as they pass on cores
    that do nothing else, so that no load of the machine changes an answer (``Clock``). 120 are bearable; the begin, the
    last part, which is not cut short, and the FMUs that are built took 20 s more on five measured sets, and 57 s on an
    electronic oscillator."""
    design_time: float = 10.0
    """Seconds of work, beside ``time_limit``, for the design of all further experiments: most pairs of rivals are told
    apart in a fiftieth of the time of a fixed experiment after that."""

    def __post_init__(self) -> None:
        for name, (low, high) in BOUNDS.items():
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
                raise InputError(f"criteria: {name} = {value!r}: give a number")
            if not low <= value <= high:
                raise InputError(f"criteria: {name} = {value:g}: give a number from {low:g} to {high:g}")

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Criteria":
        """The default ones with some changed, by name. Raises InputError for a name that is none."""
        known = [field.name for field in fields(cls)]
        for name in given:
            if name not in known:
                raise InputError(f"criteria: {name!r} is unknown{nearest(name, known)}")
        return cls(**given)


BOUNDS: Final[Mapping[str, Bounds]] = {
    "effect_chance": (1e-15, 0.1), "term_chance": (1e-15, 0.1), "clip_chance": (1e-15, 0.1), "material": (0.0, 0.5),
    "even": (0.0, 1e15), "simpler": (0.0, 100.0), "unseen": (0.0, 20.0), "left": (0.0, 1.0),
    "open_white": (1.0, 100.0), "open_coloured": (1.0, 100.0), "far_above": (1.0, 1e6), "noise_chance": (1e-15, 0.1),
    "white": (1.0, 100.0), "faint_force": (0.0, 1.0), "half_left": (0.0, 1.0), "unsettled": (0.0, 1e15),
    "worse": (1.0, 10.0), "improbable": (0.0, 1.0), "thermal": (1.0, 1e6), "jitter": (1e-6, 1.0), "timer": (1e-6, 1.0),
    "coloured": (0.1, 1e6), "prior_none": (0.0, 0.5), "believed": (0.0, 1.0), "time_limit": (1.0, 1e6),
    "design_time": (0.1, 1e5)}  # fmt: skip
"""What each may be."""


def load_criteria(path: Path) -> Criteria:
    """The thresholds of a TOML file. Raises InputError where it can't be read or one is wrong."""
    try:
        return Criteria.of(read_toml_file(path))
    except InputError as error:
        raise InputError(f"--criteria {path}: {error}") from None
