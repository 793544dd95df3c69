"""A short soak: random calls, right and wrong, on random devices (tests/soak.py)."""

from pathlib import Path

import pytest

from tests import soak as soaking
from tests.soak import KINDS, SoakError, soak

CALLS = 1500


@pytest.mark.parametrize(("version", "form"), KINDS)
@pytest.mark.parametrize("seed", [11, 12])
def test_random_calls_change_no_bit(seed: int, version: int, form: str, tmp_path: Path) -> None:
    said = soak(seed, CALLS, version, form, tmp_path)
    assert f"{CALLS} calls" in said


def test_a_seed_gives_the_same_calls_again(tmp_path: Path) -> None:
    first, second = (soak(13, 400, 3, "full", tmp_path / name) for name in "ab")
    assert first == second


def test_a_difference_is_found_and_replays_by_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # An input that reaches one instance only, at the last bit.
    honest = soaking.Soak.set_inputs

    def crooked(soak: soaking.Soak) -> None:
        honest(soak)
        name = soak.inputs[0].name
        soak.busy.set(**{name: soak.busy.get(name)[0] * (1 + 1e-9) + 1e-15})

    monkeypatch.setattr(soaking.Soak, "set_inputs", crooked)
    with pytest.raises(
        SoakError, match=r"differ.*\nreplay: python -m tests\.soak --seed 14 --calls 400 --fmi 2 --form"
    ):
        soak(14, 400, 2, "full", tmp_path)
