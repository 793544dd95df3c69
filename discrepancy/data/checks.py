"""Step 1 of a diagnosis: can this data be fitted at all? What makes a fit meaningless is refused, the rest is said.

Each check is one function with its rule; ``check`` runs them in the order in which one fault would mislead the next.
Held-out runs are checked as far as that needs no model: nothing is ever fitted to them.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from discrepancy.data.dataset import Dataset
from discrepancy.data.excitation import cramer_rao_bounds
from discrepancy.data.hold import better_hold
from discrepancy.data.linear_fit import (
    LOWEST,
    WeakForm,
    arrangements,
    axis_scales,
    coriolis_gain,
    fit,
    mode_frequencies,
    weak_form,
)
from discrepancy.data.modes import Mode
from discrepancy.data.record import Record
from gyro_model.errors import InputError

JITTER_REFUSED, JITTER_WARNED = 0.25, 0.01
"""Of a period, how far (rms) samples may stand off an even grid. At 1 % and ten samples a period of the mode the error
is 2 pi/10 * 1 % = 0.6 % of v; at 25 % a sample belongs to its place no more than to the next."""

MASKED_WARNED: Final = 0.2
"""Share of clipped samples above which windows of 25 periods between them get rare."""

COARSE: Final = 0.2
"""Highest mode over the sample rate: five samples a period, where what is held between samples starts to matter."""

EXPLAINED_BADLY, EXPLAINED_WELL = 0.5, 0.25
"""Shares of the force that a linear model leaves. The force is refused as wired wrong only if the model leaves more
than half as given and less than a quarter after one change. Measured: a Duffing device, a device with two pickoff
effects and an electronic oscillator leave 0 to 3 %, any wrong arrangement of theirs 102 % or more."""

UNIT_REFUSED: Final = 30.0
"""A factor on v/u that no nominal value is off by, and less than any step between units (57.3 at the least)."""

BOUND_REFUSED, BOUND_WARNED = 0.5, 0.1
"""Relative Cramér–Rao bounds of a nominal parameter: refused above 50 %, where its sign is in doubt at two
deviations."""

NO_SPRING: Final = 0.1
"""Of a period over a run, below which a spring that turns the motion by no more is none."""
NO_DAMPING: Final = 0.1
"""Of its speed that a mass loses over a run, below which a damping that takes no more is none."""

SHORT: Final = 100
"""Periods of the lowest mode: four windows of the weak form, the fewest whose scatter says something."""

KELVIN_OFF: Final = 100.0
"""K between ``temperature`` and t_ref: packages are rated from -55 to 125 degC, a reading in degC is 273 K off."""

RATE_LIMIT: Final = 35.0
"""rad/s, 2000 deg/s: the widest range of common gyroscopes and of rate tables."""

ACCELERATION_LIMIT: Final = 1e5
"""m/s2, 10,000 g: the shock that packages are rated for."""

DEGREES: Final = 180 / np.pi

ALIKE: Final = 3
"""Runs of which each is told what a rule finds of it."""


class Finding(NamedTuple):
    """A warning. check: the name of the rule; run: the file, or "" for all; message: one line."""

    check: str
    run: str
    message: str

    def __str__(self) -> str:
        return f"{self.run}: {self.message}" if self.run else self.message


def check(dataset: Dataset) -> list[Finding]:
    """What the reader should know about ``dataset``. Raises InputError, one line, where it must not be fitted."""
    beside = list(modes(*dataset.shown.modes))
    findings = [*beside, *(Finding("assumed", "", note) for note in dataset.notes)]
    for record in dataset.records:
        try:
            findings += record_findings(record, dataset.nominal)
        except InputError as error:
            raise InputError(f"run {record.name}: {error}") from None
    for record in dataset.fit:
        try:
            findings += list(wiring(record, dataset.nominal))
        except InputError as error:
            more = "".join(f"; {finding}" for finding in beside)
            raise InputError(f"run {record.name}: {error}{more}") from None
    return [*findings, *hold(dataset), *excitation(dataset)]


def lines(findings: Iterable[Finding]) -> list[str]:
    """A line for each, and one for what more than ALIKE runs are told by the same rule."""
    told: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        told.setdefault((finding.check, finding.message if not finding.run else ""), []).append(finding)
    found = []
    for own in told.values():
        few = own if len(own) <= ALIKE else own[:1]
        found += [str(finding) for finding in few[:-1]]
        found.append(str(few[-1]) + (f" (and {len(own) - 1} further runs likewise)" if few is not own else ""))
    return found


def modes(own: Sequence[Mode], more: Sequence[Mode]) -> Iterator[Finding]:
    """Says where runs show more modes than the model has, one an axis."""
    if more:
        yield Finding(
            "modes", "",
            f"more modes than the model has: {_at(more)}{f' beside {_at(own)}' if own else ''}; they are looked for as "
            "parasitic modes on each axis; what else they do is left, or limit force and record to the band of the "
            "modes you want",
        )  # fmt: skip


def hold(dataset: Dataset) -> Iterator[Finding]:
    """Says where the force looks to run otherwise between samples than the runs to fit state."""
    found = better_hold([record for record in dataset.measured if record.role == "fit"], dataset.nominal)
    if found:
        given = dataset.hold
        yield Finding(
            "hold", "",
            f'hold = "{given}" leaves {found.given:.2g} unexplained, "{found.hold}" {found.left:.2g}: if '
            f'the force was so, write hold = "{found.hold}" to every [[run]]; else v is early or late',
        )  # fmt: skip


def _at(found: Sequence[Mode]) -> str:
    return ", ".join(
        f"{mode.frequency:.4g} Hz (Q {mode.quality:.2g})" if mode.seen else "one below the band of the force"
        for mode in found
    )


def record_findings(record: Record, nominal: Mapping[str, float]) -> list[Finding]:
    """The warnings that one run gives without a fit."""
    found: list[Finding] = []
    for rule in (holes, jitter, dead_channels, clipping):
        found += rule(record)
    for judged in (resolution, temperature_unit, rate_unit, acceleration_unit, length):
        found += judged(record, nominal)
    return found


def holes(record: Record) -> Iterator[Finding]:
    """Refuses steps of t beyond 1.5 of the usual one: what u did there is unknown, so the motion after it does not
    follow from the motion before. Two runs do follow, each with an initial state of its own."""
    step = np.diff(record.t)
    wide = np.flatnonzero(step > 1.5 / record.sample_rate)
    if len(wide):
        k = wide[0]
        missing = round(float(step[wide].sum()) * record.sample_rate) - len(wide)
        raise InputError(
            f"t has {len(wide)} hole{'s' * (len(wide) > 1)}, {missing} samples in all, the first after "
            f"t = {record.t[k]:.9g} s: cut the run there into two files (`gyrotwin dataset init` does)"
        )
    yield from ()


def jitter(record: Record) -> Iterator[Finding]:
    """Samples off an even grid, rms over a period (JITTER_REFUSED, JITTER_WARNED); the rounding of t counts too."""
    k = np.arange(len(record.t))
    fitted = np.polynomial.Polynomial.fit(k, record.t, 1)
    off = float(np.std(record.t - fitted(k))) * record.sample_rate
    text = f"t stands off an even grid by {off:.0%} of a sample period (rms)"
    if off > JITTER_REFUSED:
        raise InputError(f"{text}: resample the run evenly")
    if off > JITTER_WARNED:
        yield Finding("sampling", record.name, f"{text}: samples are taken as even; their jitter counts as noise")


def dead_channels(record: Record) -> Iterator[Finding]:
    """Refuses a v that never changes: a channel that is not connected."""
    for axis, v in zip("xy", record.v.T, strict=False):
        if np.ptp(v) == 0:
            raise InputError(f"v_{axis} is {v[0]:g} V throughout: the channel looks unconnected; leave the run out")
    yield from ()


def clipping(record: Record) -> Iterator[Finding]:
    """Says how many samples stand at a flat top and are masked; beyond MASKED_WARNED, that little is left."""
    masked = int(np.count_nonzero(~record.valid))
    if masked:
        share = masked / len(record.valid)
        more = "; little is left to fit: lower the drive or the gain" if share > MASKED_WARNED else ""
        text = f"{masked} samples ({share:.2g} of all) are missing or clipped, and masked{more}"
        yield Finding("clipping", record.name, text)


def resolution(record: Record, nominal: Mapping[str, float]) -> Iterator[Finding]:
    """Refuses a nominal mode above half the sample rate; warns from COARSE on."""
    highest = float(mode_frequencies(nominal, record.axes)[-1])
    text = f"the highest nominal mode is at {highest:.4g} Hz and the sample rate is {record.sample_rate:.6g} Hz"
    if highest > 0.5 * record.sample_rate:
        raise InputError(f"{text}: is t in ms (give s), or a nominal m or k in another unit than SI?")
    if highest > COARSE * record.sample_rate:
        yield Finding("sampling", record.name, f"{text}: what u does between samples (`hold`) matters")


def length(record: Record, nominal: Mapping[str, float]) -> Iterator[Finding]:
    """Warns below SHORT periods of the lowest nominal mode."""
    periods = len(record.t) / record.sample_rate * float(mode_frequencies(nominal, record.axes)[0])
    if periods < SHORT:
        yield Finding(
            "length", record.name, f"short: {periods:.0f} periods of the lowest mode; {SHORT} or more make statistics"
        )


def temperature_unit(record: Record, nominal: Mapping[str, float]) -> Iterator[Finding]:
    """Refuses a temperature that is never within KELVIN_OFF of t_ref."""
    temperature = record.conditions.get("temperature")
    reference = nominal.get("t_ref", 298.15)
    if temperature is not None and np.abs(temperature - reference).min() > KELVIN_OFF:
        middle = float(np.median(temperature))
        raise InputError(
            f"temperature is about {middle:.4g} and t_ref {reference:.4g} K: it looks like degC; give K, or set t_ref "
            "in [nominal]"
        )
    yield from ()


def rate_unit(record: Record, nominal: Mapping[str, float]) -> Iterator[Finding]:
    """Warns beyond RATE_LIMIT; ``coriolis`` decides where the run shows the Coriolis force."""
    rate = record.conditions.get("omega_z")
    if rate is not None and np.abs(rate).max() > RATE_LIMIT:
        yield Finding("units", record.name, f"omega_z reaches {np.abs(rate).max():.4g} rad/s: is it in deg/s?")


def acceleration_unit(record: Record, nominal: Mapping[str, float]) -> Iterator[Finding]:
    """Warns where an acceleration rests at ±1 within 5 % (gravity in g), or exceeds ACCELERATION_LIMIT."""
    for name in ("a_x", "a_y"):
        if name in record.conditions:
            a = record.conditions[name]
            if abs(abs(float(np.median(a))) - 1) < 0.05:
                yield Finding("units", record.name, f"{name} rests at {np.median(a):.3g} m/s2: is it in g?")
            if np.abs(a).max() > ACCELERATION_LIMIT:
                yield Finding("units", record.name, f"{name} reaches {np.abs(a).max():.3g} m/s2: check its unit")


def wiring(record: Record, nominal: Mapping[str, float]) -> Iterator[Finding]:
    """Units, signs and places of u and v by the nominal linear model; then omega_z.

    The model with m, k within 50 % of nominal must explain half the force. If not, every arrangement of v is tried as
    is and scaled to the nominal m and k of each axis (EXPLAINED_BADLY, EXPLAINED_WELL, UNIT_REFUSED).
    """
    form = weak_form(record, nominal, LOWEST)
    if form is None or not form.force.any():
        yield Finding("wiring", record.name, "no drive, or no window of 25 periods: signs and units were not checked")
        return
    as_given = fit(form, nominal)
    if as_given.unexplained > EXPLAINED_BADLY:
        best, fault = min(_candidates(form, nominal))
        if best < EXPLAINED_WELL:
            raise InputError(
                f"{fault}: so read, the nominal model explains {1 - best:.0%} of the force; mend the table"
            )
        yield Finding(
            "wiring",
            record.name,
            f"the linear model within 50 % of [nominal] leaves {min(as_given.unexplained, 1.0):.0%} of the force "
            f"unexplained: {_gain_fault(form, nominal) or 'weak drive, nominal values far off, or a strong effect'}",
        )
        return
    renamed(as_given.values, nominal)
    coriolis(form, nominal)


def _candidates(form: WeakForm, nominal: Mapping[str, float]) -> Iterator[tuple[float, str]]:
    """What the linear model leaves unexplained after each change, and the change in words."""
    for arrangement in arrangements(len(form.force)):
        moved = arrangement.apply(form)
        if arrangement.text:
            yield fit(moved, nominal).unexplained, arrangement.text
        scales = axis_scales(moved, nominal)
        factors = [abs(scale) if scale else 1.0 for scale in scales]
        words = [_unit_fault(axis, factor) for axis, factor in zip("xy", factors, strict=False) if _is_unit(factor)]
        if words:
            text = " and ".join(filter(None, (arrangement.text, *words)))
            yield fit(arrangement.apply(form, factors), nominal).unexplained, text
    yield np.inf, ""


def _gain_fault(form: WeakForm, nominal: Mapping[str, float]) -> str:
    """In words, a factor on v too small for a unit, if with it the model explains the force; else ""."""
    factors = [scale if scale and scale > 0 else 1.0 for scale in axis_scales(form, nominal)]
    same = arrangements(len(form.force))[0]
    if fit(same.apply(form, factors), nominal).unexplained > EXPLAINED_WELL:
        return ""
    pairs = zip("xy", factors, strict=False)
    words = [f"m and k of {axis} come out {factor:.3g} times [nominal]" for axis, factor in pairs]
    return " and ".join(words) + ": check sense_gain and the units"


def _is_unit(factor: float) -> bool:
    return not 1 / UNIT_REFUSED < factor < UNIT_REFUSED


def _unit_fault(axis: str, factor: float) -> str:
    """In words: v must be multiplied by ``factor`` to agree with u and the nominal model."""
    if factor < 1:
        guess = {1e-3: "v in mV", 1e-6: "v in µV"}
        size, word = 1 / factor, "large"
    else:
        guess = {1e3: "u in mN", 1e6: "u in µN, or v a displacement in m", 1e9: "u in nN"}
        size, word = factor, "small"
    near = [text for unit, text in guess.items() if 0.5 < factor / unit < 2]
    return f"v_{axis} looks {size:.3g} times too {word} for u_{axis} and [nominal]{f' ({near[0]}?)' if near else ''}"


def renamed(values: Mapping[str, float], nominal: Mapping[str, float]) -> None:
    """Refuses axes that are exchanged in u and v alike: nominal kxx and kyy differ by a fifth or more, and the fitted
    ones have the inverse ratio within a quarter of that (on a logarithmic scale)."""
    if "kyy" not in values:
        return
    believed = float(np.log(nominal["kyy"] / nominal["kxx"]))
    found = float(np.log(values["kyy"] / values["kxx"]))
    if abs(believed) > np.log(1.2) and abs(found + believed) < 0.25 * abs(believed):
        raise InputError(
            f"the axes x and y look exchanged in u and v: kxx = {values['kxx']:.4g}, kyy = {values['kyy']:.4g} N/m "
            f"fit, [nominal] says {nominal['kxx']:.4g} and {nominal['kyy']:.4g}; rename the columns or mend [nominal]"
        )


def coriolis(form: WeakForm, nominal: Mapping[str, float]) -> None:
    """Refuses omega_z in deg/s or with the wrong sign by the Coriolis force: its factor is 1 in theory and 1/57.3 or
    -1 by those faults. A factor within 2 times of the first, or 1.5 of the second, must be known to a tenth of
    itself."""
    found = coriolis_gain(form, nominal)
    if found is None:
        return
    factor, deviation = found
    if abs(np.log(max(factor, 1e-9) * DEGREES)) < np.log(2) and deviation < 0.1 * factor:
        raise InputError(
            f"omega_z looks like deg/s: the Coriolis force is {1 / factor:.3g} times too small; give rad/s"
        )
    if -1.5 < factor < -0.5 and deviation < 0.1 * abs(factor):
        raise InputError(
            "omega_z looks to have the wrong sign, or one axis is turned in u and v: the Coriolis force comes out "
            f"{factor:.2f} times what it should be"
        )


def excitation(dataset: Dataset) -> Iterator[Finding]:
    """Refuses runs that leave a nominal parameter with a Cramér–Rao bound above 50 %, and names it; warns above 10
    %."""
    bounds = cramer_rao_bounds(dataset.fit, dataset.nominal)
    bounds = {name: bound for name, bound in bounds.items() if not _none(dataset, name, bound)}
    poor = sorted((name for name in bounds if bounds[name] > BOUND_WARNED), key=lambda name: -bounds[name])
    refused = [name for name in poor if bounds[name] > BOUND_REFUSED]
    if refused:
        raise InputError(
            f"excitation too poor: the runs to fit leave {_listed(refused, bounds)} (Cramér–Rao bound above 50 %); "
            "add a run with more drive, near each mode and off it"
        )
    if poor:
        yield Finding("excitation", "", f"weak excitation: Cramér–Rao bound of {_listed(poor, bounds)}")


def _none(dataset: Dataset, name: str, bound: float) -> bool:
    """Whether a stiffness or damping is known to be none over these runs: how much of itself it is known to says
    nothing then. A spring that nobody has stated, and that the record does not show, is none."""
    duration = max(len(record.t) / record.sample_rate for record in dataset.fit)
    least = {"k": (2 * np.pi * NO_SPRING / duration) ** 2, "d": NO_DAMPING / duration}
    direct = name in ("kxx", "kyy", "dxx", "dyy")
    bound = 0.0 if name[0] == "k" and name in dataset.estimated else bound
    return direct and (1 + bound) * dataset.nominal[name] < least[name[0]] * dataset.nominal["m"]


def _listed(names: list[str], bounds: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {'unknown' if np.isinf(bounds[name]) else f'± {bounds[name]:.0%}'}" for name in names)


__all__ = ["Finding", "check"]
