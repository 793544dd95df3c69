"""Simulated gyroscopes: whole-angle mode and rate mode."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gyro_model.device import Device
from gyro_model.progress import Progress
from gyrotwin.api.files import DeviceSource, load_design, load_device

if TYPE_CHECKING:
    from cosim.design import Design
    from gyrotwin.match_result import MatchResult
    from gyrotwin.results import RateResult, RunResult


def run(
    scenario: str | Path,
    *,
    device: DeviceSource = "reference",
    design: "str | Path | Design | Device | None" = None,
    parameters: Mapping[str, float] | None = None,
    seed: int = 1,
    duration: float | None = None,
    observer: str | Path = "ekf",
    controller: str | Path = "foucault",
    angle: str | None = None,
    sample_rate: float | None = None,
    trace_rate: float | None = None,
    rate_profile: str | Path | None = None,
    rate_column: str | None = None,
    rate_unit: str | None = None,
    rate_start: float = 0.0,
    sensing_defects: bool = False,
    effects: Sequence[str | Path] = (),
    progress: Progress | None = None,
) -> "RunResult":
    """Run a scenario in the closed loop: gyroscope, observer, controller and angle unit.

    Parameters
    ----------
    scenario : str or Path
        Packaged name (``gyrotwin list scenarios``) or a scenario file.
    device : str, Path or Device
        What the plant is.
    design : str, Path, Design, Device or None
        All that the loop may know; None: what goes with the device.
    parameters : mapping of str to float
        Parameters of the device to change, SI, and settings ``observer.NAME``, ``controller.NAME``, ``monitor.NAME``.
    seed : int
        Seed of the noises and of the first estimates.
    duration : float
        Seconds; None: the scenario's.
    observer, controller : str or Path
        By name, or a Python file that defines ``OBSERVER`` or ``CONTROLLER``.
    angle : {"A", "B", "C"}
        Angle unit; None: the scenario's.
    sample_rate : float
        Samples a second [Hz], 1e3 to 1e7; None: those of the device's sample period.
    trace_rate : float
        Rows of the trace a second [Hz]; None: 20,000, fewer in long runs.
    rate_profile, rate_column, rate_unit, rate_start
        A measured rate for the scenario ``motion``: CSV file, its column, ``"deg/s"`` or ``"rad/s"``
        (None: as its heading says), start [s].
    sensing_defects : bool
        Set offset, drift, gap, mismatches and parasitic in the pickoff.
    effects : sequence of str or Path
        Folders of further effect files.
    progress : callable
        Called with the time reached and the duration [s], some hundred times a second of simulated time.

    Returns
    -------
    RunResult
        With ``summary``, ``trace``, ``figures()``, ``save(folder)``.

    Raises
    ------
    InputError
        If an argument is wrong; the message names the remedy.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> result = gt.run("constant", seed=7, duration=0.2)
    >>> result.valid
    True
    >>> len(result.trace)
    4000

    """
    from cosim.master import simulate
    from gyrotwin.compiled import compile_once
    from gyrotwin.results import RunResult
    from gyrotwin.tasks.run import Request, prepare

    folders = tuple(map(Path, effects))
    plant = load_device(device, effects=folders)
    prepared = prepare(
        Request(
            scenario=str(scenario),
            device=plant,
            design=None if design is None else load_design(design, plant, seed),
            settings=_texts(parameters),
            rate_profile=None if rate_profile is None else Path(rate_profile),
            rate_column=rate_column,
            rate_unit=rate_unit,
            rate_start=rate_start,
            observer=str(observer),
            controller=str(controller),
            sensing_defects=sensing_defects,
            angle=angle,
            sample_rate=sample_rate,
            duration=duration,
            seed=seed,
            trace_rate=trace_rate,
            effects=folders,
        )
    )
    compile_once(prepared)
    return RunResult(prepared, simulate(prepared, progress))


def rate(
    *,
    device: DeviceSource = "rate-mode",
    design: DeviceSource | None = None,
    parameters: Mapping[str, float] | None = None,
    rate_profile: str | Path | None = None,
    rate_column: str | None = None,
    rate_unit: str | None = None,
    rate_step: float | None = None,
    rate_period: float = 8.0,
    temperature: float | tuple[float, float, float] | str | Path | None = None,
    scenario: str | Path | None = None,
    sense: str = "open",
    plant: str | None = None,
    duration: float | None = None,
    sample_rate: float | None = None,
    output_rate: float | None = None,
    seed: int = 1,
    sense_record: float | None = None,
    split_estimate: float | None = None,
    progress: Progress | None = None,
) -> "RateResult":
    """Run rate mode: drive loop, sense loop, rate over temperature, noise.

    Parameters
    ----------
    device : str, Path or Device
        What the plant is.
    design : str, Path or Device
        All that loops and calibration know of it; None: the device itself.
    parameters : mapping of str to float
        Parameters of the device to change, SI, and settings ``rate_mode.NAME``.
    rate_profile, rate_column, rate_unit
        A measured rate: CSV file, its column, ``"deg/s"`` or ``"rad/s"`` (None: as its heading says).
    rate_step, rate_period : float
        Rest, +R, rest, -R again and again [deg/s], one round in so many seconds.
    temperature : float, tuple or path
        Ambient [°C]; a ramp (start [°C], stop [°C], slope [°C/min]); or a CSV file. None: 25 °C, or the scenario's.
    scenario : str or Path
        Scenario file or name: rate, temperature, ``a_x``, ``a_y``, ``v_bias`` as courses.
    sense : {"open", "closed"}
        Sense loop.
    plant : {"full", "envelope"}
        None: full up to 60 s, else envelope.
    duration : float
        Seconds; None: what the courses last.
    sample_rate, output_rate : float
        Of the converter and of the record [Hz]; None: the device's, and the plant's.
    seed : int
        Seed of the noises.
    split_estimate : float
        Estimate the frequency split from the noise in blocks of so many seconds.
    sense_record : float
        Also record v_y as I and Q for `split`, so many samples a second [Hz].
    progress : callable
        Called with the time reached and the duration [s].

    Returns
    -------
    RateResult
        With ``summary``, ``trace``, ``sense``, ``save(folder)``.

    Raises
    ------
    InputError
        If an argument is wrong; the message names the remedy.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> result = gt.rate(plant="envelope", duration=5, seed=3)
    >>> abs(result.summary["bias_deg_s"]) < 50
    True

    """
    from cosim.rate.master import simulate
    from gyrotwin.results import RateResult
    from gyrotwin.tasks.rate import Request, prepare

    course = _course(temperature)
    prepared = prepare(
        Request(
            device=load_device(device),
            design=None if design is None else load_device(design),
            settings=_texts(parameters),
            rate_profile=None if rate_profile is None else Path(rate_profile),
            rate_column=rate_column,
            rate_unit=rate_unit,
            rate_step=rate_step,
            rate_period=rate_period,
            temperature=course,
            scenario=None if scenario is None else str(scenario),
            sense=sense,
            plant=plant,
            duration=duration,
            sample_rate=sample_rate,
            output_rate=output_rate,
            seed=seed,
            sense_record=sense_record,
            split_estimate=split_estimate,
        )
    )
    return RateResult(prepared, simulate(prepared, progress), split_estimate)


def match(
    device: DeviceSource,
    *,
    method: str = "active",
    design: DeviceSource | None = None,
    parameters: Mapping[str, float] | None = None,
    scenario: str | Path | None = None,
    temperature: float | tuple[float, float, float] | str | Path | None = None,
    rate_step: float | None = None,
    rate_period: float = 8.0,
    duration: float | None = None,
    plant: str = "envelope",
    dither: float | None = None,
    block: float | None = None,
    highest_bias: float | None = None,
    seed: int = 1,
    progress: Progress | None = None,
) -> "MatchResult":
    """Run rate mode with the bias voltage tuned until both modes are at one frequency.

    Parameters
    ----------
    device : str, Path or Device
        What the plant is.
    method : {"active", "passive", "hybrid"}
        From the answers to a small dither, from thermal noise, or the one after the other.
    design : str, Path or Device
        All that tuner, loops and calibration know; None: the device itself.
    parameters : mapping of str to float
        Parameters of the device to change, SI, and settings ``rate_mode.NAME``.
    scenario : str or Path
        Scenario file or name: rate, temperature, ``a_x``, ``a_y`` as courses; ``v_bias``: the first bias.
    temperature : float, tuple or path
        Ambient [°C]; a ramp (start [°C], stop [°C], slope [°C/min]); or a CSV file. None: 25 °C, or the scenario's.
    rate_step, rate_period : float
        Rest, +R, rest, -R again and again [deg/s], one round in so many seconds.
    duration : float
        Seconds; None: what the courses last, else 60, passive 600.
    plant : {"envelope", "full"}
        What simulates the device.
    dither : float
        Virtual rate of the tone [deg/s]; None: a tenth of full scale.
    block : float
        Seconds of a measurement; None: by the method.
    highest_bias : float
        Volts; None: twice that at which the design matches.
    seed : int
        Seed of the noises.
    progress : callable
        Called with the time reached and the duration [s].

    Returns
    -------
    MatchResult
        With ``summary``, ``trace``, ``blocks``, ``save(folder)``.

    Raises
    ------
    InputError
        If an argument is wrong; the message names the remedy.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> found = gt.match("mode_matched_as_built", design="mode_matched", duration=8)
    >>> found.summary["split"]["rms_hz"] < 0.01
    True

    """
    from calibration.matching import match as tuned
    from gyrotwin.match_result import MatchResult
    from gyrotwin.tasks.match import Request, prepare

    asking = prepare(
        Request(
            load_device(device), method, None if design is None else load_device(design), _texts(parameters),
            None if scenario is None else str(scenario), _course(temperature), rate_step, rate_period, duration, plant,
            dither, block, highest_bias, seed,
        )
    )  # fmt: skip
    return MatchResult(asking, tuned(asking, progress))


def _course(temperature: float | tuple[float, float, float] | str | Path | None) -> str | None:
    """A temperature as the text of --temperature."""
    if temperature is None:
        return None
    return ",".join(map(str, temperature)) if isinstance(temperature, tuple) else str(temperature)


def _texts(parameters: Mapping[str, float] | None) -> tuple[str, ...]:
    """Settings as the texts of --set, to the last bit."""
    return tuple(f"{name}={float(value)!r}" for name, value in (parameters or {}).items())
