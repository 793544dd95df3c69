"""Rates with intervals, the confusion matrix, and the rows of the targets, from the results of all trials."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, Final

from scipy.stats import norm

from benchmarks.blind.grade import Grade, grade
from benchmarks.report import Report, Row, Table

Z: Final = float(norm.ppf(0.975))
LARGE, SMALL = 9.9, 2.9
"""Multiples of the detectable size from which a trial counts as "at ≥ 10×" and as "at 3×"; what a cap made smaller
does not."""
WITH_JUMPS: Final = frozenset({"dry_friction", "play", "hysteresis", "contact_stop"})
"""Of these the value is asked for besides the name."""
BINS: Final = (0.0, 0.3, 0.6, 0.9, 0.98, 1.01)
"""Edges of the probabilities that are counted together; the interval of a bin with MANY names has to hold the mean of
what was said."""
MANY: Final = 50
WITHIN: Final = 1.2
"""Final misfit over the true noise floor that a right model reaches."""


def wilson(hits: int, of: int) -> tuple[float, float]:
    """The 95 % interval of a rate (Wilson 1927, without correction for continuity); (0, 1) of nothing."""
    if of == 0:
        return 0.0, 1.0
    p, z = hits / of, Z
    middle = p + z * z / (2 * of)
    half = z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    low, high = (middle - half) / (1 + z * z / of), (middle + half) / (1 + z * z / of)
    # At the ends the difference is rounding alone.
    return low if hits > 0 else 0.0, high if hits < of else 1.0


def rate(what: str, hits: Iterable[bool], **rest: Any) -> Row:
    """One row: a rate, its interval, and of how many."""
    counted = list(hits)
    low, high = wilson(sum(counted), len(counted))
    value = sum(counted) / len(counted) if counted else None
    values = {"rate": value, "low": low, "high": high, "of": float(len(counted))}
    return Row(what, "1", values, judged=("rate",), **rest)


def summarise(name: str, results: Sequence[Mapping[str, Any]]) -> Report:
    """The report on finished trials."""
    grades = [g for g in map(grade, results) if g is not None]
    tables = [Table("targets", targets(grades)), Table("by size and kind", by_kind(grades)),
              Table("single effects, one by one", by_effect(grades)),
              Table("probabilities of names", by_probability(grades))]  # fmt: skip
    tables = [table for table in tables if table.rows]
    missing = [r["id"] for r in results if "not_made" in r]
    notes = [
        "Intervals are Wilson's, 95 %. The answer of each trial was hashed (SHA-256, in its result) before its label "
        "was opened; labels lay in a folder that the tool is not given.",
        "Noise floor, detectable sizes and what can be told apart are the generator's own; data and simulation share "
        "no code with the model under test.",
        f"Code that answered: {', '.join(sorted({r['code'][:12] for r in results}))} (SHA-256).",
        f"CPU time a trial: median {_median([g.cpu_s for g in grades]):.1f} s, largest "
        f"{max((g.cpu_s for g in grades), default=0):.1f} s.",
    ]
    if missing:
        notes.append(f"{len(missing)} trials could not be made as asked for: {', '.join(missing)}.")
    return Report(name, "Blind trials of the diagnosis", tables, notes, {"confusion": confusion(grades)},
                  {f"{name}_confusion.md": confusion_text(grades)})  # fmt: skip


def targets(grades: Sequence[Grade]) -> list[Row]:
    """The rows of the table of promises; those without a trial are left out."""
    nulls = _kind(grades, "null")
    single = _kind(grades, "single")
    large = [g for g in single if g.multiple >= LARGE]
    small = [g for g in single if SMALL <= g.multiple < LARGE]
    least = min((sum(g.right for g in own) / len(own) for own in _each(large)), default=1.0)
    jumps = [g for g in large if set(g.truth) <= WITH_JUMPS]
    several = _kind(grades, "pair", "triple")
    unknown = _kind(grades, "unknown")
    named = [g for g in grades if g.right and g.truth]
    scored = [g for g in grades if g.kind in ("null", "single", "pair", "triple")]
    rows = [
        rate("false alarm on nulls", (not g.right for g in nulls), limit=1 / 700),
        rate("single effect at ≥ 10×: exact name or correct either", (g.right for g in large), limit=0.98,
             at_least=True),
        Row("single effect at ≥ 10×: the worst effect", "1", {"rate": least, "of": float(len(_each(large)))}, 0.9,
            at_least=True, judged=("rate",), note="of effects"),
        rate("single effect at 3×", (g.right for g in small), limit=0.92, at_least=True),
        rate("friction, play, hysteresis, stop at ≥ 10×: named, with the value", (g.valued for g in jumps),
             limit=0.95, at_least=True, note="every value within twice its 95 % interval"),
        rate("pairs and triples at ≥ 10×: exact set", (g.right for g in several), limit=0.9, at_least=True),
        rate("effect and difficulty of the record: both named", (g.right for g in _kind(grades, "difficulty")),
             limit=0.95, at_least=True),
        rate("95 % intervals that cover", (c for g in named for c in g.covered.values()), limit=0.9, at_least=True,
             note="and at most 0.99"),
        rate("final misfit ≤ 1.2 of the noise floor", (_within(g.ratio) for g in scored), limit=0.95, at_least=True,
             note="nulls, singles, pairs, triples"),
        rate("term in no file: never a wrong name", (g.right for g in unknown), limit=0.99, at_least=True,
             note="\"nothing missing\" counts as wrong"),
        rate("term in no file: formula right", (bool(g.formula) for g in unknown), limit=0.85, at_least=True),
        rate("named without doubt, and held-out runs get worse by it", (g.worse for g in grades), limit=0.0),
        rate("inseparable, before: one finding with both", _stage(grades, "before"), limit=0.9, at_least=True),
        rate("inseparable, after: the right one alone", _stage(grades, "after"), limit=0.9, at_least=True),
    ]  # fmt: skip
    return [row for row in rows if row.values["of"]]


def _within(ratio: float | None) -> bool:
    return ratio is not None and ratio <= WITHIN


def _stage(grades: Sequence[Grade], level: str) -> list[bool]:
    return [g.right for g in _kind(grades, "inseparable") if g.level == level]


def _kind(grades: Sequence[Grade], *kinds: str) -> list[Grade]:
    return [g for g in grades if g.kind in kinds]


def level_of(g: Grade) -> str:
    """The size of a single effect in words; for others the level of the label."""
    if g.kind != "single":
        return g.level
    edges = ((SMALL, "< 3×"), (LARGE, "3× to 10×"), (99.0, "10× to 100×"))
    return next((text for edge, text in edges if g.multiple < edge), "100×")


def by_kind(grades: Sequence[Grade]) -> list[Row]:
    """How often right, by kind and size; beside it the misfits."""
    groups = sorted({(g.kind, level_of(g)) for g in grades if g.kind != "unknown"})
    rows = [_group(f"{kind} {level}".strip(), [g for g in grades if (g.kind, level_of(g)) == (kind, level)])
            for kind, level in groups]  # fmt: skip
    return rows + [_group("unknown", _kind(grades, "unknown"))] * bool(_kind(grades, "unknown"))


def by_effect(grades: Sequence[Grade]) -> list[Row]:
    """Of the single effects at ten times the detectable size and more."""
    return [_group(own[0].truth[0], own) for own in _each([g for g in _kind(grades, "single") if g.multiple >= LARGE])]


def _each(grades: Sequence[Grade]) -> list[list[Grade]]:
    """Those of one effect together."""
    return [[g for g in grades if g.truth[0] == effect] for effect in sorted({g.truth[0] for g in grades})]


def by_probability(grades: Sequence[Grade]) -> list[Row]:
    """How often names are right that were said with so much probability, and the error of all."""
    said = [own for g in grades for own in g.said]
    rows, error = [], 0.0
    for low, high in pairwise(BINS):
        own = [(p, right) for p, right in said if low <= p < high]
        if own:
            row = rate(f"{low:g} to {min(high, 1.0):g}", (right for _, right in own))
            mean = sum(p for p, _ in own) / len(own)
            least, most = wilson(sum(right for _, right in own), len(own))
            holds = least <= mean <= most
            note = "the mean said lies outside" if len(own) >= MANY and not holds else ""
            rows.append(row._replace(values={**row.values, "mean said": mean}, note=note))
            error += abs(sum(right for _, right in own) - mean * len(own))
    if not said:
        return []
    values = {"rate": error / len(said), "of": float(len(said))}
    return [*rows, Row("calibration error", "1", values, 0.03, judged=("rate",))]


def _group(what: str, grades: Sequence[Grade]) -> Row:
    row = rate(what, (g.right for g in grades))
    ratios = [g.ratio for g in grades if g.ratio is not None]
    refit = [g.refit_ratio for g in grades if g.refit_ratio is not None]
    wrong = Counter("+".join(g.named) or g.verdict for g in grades if not g.right)
    said = ", ".join(f"{text} {n}" for text, n in wrong.most_common(4))
    more = {"final/floor": _median(ratios), "refit/floor": _median(refit)}
    finite = {name: value if math.isfinite(value) else None for name, value in more.items()}
    return row._replace(values=dict(row.values) | finite, note=f"else: {said}" if said else "", judged=())


def confusion(grades: Iterable[Grade]) -> dict[str, dict[str, int]]:
    """How often what was said, by what was hidden; of trials with at most one effect."""
    table: dict[str, Counter[str]] = {}
    for g in grades:
        if g.kind in ("null", "single", "unknown"):
            hidden = g.level if g.kind == "unknown" else "+".join(g.truth) or "(nothing)"
            table.setdefault(hidden, Counter())["+".join(sorted(g.named)) or f"({g.verdict})"] += 1
    return {hidden: dict(said.most_common()) for hidden, said in sorted(table.items())}


def confusion_text(grades: Iterable[Grade]) -> str:
    """The confusion matrix as Markdown, one line a hidden effect: most of its columns would be empty."""
    lines = ["# Confusion matrix", "", "| hidden | said (times) |", "| --- | --- |"]
    for hidden, said in confusion(grades).items():
        lines.append(f"| {hidden} | {', '.join(f'{name} ({n})' for name, n in said.items())} |")
    return "\n".join([*lines, ""])


def _median(values: Sequence[float], of: Callable[[Sequence[float]], list[float]] = sorted) -> float:
    ordered = of(values)
    return ordered[(len(ordered) - 1) // 2] if ordered else math.nan
