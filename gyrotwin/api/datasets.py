"""Data sets, and what they say of a device."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gyro_model.model import load_model
from gyro_model.progress import Steps
from gyrotwin.api.files import DeviceSource, load_device

if TYPE_CHECKING:
    from discrepancy.data.dataset import Dataset
    from gyrotwin.fleet_result import FleetResult
    from gyrotwin.results import DiagnosisResult

MOST_EFFECTS: Final = 6
"""Effects that a diagnosis names at most, where nothing is said."""


def load_dataset(
    folder: str | Path, *, device: DeviceSource | None = None, effects: Sequence[str | Path] = ()
) -> "Dataset":
    """Load measured runs.

    Parameters
    ----------
    folder : str or Path
        Folder with ``dataset.toml``; ``gyrotwin dataset init`` writes one.
    device : str, Path or Device
        Its parameters stand where ``[nominal]`` names none.
    effects : sequence of str or Path
        Folders of further effect files.

    Returns
    -------
    Dataset
        With ``records``, ``nominal`` (SI), ``axes``.

    Raises
    ------
    InputError
        If there is no data set, or it is wrong.

    """
    from discrepancy.data.dataset import load_dataset as load

    given = dict(load_device(device, effects=effects).parameters) if device is not None else {}
    return load(Path(folder), given, load_model(*map(Path, effects)))


def simulate_dataset(
    folder: str | Path,
    *,
    device: DeviceSource = "reference",
    hidden: Mapping[str, float] | None = None,
    runs: int = 3,
    samples: int = 8000,
    seed: int = 1,
    play: Sequence[str | Path] = (),
) -> "Dataset":
    """Write the runs that a device would give, driven over both modes, and load them.

    Parameters
    ----------
    folder : str or Path
        Where ``dataset.toml`` and the runs are written.
    device : str, Path or Device
        What is measured.
    hidden : mapping of str to float
        Parameters that differ in truth from what ``[nominal]`` will say [SI].
    runs, samples : int
        The last run is held out; samples of each at 200 kHz.
    seed : int
        Seed of drive, noise and of what the lab believes.
    play : sequence of str or Path
        Tables as a diagnosis proposes them (``next-EFFECT.csv``), each played in a further run to fit.

    Returns
    -------
    Dataset

    Raises
    ------
    InputError
        If an argument is wrong, or the folder holds a data set.

    Examples
    --------
    >>> import tempfile, gyrotwin as gt
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     data = gt.simulate_dataset(folder, hidden={"k3_x": 2e9}, samples=2000)
    >>> len(data.fit), len(data.held_out)
    (2, 1)

    """
    from discrepancy.data.dataset import load_dataset as load
    from discrepancy.trial_runs import write_trial

    write_trial(load_device(device), dict(hidden or {}), Path(folder), runs=runs, samples=samples, seed=seed,
                play=[Path(table) for table in play])  # fmt: skip
    return load(Path(folder))


def diagnose(
    dataset: "str | Path | Dataset",
    *,
    device: DeviceSource | None = None,
    effects: Sequence[str | Path] = (),
    max_effects: int = MOST_EFFECTS,
    jobs: int | None = None,
    seed: int = 0,
    progress: Steps | None = None,
    checkpoint: str | Path | None = None,
    limits: "str | Path | Mapping[str, Any] | None" = None,
) -> "DiagnosisResult":
    """Find what a model lacks to explain measured data.

    Parameters
    ----------
    dataset : str, Path or Dataset
        Measured runs.
    device : str, Path or Device
        Nominal values that replace those of the data set.
    effects : sequence of str or Path
        Folders of further effect files.
    max_effects : int
        Name at most so many, beside the further modes that the runs show.
    jobs : int
        Simulations at a time; None: one a core.
    seed : int
        Seed of whatever the search draws.
    progress : callable
        Called with one line of text a step.
    checkpoint : str or Path
        File that keeps the search after each step; an interrupted search goes on from it.
    limits : str, Path or mapping
        What the laboratory can do in a further experiment, as a TOML file or by name: ``{"longest": 0.5, "omega_z":
        (0, 0)}``; see docs/diagnosis.md.

    Returns
    -------
    DiagnosisResult
        With ``experiments``, ``effects``, ``device``, ``design``, ``misfit``, ``save(folder)``.

    Raises
    ------
    InputError
        If an argument or the data are wrong.

    """
    from discrepancy.data.checks import check, lines
    from discrepancy.data.dataset import Dataset
    from discrepancy.tell.limits import Limits
    from gyrotwin.tasks.diagnose import Request, find, with_nominal

    folders = tuple(map(Path, effects))
    if isinstance(dataset, Dataset):
        place, data = dataset.folder, replace(dataset, model=load_model(*folders)) if folders else dataset
    else:
        place = Path(dataset)
        data = load_dataset(place, device=device, effects=folders)
    given = load_device(device, effects=folders).parameters if device is not None else {}
    data, notes = with_nominal(data, given, "that was given")
    able = Limits.of(limits) if isinstance(limits, Mapping) else Path(limits) if limits is not None else None
    request = Request(place, place, None, folders, max_effects, jobs, seed, limits=able)
    warnings = [*notes, *lines(check(data))]
    kept = None if checkpoint is None else Path(checkpoint)
    return find(request, data, data.model, progress or (lambda line: None), kept, warnings)


def diagnose_each(
    folder: str | Path,
    out: str | Path,
    *,
    device: str | Path | None = None,
    effects: Sequence[str | Path] = (),
    max_effects: int = MOST_EFFECTS,
    jobs: int | None = None,
    seed: int = 0,
    force: bool = False,
    progress: Steps | None = None,
) -> "FleetResult":
    """Diagnose the data sets of many devices, and find what they have in common and which do not belong.

    Parameters
    ----------
    folder : str or Path
        Holds a folder with ``dataset.toml`` for each device, and where something is known of them besides, as their
        position on a wafer, ``devices.csv``: names in the first column, numbers in the others.
    out : str or Path
        Folder for fleet.json, report.html and the results of each device. Devices that were finished there before,
        from the same data with the same options, are not diagnosed again.
    device : str or Path
        Nominal values that replace those of the data sets.
    effects : sequence of str or Path
        Folders of further effect files.
    max_effects : int
        Name at most so many a device.
    jobs : int
        Simulations at a time; None: one a core.
    seed : int
        Seed of whatever the searches draw.
    force : bool
        Write even into a folder that holds other files.
    progress : callable
        Called with one line of text a step.

    Returns
    -------
    FleetResult
        With ``fleet``, ``devices`` (one row each), ``outliers``, ``summary``.

    Raises
    ------
    InputError
        If there is no data set, or an argument is wrong. A data set that can't be diagnosed is a row with its error.

    """
    from gyrotwin.tasks import fleet
    from gyrotwin.tasks.diagnose import Request

    nominal = None if device is None else str(device)
    request = Request(Path(folder), Path(out), nominal, tuple(map(Path, effects)), max_effects, jobs, seed)
    return fleet.find(Path(folder), request, progress, force=force)
