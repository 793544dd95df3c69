"""The device as a loop knows it, written as C: what acts, what is certain, what is to be estimated.

The expressions come from the effect files by way of ``gyro_model.dynamics``, so an effect that a design names enters
prediction, measurement and controller without a line about it here. Estimated are the seven constants of the plant as
k/m, d/m and 1/m, in which the acceleration is linear, and further parameters as they are.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import inf
from pathlib import Path
from typing import Final

from sympy import Expr, Matrix, Max, Symbol, cse, expand, log, numbered_symbols, pi, sqrt
from sympy.core.function import Application

from cosim.layout import PARAMETER_NAMES
from gyro_model import symbols
from gyro_model.anatomy import Delay, Effect, Follow, Force, Lag, Law, Map
from gyro_model.c_printing import c_expression
from gyro_model.dynamics import Dynamics
from gyro_model.errors import InputError, nearest
from gyro_model.model import Model

PER_MASS: Final = tuple(f"{name}_per_mass" for name in PARAMETER_NAMES[:-1])
INVERSE_MASS: Final = "inverse_mass"
MEASURED: Final = ("temperature", "a_x", "a_y", "v_bias")
"""Inputs of the plant that the loop measures, in the order of ``in`` of the C."""

_STATE, _FORCE, _ESTIMATED, _KNOWN = "s", "f", "p", "c"
_SEEN: Final = 5 * 4 + 2
"""Entries of the linear device at rest: five matrices, the delay and the lag."""


def can_be_estimated(model: Model, name: str) -> bool:
    """Whether the loop can find a parameter of an effect: not where it is a time at which something happens, a state at
    the start, a lag of a temperature, noise, what remembers, the converter's limit, or the angular gain, which nothing
    but the angle shows; nor of a force that saturates or has a corner, whose slope the filter can't hold over a
    sample, nor where it acts on the command alone, as a share of it does."""
    effect = next((e for e in model.effects if any(q.name == name for q in e.parameters)), None)
    if effect is None or effect.noise or effect.nominal or effect.memories or isinstance(effect, Follow):
        return False
    if isinstance(effect, Force) and (uses_command(effect) or any(e.has(Application) for e in effect.terms().values())):
        return False
    timed = isinstance(effect, Law) and effect.event is not None and effect.event.name == name
    begun = name in (q.name for q in effect.starts)
    if isinstance(effect, Force):
        slopes = [e.diff(model.parameter(name).symbol) for e in effect.terms().values()]
        if _commanded(slopes) and not any(slope.subs(dict.fromkeys(_COMMANDS, 0)) for slope in slopes):
            return False
    return not (timed or begun) and name not in ("angular_gain", "adc_limit")


def uses_command(effect: Effect) -> bool:
    """Whether ``effect`` is a force of the command that no constant matrix gives: the motion changes it, or the command
    itself does."""
    if not isinstance(effect, Force):
        return False
    moving = (*symbols.STATES, *(state.symbol for state in effect.states), *_COMMANDS)
    return _commanded(e.diff(q) for e in effect.terms().values() for q in moving)


def _commanded(exprs: Iterable[Expr]) -> bool:
    return any(not e.free_symbols.isdisjoint(_COMMANDS) for e in exprs)


@dataclass(frozen=True)
class KnownModel:
    """What the loop knows of a device: the effects ``acting`` besides the nominal ones, and the ``estimated``
    parameters of effects, by FMU name.

    Raises InputError for an effect that the loop can't reckon with, and for a parameter that can't be estimated: one
    that is no effect's, or one that ``can_be_estimated`` rules out.
    """

    model: Model
    acting: tuple[str, ...]
    estimated: tuple[str, ...]

    def __post_init__(self) -> None:
        for effect_id in self.acting:
            effect = self.model.effect(effect_id)
            if isinstance(effect, Force) and any(state.rate.has(Application) for state in effect.states):
                raise InputError(
                    f"effect {effect_id}: its states bend too sharply for the loop's prediction; leave it out of the "
                    "design"
                )
            if effect.memories and not effect.noise:
                raise InputError(
                    f"effect {effect_id}: the loop's model keeps no record of what it remembers; leave it out of the "
                    "design"
                )
            if uses_command(self.model.effect(effect_id)):
                raise InputError(
                    f"effect {effect_id}: the loop takes what it commands as a force that no motion changes; leave it "
                    "out of the design"
                )
        possible = [q.name for e in self.model.effects if e.id in self.acting for q in e.parameters]
        for name in self.estimated:
            if name not in possible:
                raise InputError(
                    f"parameter {name!r} can't be estimated: no acting effect has it{nearest(name, possible)}"
                )
            if not can_be_estimated(self.model, name):
                raise InputError(f"parameter {name!r} can't be estimated by the loop: give it without an interval")

    @cached_property
    def dynamics(self) -> Dynamics:
        """The device as expressions, without its noise."""
        return Dynamics(tuple(e for e in self.acting if not self.model.effect(e).noise), self.model)

    @cached_property
    def _noisy(self) -> Dynamics:
        return Dynamics(self.acting, self.model)

    @cached_property
    def states(self) -> tuple[Symbol, ...]:
        """x, x_dot, y, y_dot and the states of effects; temperatures that lag are inputs of the loop's own making."""
        return self.dynamics.states[: len(self.dynamics.states) - len(self.dynamics.followers)]

    @cached_property
    def parameters(self) -> tuple[Symbol, ...]:
        """The estimated parameters in the filter's own coordinates."""
        return tuple(Symbol(name, real=True) for name in (*PER_MASS, *self.estimated, INVERSE_MASS))

    @cached_property
    def _own_coordinates(self) -> dict[Symbol, Expr]:
        inverse_mass = self.parameters[-1]
        per_mass = {
            symbols.BY_NAME[name]: symbol / inverse_mass
            for name, symbol in zip(PARAMETER_NAMES[:-1], self.parameters, strict=False)
        }
        return {**per_mass, symbols.m: 1 / inverse_mass}

    @cached_property
    def lowest(self) -> tuple[float, ...]:
        """The lowest value of each estimated coordinate; minus infinity where there is none."""
        return (*[-inf] * len(PER_MASS), *(self.model.parameter(name).low for name in self.estimated), -inf)

    def _own(self, exprs: Iterable[Expr]) -> tuple[Expr, ...]:
        return tuple(expr.subs(self._own_coordinates, simultaneous=True) for expr in exprs)

    @cached_property
    def rates(self) -> tuple[Expr, ...]:
        """Rate of each state under a force u_x, u_y at the mass."""
        # Expanded, the masses cancel in k/m.
        return tuple(map(expand, self._own(self.dynamics.rates_under_force[: len(self.states)])))

    @cached_property
    def _pickoff_rate(self) -> Matrix:
        """Slope of the voltages in time: they move with the positions, at the velocities; a held force adds nothing."""
        pickoff = self._own(self.dynamics.picked_off)
        return Matrix([sum(v.diff(q) * q_dot for q, q_dot in self._moving_pairs) for v in pickoff])

    @cached_property
    def _jets(self) -> Matrix:
        """Value, slope and curvature in time of the voltages at the pickoff, of either axis."""
        along = dict(zip(self.states, self.rates, strict=True))
        curve = [sum(v.diff(q) * rate for q, rate in along.items()) for v in self._pickoff_rate]
        return Matrix([*self._own(self.dynamics.picked_off), *self._pickoff_rate, *curve])

    @cached_property
    def _jets_by_parameter(self) -> Matrix:
        return self._jets.jacobian(Matrix(self.parameters))

    @cached_property
    def _shown(self) -> list[int]:
        """Places of the parameters that a voltage at the pickoff, or how it moves, has a slope by."""
        return [q for q in range(len(self.parameters)) if any(self._jets_by_parameter[:, q])]

    @cached_property
    def constants(self) -> tuple[Symbol, ...]:
        """The parameters that are known, by name in the model's order, as far as an expression uses them."""
        used = frozenset().union(*(expr.free_symbols for exprs in self._functions.values() for expr in exprs[1]))
        used |= {e.event for e in self._events if e.event is not None}
        known = [q.symbol for q in self.model.quantities if q.role not in ("input", "output")]
        return tuple(symbol for symbol in known if symbol in used and symbol not in self.parameters)

    @property
    def _events(self) -> list[Law]:
        return [e for e in self.dynamics.effects if isinstance(e, Law) and e.event is not None]

    @cached_property
    def _functions(self) -> dict[str, tuple[str, tuple[Expr, ...]]]:
        """Name of each C function -> (its output array, expressions in row order)."""
        dynamics, states, parameters = self.dynamics, Matrix(self.states), Matrix(self.parameters)
        force = Matrix([symbols.u_x, symbols.u_y])
        rates = Matrix(self.rates)
        pickoff, amplified = Matrix(self._own(dynamics.picked_off)), Matrix(self._own(dynamics.amplified))
        actuated = Matrix(self._own(dynamics.actuated))
        entering = Matrix([symbols.v_x, symbols.v_y])
        late = Matrix(self._own((dynamics.delay, dynamics.time_constant)))
        # At rest, without force: the linear part. What it leaves out of the free motion is the bend.
        still = {symbol: 0 for symbol in (*self.states, *force)}
        linear = rates.jacobian(states).subs(still)
        bend = Matrix([expand(rate.subs(dict.fromkeys(force, 0))) for rate in rates - linear * states])
        pickoff_rate = self._pickoff_rate
        seen = self._seen(linear, rates.jacobian(force), actuated, pickoff, amplified, late.applyfunc(_without_bounds))
        return {
            # The linear device at rest, and that by the parameters.
            "seen": (f"[{_SEEN} + {_SEEN} * NP]", (*seen, *seen.jacobian(parameters))),
            "bend": ("[NS]", tuple(bend)),
            "bend_by_state": ("[NS * NS]", tuple(bend.jacobian(states))),
            "rate_by_state": ("[NS * NS]", tuple(linear)),
            "pick_off_rate": ("[2]", tuple(pickoff_rate)),
            "rate_by_force": ("[NS * 2]", tuple(rates.jacobian(force))),
            "rate_by_omega": ("[NS]", tuple(rates.diff(symbols.omega_z).subs(dict.fromkeys(force, 0)))),
            "rate_by_parameter": ("[NS * NP]", tuple(self._rate_by_parameter)),
            "actuate": ("[2]", tuple(actuated)),
            "actuate_by_command": ("[2 * 2]", tuple(actuated.jacobian(force))),
            "actuate_by_parameter": ("[2 * NP]", tuple(actuated.jacobian(parameters))),
            "pick_off": ("[2]", tuple(pickoff)),
            "pick_off_by_state": ("[2 * NS]", tuple(pickoff.jacobian(states))),
            "pick_off_by_force": ("[2 * 2]", tuple(pickoff.jacobian(force))),
            "pick_off_by_parameter": ("[2 * NP]", tuple(pickoff.jacobian(parameters))),
            "amplify": ("[2]", tuple(amplified)),
            "amplify_by_voltage": ("[2 * 2]", tuple(amplified.jacobian(entering))),
            "amplify_by_parameter": ("[2 * NP]", tuple(amplified.jacobian(parameters))),
            "late": ("[2]", tuple(late)),
            "late_by_parameter": ("[2 * NP]", tuple(late.jacobian(parameters))),
            "values": ("[NP]", tuple(self._values)),
            "values_by_parameter": ("[NP * NP]", tuple(Matrix(self._values).jacobian(parameters))),
            "coordinates": ("[NP]", self._coordinates),
            "noise": ("[2]", self._noise),
            "pink": ("[2 * 2]", self._pink),
            "thermal": ("[2 * 2]", self._thermal),
            "temperature_lag": ("[2]", self._temperature_lags),
        }

    @cached_property
    def _rate_by_parameter(self) -> Matrix:
        """Slopes of the rates by the parameters, but for what the force does by way of one over the mass alone, which
        the filter knows beforehand."""
        slopes = Matrix(self.rates).jacobian(Matrix(self.parameters))
        for row, rate in enumerate(self.rates):
            forced = rate - rate.subs(dict.fromkeys(_COMMANDS, 0))
            slopes[row, -1] -= expand(forced / self.parameters[-1])
        return slopes

    @cached_property
    def _bending(self) -> list[int]:
        """Places of the states that the bend depends on."""
        slopes = Matrix(len(self.states), len(self.states), self._functions["bend_by_state"][1])
        return [i for i in range(len(self.states)) if any(slopes[:, i])]

    def _seen(
        self, linear: Matrix, by_force: Matrix, actuated: Matrix, pickoff: Matrix, amplified: Matrix, late: Matrix
    ) -> Matrix:
        """Of accelerations -kappa q - delta q' + b u and voltages c q + d u, all at rest: c, d, b, kappa, delta, row by
        row, then the delay and the lag."""
        rest = dict.fromkeys((*self.states, *_COMMANDS, symbols.v_x, symbols.v_y), 0)
        positions = [self.states.index(q) for q, _ in self._moving_pairs]
        velocities = [self.states.index(q_dot) for _, q_dot in self._moving_pairs]
        through = amplified.jacobian(Matrix([symbols.v_x, symbols.v_y]))
        acts = actuated.jacobian(Matrix(_COMMANDS)).subs(rest)
        c = (through * pickoff.jacobian(Matrix(self.states))).subs(rest).extract([0, 1], positions)
        d = (through * pickoff.jacobian(Matrix(_COMMANDS))).subs(rest) * acts
        b = by_force.extract(velocities, [0, 1]) * acts
        kappa, delta = (-linear.extract(velocities, of) for of in (positions, velocities))
        return Matrix([*c, *d, *b, *kappa, *delta, *late])

    @cached_property
    def _seen_by_voltages(self) -> tuple[Expr, ...]:
        """Of the linear device at rest how voltages follow from positions and forces, and when."""
        linear = self._functions["seen"][1][:_SEEN]
        return (*linear[:8], *linear[20:])

    @cached_property
    def value_names(self) -> tuple[str, ...]:
        """What is estimated, by FMU name, in the order of an estimate: the seven, then the parameters of effects."""
        return (*PARAMETER_NAMES, *self.estimated)

    @cached_property
    def _values(self) -> tuple[Expr, ...]:
        return self._own(self.model.parameter(name).symbol for name in self.value_names)

    @cached_property
    def _coordinates(self) -> tuple[Expr, ...]:
        """The filter's coordinates from the values, which stand in the place of the states."""
        values = {name: Symbol(f"value_{name}", real=True) for name in self.value_names}
        mass = values["m"]
        result = [values[name] / mass for name in PARAMETER_NAMES[:-1]]
        return (*result, *(values[name] for name in self.estimated), 1 / mass)

    @property
    def _moving_pairs(self) -> tuple[tuple[Symbol, Symbol], ...]:
        return (symbols.x, symbols.x_dot), (symbols.y, symbols.y_dot)

    @cached_property
    def _noise(self) -> tuple[Expr, ...]:
        """Variance of one sample [V²]: of white noise, of jitter on the slope, of rounding; pink noise counts as white
        of its density at the resonance of x."""
        total = [symbols.t * 0, symbols.t * 0]
        for effect in self._noisy.effects:
            if not (isinstance(effect, Map) and effect.noise):
                continue
            for axis, out in enumerate(effect.terms().values()):
                total[axis] += sum(out.diff(number) ** 2 for number in symbols.NORMAL)
                # What rounds has the variance of an error spread evenly over its step.
                for step in {s for f in out.atoms(symbols.nearest_integer) for s in f.args[0].free_symbols}:
                    if step not in (symbols.v_x, symbols.v_y):
                        total[axis] += step**2 / 12
        pink = self._pink_densities
        return self._own(self.dynamics.under_laws([v + p * _PINK_SHARE for v, p in zip(total, pink, strict=True)]))

    @cached_property
    def _pink_densities(self) -> tuple[Expr, ...]:
        """a² of the density a²/f of the pink noise of either voltage."""
        maps = [e for e in self._noisy.effects if isinstance(e, Map) and e.noise]
        outs = [tuple(e.terms().values()) for e in maps]
        return tuple(
            sum((out[axis].diff(number) ** 2 for out in outs for number in symbols.PINK), symbols.t * 0)
            for axis in range(2)
        )

    @cached_property
    def _pink(self) -> tuple[Expr, ...]:
        """For either voltage, what the variance of pink noise lacks of that of the white noise it counts as, and the
        mean product of neighbouring samples [V²]."""
        densities = self._pink_densities
        terms = [(p * (_PINK_SHARE - _PINK_VARIANCE), p * _PINK_NEIGHBOURS) for p in densities]
        return self._own(self.dynamics.under_laws([term for pair in terms for term in pair]))

    @cached_property
    def _thermal(self) -> tuple[Expr, ...]:
        """Variance of the noise force over a sample [N²], shape (2, 2)."""
        forces = [self._noisy.noise_force(e) for e in self._noisy.effects if e.noise and e.stage == "force"]
        total = Matrix.zeros(2, 2)
        for force in forces:
            by_number = Matrix(force).jacobian(Matrix(symbols.NORMAL))
            total += by_number * by_number.T
        return self._own(self.dynamics.under_laws(tuple(total)))

    @cached_property
    def _temperature_lags(self) -> tuple[Expr, ...]:
        constants = {f.target: f.time_constant for f in self.dynamics.followers}
        return tuple(constants.get(target, symbols.t * 0) for target in symbols.SET_BY)

    def fingerprint(self) -> str:
        """Names what is written from here, without writing it: the effects that act as they state themselves, what is
        estimated, and the text of this program."""
        effects = [repr(replace(self.model.effect(name), doc="")) for name in sorted(self.acting)]
        nominal = [repr(replace(e, doc="")) for e in self.model.effects if e.nominal]
        return "\0".join([*effects, *nominal, *self.estimated, _program()])

    def sizes(self) -> dict[str, int]:
        """The sizes that the C is compiled for."""
        effects = self.dynamics.effects
        return {
            "NS": len(self.states),
            "NP": len(self.parameters),
            "NQ": len(self._bending),
            "NV": len(self._shown),
            "NC": max(len(self.constants), 1),
            "HAS_LAG": int(any(isinstance(e, Lag) for e in effects)),
            "LAG_ENDS": int(self.dynamics.time_constant.has(Max)),
            "HAS_DELAY": int(any(isinstance(e, Delay) for e in effects)),
            "HAS_THERMAL": int(any(self._functions["thermal"][1])),
            "FEEDS": int(any(self._functions["pick_off_by_force"][1])),
            "READS": int(any(c.has(*self.parameters) for c in self._seen_by_voltages)),
            "BENT": int(any(self._functions["bend"][1])),
            "LINEAR_ACTUATOR": int(all(not e.diff(*[s] * 2) for e in self._functions["actuate"][1] for s in _COMMANDS)),
        }

    def header(self) -> str:
        """The C header ``known_model.h``."""
        lines = [
            "/* Written by cosim/known_model.py from the effect files. */",
            "#ifndef KNOWN_MODEL_H",
            "#define KNOWN_MODEL_H",
        ]
        lines += ['#include "known.h"', '#include "wide.h"']
        for name, places in (("bending", self._bending), ("shown", self._shown)):
            lines.append(f"static const int known_{name}[] = {{{', '.join(map(str, places)) or 0}}};")
        lines.append(self._flat())
        for name, (shape, exprs) in self._functions.items():
            lines.append(self._spread(name, exprs) if name in _SPREAD else self._function(name, shape, exprs))
        lines.append(self._jet())
        return "\n".join([*lines, "#endif", ""])

    def _flat(self) -> str:
        """The function that says of each estimated constant whether the device is flat in it at its lowest value, the
        other effects being neutral: the inverse of a gap acts by its square."""
        late = (self.dynamics.delay, self.dynamics.time_constant)
        chain = self._own((*self.dynamics.actuated, *self.dynamics.picked_off, *self.dynamics.amplified, *late))
        estimated = [self.model.parameter(name) for name in self.estimated]
        neutral = {q.symbol: q.start for q in estimated}
        slopes = [[e.diff(q.symbol).subs({**neutral, q.symbol: q.low}) for e in (*self.rates, *chain)]
                  if q.low > -inf else [1] for q in estimated]  # fmt: skip
        flat = [*[0] * len(PER_MASS), *(int(not any(own)) for own in slopes), 0]
        return "\n".join([
            "static inline int known_is_flat(int i)",
            "{",
            f"    static const char flat[NP] = {{{', '.join(map(str, flat))}}};",
            "    return flat[i];",
            "}",
        ])  # fmt: skip

    def sizes_header(self) -> str:
        """The C header ``sizes.h``."""
        sizes = [f"#define {name} {value}" for name, value in self.sizes().items()]
        return "\n".join(["#ifndef SIZES_H", "#define SIZES_H", *sizes, "#endif", ""])

    def _function(self, name: str, shape: str, exprs: Sequence[Expr]) -> str:
        pairs, reduced = cse(exprs, numbered_symbols("w"), optimizations="basic")
        used = frozenset().union(*(e.free_symbols for e in (*reduced, *(e for _, e in pairs))), frozenset())
        body = [
            f"static inline void known_{name}(const known *k, const double *s, const double *f, double omega_z,",
            f"                                double out{shape})",
            "{",
        ]
        body += ["    (void)k, (void)s, (void)f, (void)omega_z;"]
        body += [
            f"    const double {symbol.name} = {text};" for symbol, text in self._sources().items() if symbol in used
        ]
        body += [f"    const double {symbol.name} = {c_expression(expr)};" for symbol, expr in pairs]
        body += [f"    out[{i}] = {c_expression(expr)};" for i, expr in enumerate(reduced)]
        return "\n".join([*body, "}"])

    def _jet(self) -> str:
        """The function that writes the jets and their derivatives by the states, and to ``by_p``, a row an axis, those
        by the parameters of `shown` times the ``weight`` of value, slope and curvature: in one, they share their
        terms. It does so at POINTS points side by side: of each number an array has that of every point, one after
        another."""
        plain = [*self._jets, *self._jets.jacobian(Matrix(self.states))]
        slopes, shown = list(self._jets_by_parameter[:, self._shown]), len(self._shown)
        present = [i for i, expr in enumerate(slopes) if expr != 0]
        pairs, reduced = cse([*plain, *(slopes[i] for i in present)], numbered_symbols("w"), optimizations="basic")
        terms: dict[int, list[str]] = {place: [] for place in range(2 * shown)}
        for i, expr in zip(present, reduced[len(plain) :], strict=True):
            row, q = divmod(i, shown)
            terms[row % 2 * shown + q].append(f"weight[{row // 2} * POINTS + i]*({c_expression(expr)})")
        sums = {place: " + ".join(own) or "0.0" for place, own in terms.items()}
        used = frozenset().union(*(e.free_symbols for e in (*reduced, *(e for _, e in pairs))))
        sources = {symbol.name: text for symbol, text in self._sources().items() if symbol in used}
        own = {name: text[:-1] + " * POINTS + i]" for name, text in sources.items() if text[:2] in ("s[", "f[")}
        return "\n".join([
            "static inline void known_jet(const known *k, const double *restrict s, const double *restrict f,",
            "                             double omega_z, const double *restrict weight, double *restrict out,",
            "                             double *restrict by_p)",
            "{",
            "    (void)k, (void)s, (void)f, (void)omega_z, (void)weight, (void)by_p;",
            *(f"    const double {name} = {text};" for name, text in sources.items() if name not in own),
            "    for (int i = 0; i < POINTS; i++) {",
            *(f"        const double {name} = {text};" for name, text in own.items()),
            *(f"        const double {symbol.name} = {c_expression(expr)};" for symbol, expr in pairs),
            *(f"        out[{i} * POINTS + i] = {c_expression(expr)};" for i, expr in enumerate(reduced[: len(plain)])),
            *(f"        by_p[{place} * POINTS + i] = {total};" for place, total in sums.items()),
            "    }",
            "}",
        ])  # fmt: skip

    def _spread(self, name: str, exprs: Sequence[Expr]) -> str:
        """A function that adds m J to ``out`` for a Jacobian J by the parameters or states, whose many zeros it leaves
        out: m has as many columns as J has rows, and out as many as J, by the parameters filled up to NW."""
        by_state = name.endswith("_by_state")
        columns, count = ("NS", len(self.states)) if by_state else ("NW", len(self.parameters))
        present = [(divmod(i, count), expr) for i, expr in enumerate(exprs) if expr != 0]
        pairs, reduced = cse([expr for _, expr in present], numbered_symbols("w"), optimizations="basic")
        used = frozenset().union(*(e.free_symbols for e in (*reduced, *(e for _, e in pairs))), frozenset())
        rows = len(exprs) // count
        body = [
            f"static inline void spread_{name}(const known *k, const double *s, const double *f, double omega_z,",
            "                                  const double *m, int rows, double *out)",
            "{",
            "    (void)k, (void)s, (void)f, (void)omega_z, (void)m, (void)rows, (void)out;",
        ]
        body += [
            f"    const double {symbol.name} = {text};" for symbol, text in self._sources().items() if symbol in used
        ]
        body += [f"    const double {symbol.name} = {c_expression(expr)};" for symbol, expr in pairs]
        body += [f"    const double j{i} = {c_expression(expr)};" for i, expr in enumerate(reduced)]
        if present:
            body.append("    for (int r = 0; r < rows; r++) {")
            body += [
                f"        out[r * {columns} + {q}] += m[r * {rows} + {row}] * j{i};"
                for i, ((row, q), _) in enumerate(present)
            ]
            body.append("    }")
        return "\n".join([*body, "}"])

    def _sources(self) -> dict[Symbol, str]:
        """Where the C finds each symbol. The pair ``f`` is a force where the function takes one, else a voltage or a
        command."""
        sources = {symbol: f"s[{i}]" for i, symbol in enumerate(self.states)}
        for first, second in ((symbols.u_x, symbols.u_y), (symbols.v_x, symbols.v_y)):
            sources |= {first: "f[0]", second: "f[1]"}
        sources |= {symbols.v_x_rate: "f[0]", symbols.v_y_rate: "f[1]"}
        sources |= {Symbol(f"value_{name}", real=True): f"s[{i}]" for i, name in enumerate(self.value_names)}
        sources |= {symbol: f"k->p[{i}]" for i, symbol in enumerate(self.parameters)}
        sources |= {symbol: f"k->c[{i}]" for i, symbol in enumerate(self._constants_once)}
        sources |= {symbols.BY_NAME[name]: f"k->in[{i}]" for i, name in enumerate(MEASURED)}
        sources |= {
            f.state: f"k->in[{len(MEASURED) + list(symbols.SET_BY).index(f.target)}]" for f in self.dynamics.followers
        }
        sources |= {target: "k->in[0]" for target in symbols.SET_BY} | {symbols.t: "k->t"}
        index = {symbol: i for i, symbol in enumerate(self._constants_once)}
        for law in self._events:
            after = Symbol(f"after_{law.id}", real=True)
            sources[after] = f"k->t >= k->c[{index[law.event]}] ? 1.0 : 0.0"
        return sources

    @cached_property
    def _constants_once(self) -> tuple[Symbol, ...]:
        return self.constants


_SPREAD: Final = (
    *("rate_by_parameter", "actuate_by_parameter", "pick_off_by_parameter", "amplify_by_parameter"),
    "bend_by_state",
)
"""What is written as a function of ``_spread``."""
_COMMANDS: Final = (symbols.u_x, symbols.u_y)
# Density a²/f one-sided, at the resonance of x, as the variance of white noise up to half the sample rate.
_PINK_SHARE: Final = pi * sqrt(symbols.m / symbols.kxx) / symbols.sample_period
_FOLLOWED: Final = 10.0
"""Below it an estimated offset follows the pink noise [Hz]."""
# Integral of 1/f from there to half the sample rate, and of cos(2 pi f T)/f: Ci(pi) - Ci(2 pi f T), the latter small.
_PINK_VARIANCE: Final = -log(2 * _FOLLOWED * symbols.sample_period)
_PINK_NEIGHBOURS: Final = 0.0737 - 0.5772 - log(2 * pi * _FOLLOWED * symbols.sample_period)


def _without_bounds(expr: Expr) -> Expr:
    """``expr`` where no bound is reached: Max(e, 0) as e."""
    return expr.replace(Max, lambda *terms: sum(term for term in terms if not term.is_number))


@cache
def _program() -> str:
    """The text of what turns effects into expressions and C."""
    import gyro_model

    package = Path(gyro_model.__file__).parent
    names = ("anatomy.py", "symbols.py", "dynamics.py", "c_printing.py", "model.py")
    return "".join(path.read_text(encoding="utf-8") for path in (Path(__file__), *(package / name for name in names)))
