"""`gyrotwin dataset`: data sets of measured runs from a lab's own tables."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer
from rich.console import Console

from gyro_model.device import load_device
from gyro_model.errors import InputError, nearest

if TYPE_CHECKING:
    from discrepancy.data.import_table import Request

dataset_app = typer.Typer(no_args_is_help=True, help="Data sets of measured runs.")

console = Console()


@dataset_app.callback()
def group() -> None:
    """Data sets of measured runs."""


@dataset_app.command()
def init(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Tables, one a run: text, .parquet, .mat, .npy, .npz.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for dataset.toml and the tables in SI.")] = Path("dataset"),
    maps: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            metavar="COLUMN=HEADING",
            help='As in --map v_x="Ch 1 \\[mV]", v_x=2, the second column, u_x=none; repeatable.',
        ),
    ] = None,
    scales: Annotated[
        list[str] | None,
        typer.Option("--scale", metavar="COLUMN=NUMBER|UNIT", help="To SI, as in --scale v_x=mV; repeatable."),
    ] = None,
    sample_rate: Annotated[float | None, typer.Option(help="Samples a second, where no column is the time.")] = None,
    hold: Annotated[
        str,
        typer.Option(help="How u runs between samples: zero, first, band-limited; by default what the response shows."),
    ] = "",
    senses: Annotated[
        str, typer.Option(help="What v shows: position, velocity, acceleration; by default what its unit says.")
    ] = "",
    nominal: Annotated[
        str | None, typer.Option(metavar="DEVICE|FILE", help="Device whose parameters are the nominal ones.")
    ] = None,
    held_out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Table that no fit sees; default the last, or a fifth of one.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.")] = False,
) -> None:
    r"""Write a data set from a lab's own tables: columns and units are guessed by headings such as `rate \[deg/s]`."""
    from discrepancy.data.import_table import Request, write_dataset
    from discrepancy.data.record import Hold, Senses

    for option, value, known in (
        ("hold", hold or "zero", get_args(Hold)),
        ("senses", senses or "position", get_args(Senses)),
    ):
        if value not in known:
            raise InputError(f"--{option} {value}: use {', '.join(known)}{nearest(value, known)}")
    if sample_rate is not None and not 0 < sample_rate < float("inf"):
        raise InputError(f"--sample-rate {sample_rate:g}: give a positive number in Hz")
    parameters = load_device(nominal).parameters if nominal else {}
    request = Request(
        tuple(files),
        out,
        _pairs("--map", maps),
        _pairs("--scale", scales),
        sample_rate,
        hold,
        senses,
        parameters,
        held_out,
        force,
    )
    request = _asked(request) if sys.stdin.isatty() and sys.stdout.isatty() else request
    path, said = write_dataset(request)
    for line in [*said, f"wrote {path}"]:
        console.print(line, soft_wrap=True, highlight=False, markup=False)
    if not parameters:
        console.print(
            "[nominal] is left to the record; fill in what you believe, or name the device by --nominal",
            highlight=False,
            markup=False,
        )


@dataset_app.command()
def simulate(
    out: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder for dataset.toml and the runs.")],
    device: Annotated[str, typer.Option(help="Packaged device by name, or a device file.")] = "reference",
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="What is hidden in it (SI); repeatable.")
    ] = None,
    runs: Annotated[int, typer.Option(help="The last one is held out.")] = 3,
    samples: Annotated[int, typer.Option(help="Samples a run, at 200 kHz.")] = 8000,
    seed: Annotated[int, typer.Option(help="Seed of drive, noise and of what the lab believes.")] = 1,
    play: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="A table to play in a further run, such as next-EFFECT.csv; repeatable."),
    ] = None,
) -> None:
    """Write the runs that a device would give, driven over both modes: to try `gyrotwin diagnose`."""
    from discrepancy.trial_runs import write_trial

    hidden = {name: _number(name, text) for name, text in _pairs("--set", settings).items()}
    path = write_trial(load_device(device), hidden, out, runs=runs, samples=samples, seed=seed, play=play or ())
    console.print(f"wrote {path}", soft_wrap=True, highlight=False, markup=False)


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"--set {name}={text}: give a number") from None


def _pairs(option: str, texts: list[str] | None) -> dict[str, str]:
    """COLUMN=VALUE texts as a mapping. Raises InputError where the = is missing."""
    pairs: dict[str, str] = {}
    for text in texts or []:
        column, equals, value = text.partition("=")
        if not (column and equals and value):
            raise InputError(f"{option} {text!r}: write {option} COLUMN=VALUE")
        pairs[column] = value
    return pairs


def _asked(request: "Request") -> "Request":
    """The request with what the first table does not tell, asked on the terminal."""
    from discrepancy.data.import_table import FORCES, guess_sources, missing_columns, read_lab_table
    from discrepancy.data.pieces import NONE

    headings = read_lab_table(request.files[0]).columns
    while missing := missing_columns(guess_sources(headings, request), request.sample_rate):
        console.print(f"headings: {', '.join(headings)}", soft_wrap=True, highlight=False, markup=False)
        if missing[0] == "t":
            rate = typer.prompt("No column is the time. Samples a second", type=float)
            request = replace(request, sample_rate=rate if rate > 0 else None)
        else:
            other = f", or {NONE} if no force acted" if missing[0] in FORCES else ""
            heading = typer.prompt(f"Which heading is {missing[0]}{other}")
            request = replace(request, maps={**request.maps, missing[0]: heading})
    return request
