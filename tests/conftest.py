"""Fixtures of all tests: the built FMUs, the residuals behind the tolerances, the switch that writes traces anew.

``--residuals`` prints, at the end, how near each tolerance was. ``--update`` rewrites traces and generated files
instead of comparing.
"""

import os
from collections.abc import Callable, Iterator

import pytest
from hypothesis import settings

from gyro_model.build import Fmus, build
from gyrotwin import notice

# For the workers and the commands that they run: their matrices are thin, and threads that wait for each other took a
# quarter of the processor time of the tests of modes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# An example may take long where the machine is busy, which says nothing of what it tests.
settings.register_profile("suite", deadline=None)
settings.load_profile("suite")

_KEY = "residual"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--residuals", action="store_true", help="print the residual behind every tolerance")
    parser.addoption("--update", action="store_true", help="rewrite traces and generated files instead of comparing")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files that take longest begin first: one left for the end would keep a single worker busy."""

    def minutes(item: pytest.Item) -> float:
        mark = item.get_closest_marker("minutes")
        return float(mark.args[0]) if mark else 0.0

    items.sort(key=minutes, reverse=True)


@pytest.fixture(scope="session")
def fmus() -> Fmus:
    """Paths of both FMUs of the present model."""
    return build()


@pytest.fixture(scope="session")
def update(request: pytest.FixtureRequest) -> bool:
    """Whether to rewrite what a test would compare with."""
    return bool(request.config.getoption("--update"))


@pytest.fixture(autouse=True)
def notices(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No command says that it is still loading, which depends on how busy the machine is, and none is heard in the
    tests after its own."""
    monkeypatch.setattr(notice, "PATIENCE", 3600.0)
    yield
    notice.hide_messages()


@pytest.fixture
def residual(record_property: Callable[[str, object], None]) -> Callable[[str, float, float], None]:
    """``residual(name, value, limit)`` records value and limit, then asserts value <= limit."""

    def check(name: str, value: float, limit: float) -> None:
        value, limit = float(value), float(limit)
        # A property travels with the report, also from a worker process.
        record_property(_KEY, (name, value, limit))
        assert value <= limit, f"{name}: {value:.3g} is beyond {limit:.3g}"

    return check


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    if not config.getoption("--residuals"):
        return
    terminalreporter.section("residuals")
    reports = [r for group in ("passed", "failed") for r in terminalreporter.stats.get(group, []) if r.when == "call"]
    for report in reports:
        for name, value, limit in (entry for key, entry in report.user_properties if key == _KEY):
            share = value / limit if limit else float(value > 0)
            terminalreporter.write_line(f"{value:10.2e} of {limit:8.1e} ({share:7.1%})  {report.nodeid}: {name}")
