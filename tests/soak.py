"""`python -m tests.soak --seed N --calls M`: random calls of an FMU, right ones and wrong ones, on random devices.

Two instances share a life. One gets everything: steps of any length, refused calls, saved states, restored ones, also
in another instance; where there is a clock, in event mode. The other one gets only what counts, in as few steps as
possible. Outputs must be the same to the last bit whenever both have come to the same time. A seed gives the same calls
on every platform.
"""

import argparse
import ctypes as ct
import hashlib
import math
import random
import struct
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from gyro_model.build import build_form
from gyro_model.clocked import clocked_model
from gyro_model.effect_points import active_parameters
from gyro_model.envelope import envelope_model
from gyro_model.form import Form
from gyro_model.generate_envelope import refused_effects
from gyro_model.model import Model, load_model
from gyro_model.quantities import Quantity
from gyro_model.sensor import PARAMETER_TABLE, SensorModel
from tests.fmu.fmu_importer import ERROR, OK, Fmu, Instance, update

FORMS: dict[str, Form] = {
    "full": load_model(),
    "envelope": envelope_model(),
    "sensor": SensorModel(),
    "clocked": clocked_model(),
}
KINDS = [(version, form) for version in (2, 3) for form, model in FORMS.items() if f"fmi{version}" in model.STANDARDS]
"""Standards and forms that there are."""
TICK = 1e-12
"""What the FMU counts time in [s]: lengths of steps are whole numbers of it, so that their sums are exact."""

# Sizes of random inputs by unit; a temperature keeps near its start.
_INPUT_SCALE = {"N": 1e-6, "rad/s": 5.0, "m/s2": 10.0, "V": 1.0, "K": 5.0, "Hz": 0.1}
# What a sensor may have, by quantity; the others are drawn apart.
_SENSOR = [q for q in PARAMETER_TABLE if q.nominal and not q.name.startswith(("structure", "supply", "start_up"))]


def random_device(model: Form, rng: random.Random) -> dict[str, float]:
    """Parameters of some effects, up to where they count, or of a sensor; steps and samples of odd lengths."""
    known = {q.name: q for q in model.quantities if q.role != "output"}
    values: dict[str, float] = {"seed": rng.randrange(1000)}
    if isinstance(model, Model):
        values |= {name: v for name, v in _effects(model, rng).items() if name in known}
    else:
        values |= _sensor(rng)
    if "x_start" in known:
        values |= {"x_start": rng.uniform(0, 1e-6), "y_dot_start": rng.uniform(0, 1e-2)}
    for name in ("internal_step", "sample_period"):
        values[name] = model.start(known[name]) * rng.choice((1.0, 1.0, 0.2, 0.371, 0.74, 1 / 3, 1.7))
    return values


def _effects(model: Model, rng: random.Random) -> dict[str, float]:
    """Sizes, shapes and starts of some effects."""
    refused = refused_effects(model) if model is FORMS["envelope"] else ()
    effects = [e for e in model.effects if not e.nominal and e.limits and e not in refused]
    values: dict[str, float] = {}
    for effect in rng.sample(effects, rng.choice((0, 1, 2, 4, 8, 16))):
        numbers = np.random.default_rng(rng.randrange(1 << 30))
        values |= active_parameters(effect, numbers, model)
        values |= {q.name: q.typical * rng.uniform(-1.0, 1.0) for q in effect.starts}
    return values


def _sensor(rng: random.Random) -> dict[str, float]:
    """Parameters of a sensor; the supply (3.3 V ± 1 V) switches some off."""
    low = rng.uniform(230.0, 300.0)
    values = {q.name: q.typical * rng.uniform(0.0, 3.0) for q in rng.sample(_SENSOR, rng.randrange(len(_SENSOR)))}
    for k in (1, 2):
        values[f"filter_frequency_{k}"] = 10.0 ** rng.uniform(0.0, 3.5)
        values[f"filter_damping_{k}"] = rng.uniform(0.2, 3.0)
    values |= {"temperature_low": low, "temperature_high": low + 10.0 ** rng.uniform(-1.0, 2.0)}
    values |= {"supply_low": rng.choice((0.0, 3.0)), "start_up_time": rng.choice((0.0, rng.uniform(0.0, 0.02)))}
    return values | {"structure_lag": rng.choice((0.0, 10.0 ** rng.uniform(-3.0, 2.0)))}


def inputs_of(model: Form) -> list[Quantity]:
    """Inputs of which a random size is known."""
    return [q for q in model.quantities if q.role == "input" and (q.integer or q.unit in _INPUT_SCALE)]


def random_inputs(model: Form, rng: random.Random) -> dict[str, float]:
    """New values of one or two inputs."""
    values = {}
    for quantity in rng.sample(inputs_of(model), rng.randint(1, 2)):
        if quantity.integer:
            values[quantity.name] = float(rng.randint(int(quantity.low), int(quantity.high)))
        else:
            values[quantity.name] = model.start(quantity) + _INPUT_SCALE[quantity.unit] * rng.uniform(-1.0, 1.0)
    return values


class SoakError(AssertionError):
    """Something that must not be; says what, after how many calls."""


class Ticking(Instance):
    """An instance in event mode, whose steps return at the samples that its clock announces."""

    def __init__(self, fmu: Fmu) -> None:
        super().__init__(fmu, events=True, early=True)
        self.clock = ct.c_uint32(fmu.variables["sample_clock"].valueReference)

    def start(self, start: float = 0.0, stop: float | None = None, **values: float) -> None:
        super().start(start, stop, **values)
        self.take_event()

    def take_event(self) -> None:
        """Event mode from its beginning to its end. Raises SoakError where the clock is not as it should be."""
        self.expect_clock(True)
        update(self)
        self.expect_clock(False)
        if self.call("EnterStepMode") != OK:
            raise SoakError(f"no way out of event mode: {self.log[-1:]}")

    def expect_clock(self, ticks: bool) -> None:
        """Raises SoakError where the clock does not tick, or does, as it should."""
        active = ct.c_bool(not ticks)
        status = self.call("GetClock", ct.byref(self.clock), ct.c_size_t(1), ct.byref(active))
        if status != OK or active.value != ticks:
            raise SoakError(f"status {status}: the clock ticks: {active.value}, not {ticks}")

    def step(self, time: float, step: float) -> int:
        event, *_, last = self._step_results
        status, left = super().step(time, step), 1
        while status == OK and event.value and left > 0:
            if self.call("EnterEventMode") != OK:
                raise SoakError(f"no way into event mode: {self.log[-1:]}")
            self.take_event()
            left = round(step / TICK) - round((last.value - time) / TICK)
            status = super().step(last.value, left * TICK) if left > 0 else OK
        return status


class Soak:
    """The two instances of one device, and the calls made so far."""

    def __init__(self, fmu: Fmu, model: Form, rng: random.Random) -> None:
        self.fmu, self.model, self.rng = fmu, model, rng
        self.calls = self.checks = self.devices = self.diverged = 0
        self.digest = hashlib.sha256()
        self.inputs = inputs_of(model)
        self.outputs = [q.name for q in model.quantities if q.role == "output" and not q.integer]
        self.flags = [q.name for q in model.quantities if q.role == "output" and q.integer]
        self.ticks = bool(model.CLOCKS)
        self.busy, self.plain = self.another(), Instance(fmu)
        self.saved: list[ct.c_void_p] = []
        self.begin()

    def another(self) -> Instance:
        """A new instance for all calls."""
        return Ticking(self.fmu) if self.ticks else Instance(self.fmu)

    def close(self) -> None:
        """Frees all."""
        for handle in self.saved:
            self.busy.free_saved(handle)
        self.saved.clear()
        for instance in (self.busy, self.plain):
            instance.__exit__()

    def outputs_of(self, instance: Instance) -> list[float]:
        """All outputs, whatever their type."""
        return [*instance.get(*self.outputs), *(instance.get(*self.flags) if self.flags else [])]

    def begin(self) -> None:
        """A new device for both."""
        self.devices += 1
        values = random_device(self.model, self.rng)
        # What an event's time of 1.7e9 s leaves of a step is not known to the tick.
        start = self.rng.choice((0.0, 0.0, 1.25, 2.5 if self.ticks else 1.7e9))
        for instance in (self.busy, self.plain):
            self.expect(instance.call("Reset") == OK, "reset")
            instance.start(start, **values)
        self.start, self.now, self.behind = start, 0, 0
        self.reference = self.model.start(self.model.by_name["internal_step"])

    def expect(self, fact: bool, what: str) -> None:
        """Raises SoakError where ``fact`` is not one."""
        if not fact:
            raise SoakError(f"call {self.calls}: {what}; last words: {self.busy.log[-1:]} {self.plain.log[-1:]}")

    def time(self) -> float:
        """Present time of the busy instance [s]."""
        return self.start + self.now * TICK

    def check(self) -> None:
        """Brings the plain instance to the present and compares."""
        self.checks += 1
        if self.behind:
            then = self.start + (self.now - self.behind) * TICK
            self.expect(self.plain.step(then, self.behind * TICK) == OK, "the plain instance does not step")
            self.behind = 0
        values = self.outputs_of(self.busy)
        busy, plain = (struct.pack(f"<{len(v)}d", *v) for v in (values, self.outputs_of(self.plain)))
        self.expect(busy == plain, "outputs differ")
        self.expect(all(map(math.isfinite, values)), "an output is not finite")
        self.digest.update(busy)

    # What a soak does, one call or a few each.

    def step(self) -> None:
        """A step of any length."""
        ticks = max(
            1, round(self.reference * self.rng.choice((0.01, 0.3, 1.0, 1.0, 3.7, 20.0)) * self.rng.random() / TICK)
        )
        status = self.busy.step(self.time(), ticks * TICK)
        if status == ERROR and "diverged at" in self.busy.message:
            self.end_diverged(ticks)
        else:
            self.expect(status == OK, "a step is refused")
            self.now += ticks
            self.behind += ticks

    def end_diverged(self, ticks: int) -> None:
        """Both diverge, in the same state, and put out nothing."""
        self.diverged += 1
        then = self.start + (self.now - self.behind) * TICK
        self.expect(self.plain.step(then, (self.behind + ticks) * TICK) == ERROR, "only one instance diverged")
        for instance in (self.busy, self.plain):
            self.expect(all(math.isnan(v) for v in instance.get(*self.outputs)), "an output after a divergence")
        self.begin()

    def set_inputs(self) -> None:
        """New inputs for both."""
        self.check()
        for name, value in random_inputs(self.model, self.rng).items():
            for instance in (self.busy, self.plain):
                self.expect(instance.try_set(name, value) == OK, f"{name} can't be set")

    def refused(self) -> None:
        """A wrong call: it says why and changes nothing."""
        busy, rng = self.busy, self.rng
        before, said = self.outputs_of(busy), len(busy.log)
        name = rng.choice([q for q in self.inputs if not q.integer]).name
        wrong: list[Callable[[], int]] = [
            lambda: busy.step(self.time(), rng.choice((0.0, -1e-6, math.nan, math.inf, 1e9))),
            lambda: busy.step(self.time() + rng.choice((1e-3, -1e-3)) * (1.0 + self.now * TICK), 1e-6),
            lambda: busy.try_set(name, rng.choice((math.nan, math.inf))),
            lambda: busy.try_set(rng.choice(self.outputs), 1.0),
            lambda: busy.try_set("internal_step", 1e-4),
            lambda: busy.call("ExitInitializationMode"),
            lambda: busy.set_up(),
            lambda: busy.deserialize(rng.randbytes(rng.randrange(200)))[0],
        ]
        status = rng.choice(wrong)()
        self.expect(status == ERROR and len(busy.log) > said and bool(busy.message), f"status {status} of a wrong call")
        self.expect(self.outputs_of(busy) == before, "a refused call changed an output")

    def save_and_go_on_elsewhere(self) -> None:
        """The state as bytes into a new instance, which goes on instead of the old one."""
        handle = self.busy.save()
        data = self.busy.serialize(handle)
        self.busy.free_saved(handle)
        other = self.another()
        status, moved = other.deserialize(data)
        self.expect(status == OK and other.restore(moved) == OK, "a saved state is refused")
        again = other.save()
        self.expect(other.serialize(again) == data, "a restored instance saves other bytes")
        other.free_saved(moved), other.free_saved(again)
        self.busy.__exit__()
        self.busy = other

    def detour(self) -> None:
        """Saves, runs on, comes back."""
        handle = self.busy.save()
        time = self.time()
        self.busy.try_set(self.rng.choice(self.inputs).name, self.rng.choice((1e-7, 1.0)))
        for _ in range(self.rng.randint(1, 4)):
            length = self.reference * self.rng.random() + TICK
            if self.busy.step(time, length) != OK:
                break
            time += length
        self.expect(self.busy.restore(handle) == OK, "a saved state is refused")
        self.busy.free_saved(handle)
        self.check()

    def damaged(self) -> None:
        """Bytes with one that is changed are no state."""
        handle = self.busy.save()
        data = bytearray(self.busy.serialize(handle))
        self.busy.free_saved(handle)
        data[self.rng.randrange(len(data))] ^= 1 << self.rng.randrange(8)
        self.expect(self.busy.deserialize(bytes(data))[0] == ERROR, "a damaged state is taken")

    def run(self, calls: int) -> None:
        """That many of all these."""
        ways = [*[self.step] * 10, self.set_inputs, self.set_inputs, self.refused, self.refused, self.check]
        ways += [self.save_and_go_on_elsewhere, self.detour, self.damaged]
        for self.calls in range(calls):
            self.rng.choice(ways)()
            if self.rng.random() < 0.004:
                self.check()
                self.begin()
        self.check()


def soak(seed: int, calls: int, version: int, form: str, folder: Path) -> str:
    """Runs one soak and says what it did. Raises SoakError with the line that replays it."""
    path = build_form(FORMS[form])[f"fmi{version}"]
    fmu = Fmu(path, folder)
    assert fmu.version == version
    runner = Soak(fmu, FORMS[form], random.Random(f"{seed} {version} {form}"))
    try:
        runner.run(calls)
    except SoakError as error:
        replay = f"python -m tests.soak --seed {seed} --calls {calls} --fmi {version} --form {form}"
        raise SoakError(f"{error}\nreplay: {replay}") from None
    finally:
        runner.close()
    counts = f"{runner.devices} devices ({runner.diverged} diverged), {runner.checks} comparisons"
    return f"fmi{version} {form} seed {seed}: {calls} calls, {counts}, outputs {runner.digest.hexdigest()[:16]}"


def main() -> int:
    """Prints a line a form and standard; exit code 1 at what must not be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--calls", type=int, default=10_000)
    parser.add_argument("--fmi", type=int, choices=(2, 3), help="one standard; both otherwise")
    parser.add_argument("--form", choices=tuple(FORMS), help="one form; all otherwise")
    options = parser.parse_args()
    chosen = [(v, form) for v, form in KINDS if options.fmi in (v, None) and options.form in (form, None)]
    for version, form in chosen:
        with tempfile.TemporaryDirectory() as folder:
            try:
                print(soak(options.seed, options.calls, version, form, Path(folder)), flush=True)
            except SoakError as error:
                print(f"FAILED {error}", file=sys.stderr)
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
