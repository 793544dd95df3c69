"""The measures of the closed loop over many seeds: parameters, rate, angle, their bounds, and the sensing defects."""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from benchmarks.angle_limits import damping_bound, units_alone
from benchmarks.loop_runs import BOUND_AT, PROFILE, RATIO_NAMES, Case, Outcome, finite, measure_all
from benchmarks.report import MANY_SEEDS, Options, Report, Row, Table, row, spread
from cosim.angle import UNIT_NAMES
from cosim.layout import PARAMETER_NAMES
from gyrotwin.tasks.run import prepare

OBSERVERS: Final = ("ekf", "lyapunov")
WITHIN_TARGET: Final = {"ekf": 0.1, "lyapunov": 0.3}
"""Time within which the seven are within 1 % for good [s]."""
WINDOWS: Final = (44.0, 65.0)
"""Where the windows of the measured motion begin [s]: both turn faster than 100 deg/s."""
WINDOW: Final = 10.0
MOTION_SEEDS: Final = 10
CONSTANT_ANGLE, VARYING_ANGLE, MOTION_ANGLE = 0.1, 0.3, 0.3
"""Targets of the angle's rms error [deg]."""
DRIFT: Final = 0.1
OMEGA: Final = 0.2
BACK: Final = 0.1
OVER_BOUND: Final = 2.0
DEFECT_RATIO: Final = 2.0


class Study(NamedTuple):
    """What is run: the groups of cases share all but the seed. ``duration`` [s] shortens the runs, for tests."""

    seeds: Sequence[int]
    observers: Sequence[str] = OBSERVERS
    windows: Sequence[float] = WINDOWS
    duration: float | None = None

    def groups(self) -> list[Case]:
        """One case of each group, with seed 0."""
        groups = [Case(scenario, name, 0) for scenario in ("constant", "varying") for name in self.observers]
        groups += [Case("motion", "ekf", 0, start=start) for start in self.windows]
        groups += [case._replace(defects=True) for case in groups if case.observer == "ekf"]
        return [self._lasting(case) for case in groups]

    def seeds_of(self, group: Case) -> Sequence[int]:
        """The seeds that a group is run with: few where a run is long."""
        return self.seeds[:MOTION_SEEDS] if group.scenario == "motion" else self.seeds

    def _lasting(self, case: Case) -> Case:
        usual = WINDOW if case.scenario == "motion" else None
        return case._replace(duration=self.duration or usual)


class Results:
    """The outcomes of a study, by group."""

    def __init__(self, study: Study, outcomes: Iterable[Outcome]) -> None:
        self.study = study
        self.groups: dict[Case, list[Outcome]] = {}
        for outcome in outcomes:
            self.groups.setdefault(outcome.case._replace(seed=0), []).append(outcome)

    def plain(self, scenario: str) -> list[Case]:
        """The groups of a scenario without sensing defects."""
        return [case for case in self.groups if case.scenario == scenario and not case.defects]

    def of(self, group: Case, name: str) -> list[float]:
        """A number of every seed."""
        return [outcome.get(name) for outcome in self.groups[group]]

    def spread(self, group: Case, name: str) -> dict[str, float]:
        """Median, 95 % and worst over the seeds."""
        return spread(self.of(group, name))


def run(options: Options) -> Report:
    """Runs everything; without the measured motion its rows are left out, and that is said."""
    windows = WINDOWS if PROFILE.is_file() else ()
    study = Study(range(1, options.seeds_or(MANY_SEEDS) + 1), windows=windows)
    report = make_report(study, options.jobs)
    if not windows:
        report.notes.append(f"motion: skipped, the measured profile {PROFILE.name} is not there")
    return report


def make_report(study: Study, jobs: int) -> Report:
    """Runs a study and puts its tables together."""
    cases = [group._replace(seed=seed) for group in study.groups() for seed in study.seeds_of(group)]
    results = Results(study, measure_all(cases, jobs))
    tables = [
        Table("constant", constant_rows(results)),
        Table("varying", varying_rows(results)),
        Table(f"errors at {BOUND_AT:g} s over the posterior Cramér–Rao bound", bound_rows(results)),
        Table("--sensing-defects beside the rows above", defect_rows(results)),
    ]
    if study.windows:
        tables.insert(2, Table("motion: 10 s of a measured profile", motion_rows(results)))
    failures = [f"{o.case}: {o.failure}" for group in results.groups.values() for o in group if o.failure]
    data = {"runs": [{**o.case._asdict(), "values": finite(o.values)} for g in results.groups.values() for o in g]}
    title = f"The closed loop, {len(study.seeds)} seeds"
    return Report("loop_measures", title, tables, failures + _notes(results), data)


def constant_rows(results: Results) -> list[Row]:
    """Parameters, rate, angle and drift under the square wave."""
    rows = []
    for group in results.plain("constant"):
        rows.append(_row(results, group, "seven within 1 % for good", "within", "s", WITHIN_TARGET[group.observer]))
        rows.append(_row(results, group, "rate, rms from 20 ms after each edge", "omega", "rad/s", OMEGA))
        rows += _angle_rows(results, group, CONSTANT_ANGLE, drift=DRIFT)
        rows += _flag_rows(results, group)
        rows += _limit_rows(results, group)
    return rows


def varying_rows(results: Results) -> list[Row]:
    """Dampings after their jump, and the angle through it."""
    rows = []
    for group in results.plain("varying"):
        rows.append(_row(results, group, "dampings back within 5 % after the jump", "back", "s", BACK))
        rows += _angle_rows(results, group, VARYING_ANGLE)
        rows += _flag_rows(results, group)
        rows += _limit_rows(results, group)
    return rows


def motion_rows(results: Results) -> list[Row]:
    """The angle under the measured rate, beside the integral of the estimated rate."""
    rows = []
    for group in results.plain("motion"):
        fastest = max(results.of(group, "fastest"))
        rows += _angle_rows(results, group, MOTION_ANGLE, note=f"turns up to {fastest:.0f} °/s")
        rows.append(_row(results, group, "integral of the estimated rate, rms", "integrated_rms", "°"))
        rows.append(_row(results, group, "rate, rms", "omega", "rad/s"))
        rows += _limit_rows(results, group)
    return rows


def bound_rows(results: Results) -> list[Row]:
    """Rms over the seeds of error over bound, of all seven and by parameter."""
    squares = {
        group.observer: {name: np.square(results.of(group, f"over_bound_{name}")) for name in PARAMETER_NAMES}
        for group in results.plain("constant")
    }
    note = f"rms over {len(results.study.seeds)} seeds"
    every = {observer: float(np.sqrt(np.mean(list(each.values())))) for observer, each in squares.items()}
    rows = [row("all seven", "1", every, limit=OVER_BOUND, note=note)]
    for name in PARAMETER_NAMES:
        values = {observer: float(np.sqrt(np.mean(each[name]))) for observer, each in squares.items()}
        rows.append(row(name, "1", values, limit=OVER_BOUND, note=note))
    return rows


def defect_rows(results: Results) -> list[Row]:
    """Medians with and without the defects, and their ratio."""
    rows = []
    for group in [case for case in results.groups if case.defects]:
        plain = group._replace(defects=False)
        unit = prepare(plain.request()).scenario.angle_unit
        target = {"constant": CONSTANT_ANGLE, "varying": VARYING_ANGLE, "motion": MOTION_ANGLE}[group.scenario]
        rows.append(_compared(results, plain, group, "rate, rms", "omega", "rad/s", OMEGA))
        for name in dict.fromkeys((unit, "C")):
            rows.append(_compared(results, plain, group, f"angle {name}, rms", f"angle_{name}", "°", target))
        if group.scenario == "constant":
            within = _compared(results, plain, group, "k/m, d/m within 1 % for good", "within_ratios", "s", 0.1)
            rows.append(within)
            rows += [_ratio_error(results, plain, group, name) for name in RATIO_NAMES]
    return rows


def _row(
    results: Results, group: Case, what: str, name: str, unit: str, limit: float | None = None, note: str = ""
) -> Row:
    return row(f"{_label(group)}: {what}", unit, results.spread(group, name), limit=limit, note=note)


def _label(group: Case) -> str:
    if group.scenario != "motion":
        return group.observer if not group.defects else group.scenario
    return f"motion, {group.start:g}–{group.start + (group.duration or WINDOW):g} s"


def _angle_rows(results: Results, group: Case, limit: float, drift: float | None = None, note: str = "") -> list[Row]:
    usual = prepare(group.request()).scenario.angle_unit
    rows = []
    for unit in UNIT_NAMES:
        said = ", ".join(filter(None, ["the scenario's unit" if unit == usual else "", note]))
        rows.append(_row(results, group, f"angle {unit}, rms", f"angle_{unit}", "°", limit, said))
    rows.append(_row(results, group, f"angle {usual}, drift", f"drift_{usual}", "°/s", drift))
    return rows


def _flag_rows(results: Results, group: Case) -> list[Row]:
    """Drift of angle C late in the run beside its bound and its prediction, and what the flag was worth."""
    late, bound, predicted = (np.abs(results.of(group, f"late_{name}")) for name in ("drift", "bound", "predicted"))
    with np.errstate(invalid="ignore"):  # infinity over infinity: a run too short to have either
        ratio = np.square(late / predicted)
    known = ratio[np.isfinite(ratio)]
    note = f"mean over {len(known)} seeds {np.mean(known):.2f}, wanted 0.5 to 1.5" if len(known) else ""
    lies = int(np.count_nonzero(results.of(group, "lies")))
    rows = [_row(results, group, "angle C, slope over 0.5–1 s", "late_drift", "°/s", DRIFT, f"{lies} seeds with a lie")]
    if not np.isnan(bound).all():
        rows.append(row(f"{_label(group)}: that slope over its bound", "1", spread(late / bound)))
    rows.append(row(f"{_label(group)}: squared slope over its squared prediction", "1", spread(ratio), note=note))
    return rows


def _limit_rows(results: Results, group: Case) -> list[Row]:
    """What the dampings as well known as their bound leave of the angle."""
    usable = [o for o in results.groups[group] if o.bounds is not None and np.isfinite(o.get("converged_at"))]
    if not usable or usable[0].bounds is None or usable[0].bounds.t[-1] < usable[0].get("converged_at") + BOUND_AT:
        return []
    converged = results.spread(group, "converged_at")["median"]
    request = prepare(group.request())
    limits = damping_bound(request, usable[0].bounds, converged, len(results.study.seeds))
    note = "what an efficient estimator would leave, converged at the same time"
    if group.scenario == "motion":
        until = usable[0].bounds.t[-1]
        what = f"{_label(group)}: angle error made by {until:.2g} s that the bound on dxy leaves"
        return [row(what, "°", limits["end"], note=f"{note}; it stays in the angle")]
    return [
        row(f"{group.observer}: angle rms that the bound on dxy leaves", "°", limits["rms"], note=note),
        row(f"{group.observer}: drift that the bound on dxy leaves", "°/s", limits["drift"], note=note),
    ]


def _compared(results: Results, plain: Case, defects: Case, what: str, name: str, unit: str, target: float) -> Row:
    without, spread = results.spread(plain, name)["median"], results.spread(defects, name)
    note = f"worst {spread['worst']:.3g}; {'within' if spread['worst'] <= target else 'beyond'} the row's own target"
    return _beside(f"{_label(defects)}: {what}", unit, without, spread["median"], note)


def _ratio_error(results: Results, plain: Case, defects: Case, name: str) -> Row:
    without, with_ = (float(np.sqrt(np.mean(np.square(results.of(g, f"error_{name}"))))) for g in (plain, defects))
    what = f"{_label(defects)}: error of {name} at {BOUND_AT:g} s"
    return _beside(what, "1", without, with_, "rms over seeds")


def _beside(what: str, unit: str, without: float, with_: float, note: str) -> Row:
    ratio = with_ / without if np.isfinite(without) and without > 0 else np.nan
    values = {"plain": without, "defects": with_, "ratio": ratio}
    return row(what, unit, values, limit=DEFECT_RATIO, judged=("ratio",), note=note)


def _notes(results: Results) -> list[str]:
    """What each unit's filter alone does to the angle of each scenario."""
    notes = []
    for group in results.groups:
        converged = results.spread(group, "converged_at")["median"]
        if group.observer != "ekf" or not np.isfinite(converged):
            continue
        # With an unknown gain the mass is estimated in its own unit, and k/m with it.
        mass_error = float(np.median(results.of(group, "error_m"))) if group.defects else 0.0
        alone = units_alone(prepare(group.request()), converged, mass_error if np.isfinite(mass_error) else 0.0)
        errors = ", ".join(f"{unit} {error:.3f}°" for unit, error in alone.items())
        start = f" from {group.start:g} s" if group.start else ""
        defects = f" with defects, which make the mass seem {mass_error:+.1%} off" if group.defects else ""
        notes.append(
            f"{group.scenario}{start}{defects}: fed with the exact orbit, without noise or tones, the units err by "
            f"{errors} rms. That is their filters' own error."
        )
    return notes
