"""The command `gyrotwin`: its subcommands by name, each loaded when it is called."""

import importlib
import io
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup

from gyro_model.errors import InputError, nearest
from gyrotwin import __version__
from gyrotwin.interrupt import Interrupted, interrupt
from gyrotwin.notice import promise, show_messages, shown

SETTINGS: Final = {"help_option_names": ["-h", "--help"]}


class _Entry(NamedTuple):
    """Where a command is, as MODULE:NAME of a function or a typer.Typer, and the first line of its help."""

    place: str
    help: str


COMMANDS: Final = {
    "play": _Entry(
        "gyrotwin.commands.play:play",
        "Write a page that runs the FMU itself: orbit, spectrum, ring-down, a slider for every effect, a game.",
    ),
    "run": _Entry("gyrotwin.commands.run:run", "Run a scenario in the closed loop and report."),
    "rate": _Entry("gyrotwin.tasks.rate:rate", "Run rate mode: drive loop, sense loop, rate over temperature, noise."),
    "datasheet": _Entry(
        "gyrotwin.commands.datasheet:datasheet",
        "Measure the datasheet of a device: the tests of IEEE Std 1431, Allan analysis, formulas beside.",
    ),
    "export": _Entry("gyrotwin.commands.export:export_app", "What was measured, for other programs."),
    "compensate": _Entry(
        "gyrotwin.tasks.compensate:compensate",
        "Fit a temperature compensation and write it as TOML and as a C header, with before and after.",
    ),
    "split": _Entry(
        "gyrotwin.tasks.split:split",
        "Find the frequency split of the two modes in a record of normal operation, from thermal noise.",
    ),
    "match": _Entry(
        "gyrotwin.tasks.match:match",
        "Run rate mode with the bias tuned to matched modes, from noise or by a small dither.",
    ),
    "diagnose": _Entry(
        "gyrotwin.tasks.diagnose:diagnose",
        "Find what a model lacks to explain measured data, and write the improved model.",
    ),
    "dataset": _Entry("gyrotwin.dataset:dataset_app", "Data sets of measured runs."),
    "sweep": _Entry(
        "gyrotwin.commands.sweep:sweep", "Run a task at many points: grids, lists, distributions; on Dask."
    ),
    "compare": _Entry("gyrotwin.commands.compare:compare", "Put devices, or finished runs, side by side."),
    "effect": _Entry(
        "gyrotwin.commands.effect:effect_app", "Parts of your own: effects, observers, controllers, scenarios."
    ),
    "device": _Entry("gyrotwin.commands.device:device_app", "Device files."),
    "build": _Entry(
        "gyrotwin.commands.build:build",
        "Build the FMUs Gyroscope, GyroscopeEnvelope, GyroscopeSensor and GyroscopeClocked, and print where they are.",
    ),
    "verify": _Entry(
        "gyrotwin.commands.verify:verify",
        "Replay the reference traces that an FMU brings and print how far its outputs are off; exit code 1: too far.",
    ),
    "schema": _Entry(
        "gyrotwin.commands.schema:schema",
        "Print the JSON Schema of a file format, by which an editor completes and checks what one types.",
    ),
    "list": _Entry("gyrotwin.commands.listing:list_", "List what there is by name."),
}
"""Each help is the first line of the command's own docstring; a test compares them."""


def load_command(name: str) -> Any:
    """The command of that name in COMMANDS, with what it imports."""
    module, _, attribute = COMMANDS[name].place.partition(":")
    # What `build` prints are paths for other programs.
    show_messages(sys.stderr if name == "build" else None)
    promise(f"loading {name}")
    found = getattr(importlib.import_module(module), attribute)
    if not isinstance(found, typer.Typer):
        single = typer.Typer(add_completion=False, pretty_exceptions_enable=False, context_settings=SETTINGS)
        single.command(name)(found)
        found = single
    return typer.main.get_command(found)


class _Lazy(TyperGroup):
    """A group that loads a command when it is called, and none for its own help."""

    # Contexts and commands are typer's or click's own, by typer's version: no type of theirs can be named here.
    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        entry = COMMANDS.get(cmd_name)
        return None if entry is None else TyperCommand(cmd_name, help=entry.help)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name = args[0]
        if name not in COMMANDS:
            there = nearest(name, COMMANDS) or f"; there are {', '.join(COMMANDS)}"
            raise InputError(f"command {name!r} is unknown{there}")
        return name, load_command(name), args[1:]


app = typer.Typer(
    cls=_Lazy,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings=SETTINGS,
    help="A MEMS vibratory gyroscope as an FMU, and the loop that measures its angle.",
)


def _print_version(asked: bool) -> None:
    if asked:
        print(f"gyrotwin {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: bool = typer.Option(
        False, "--version", help="Print the version and exit.", callback=_print_version, is_eager=True
    ),
) -> None:
    """A MEMS vibratory gyroscope as an FMU, and the loop that measures its angle."""


def _say_usage(error: Any) -> None:
    """One line for a mistyped command line; the help where there were no arguments at all."""
    context = getattr(error, "ctx", None)
    if type(error).__name__ == "NoArgsIsHelpError":
        # With rich the help was printed when the error was made.
        print(error.format_message(), end="")
        return
    where = context.command_path if context is not None else "gyrotwin"
    said = " ".join(error.format_message().split()).rstrip(".")
    print(f"gyrotwin: {said}; `{where} --help` lists what there is", file=sys.stderr)


def _remedy(place: Any) -> str:
    """What helps where the folder of compiled parts, or one above it, can't be made or written."""
    import platformdirs

    cache = Path(platformdirs.user_cache_dir("gyrotwin"))
    inside = isinstance(place, str) and (cache.is_relative_to(place) or Path(place).is_relative_to(cache))
    return "; compiled parts are kept there: set XDG_CACHE_HOME to a folder that can be written" if inside else ""


def main(arguments: Sequence[str] | None = None) -> Any:
    """Entry point: one line and exit code 2 for wrong input, 130 for Ctrl-C."""
    signal.signal(signal.SIGINT, interrupt)
    for stream in (sys.stdout, sys.stderr):
        # A terminal or a pipe whose encoding lacks a letter gets a question mark for it.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        ended = app(args=arguments, prog_name="gyrotwin", standalone_mode=False)
        sys.exit(ended if isinstance(ended, int) else 0)
    except InputError as error:
        shown()
        print(f"gyrotwin: {error}", file=sys.stderr)
        sys.exit(2)
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        print(f"gyrotwin: {place}{error.strerror or error}{_remedy(error.filename)}", file=sys.stderr)
        sys.exit(2)
    except Interrupted as stop:
        print(f"gyrotwin: interrupted; {stop.left}", file=sys.stderr)
        sys.exit(130)
    except Exception as error:
        # typer's own classes, or click's, by typer's version.
        if type(error).__name__ == "Abort":
            print("gyrotwin: aborted; nothing written", file=sys.stderr)
            sys.exit(1)
        if "(os error " in str(error):
            # Of polars, whose errors of the file system are its own.
            shown()
            print(f"gyrotwin: {str(error).splitlines()[0]}", file=sys.stderr)
            sys.exit(2)
        if not hasattr(error, "format_message"):
            raise
        shown()
        _say_usage(error)
        sys.exit(2)
    finally:
        shown()
        signal.signal(signal.SIGINT, signal.default_int_handler)


if __name__ == "__main__":
    main()
