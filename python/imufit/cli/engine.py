"""The command line's way into the library: every heavy import waits here for its first use."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from imufit.devices.emulate import Emulator
    from imufit.joining import Joined
    from imufit.lab.grade import BlindGrade
    from imufit.lab.simulate import Grade, Simulation, Truth
    from imufit.log import Contents, Log, Reading
    from imufit.log.metadata import Frame
    from imufit.results import Comparison, EffectCard, Ladder, LogInfo, LogRows, Recording

Progress = Callable[[int, int, str], None]


def reading(mapping: Sequence[str], frame: Frame | None, noise: Sequence[str], drop: Sequence[str]) -> Reading:
    """Return how a log is to be read; `mapping` and `noise` hold texts such as ``acc_x=AccX[g]`` and ``acc=0.02``."""
    from imufit.log import Reading  # noqa: PLC0415

    return Reading.of_texts(mapping, frame, noise, drop)


def open_log(path: Path, reading: Reading | None = None) -> Any:
    """Open a log, as it is to be read."""
    from imufit.log import Reading, open_log  # noqa: PLC0415

    way = reading or Reading()
    return open_log(path, way.mapping, frame=way.frame, noise=way.noise, drop=way.drop)


def open_logs(paths: Sequence[Path], reading: Reading) -> list[Any]:
    """Open logs of one sensor, all read the same way."""
    return [open_log(path, reading) for path in paths]


def read_log(
    path: Path,
    reading: Reading,
    more: int = 0,
    gigabytes: float = 1.0,
    option: str = "",
    bare: bool = False,
) -> Log:
    """Read a whole log into memory; `more` are the bytes that will be made of each row.

    A `bare` one needs neither a sensor nor a reference.

    All of it may take so many `gigabytes`; `option` allows more.

    Raises
    ------
    InputError
        It is too large for that.
    """
    from imufit.log import LogStream  # noqa: PLC0415

    stream = LogStream(path, reading.mapping, bare, frame=reading.frame, noise=reading.noise, drop=reading.drop)
    return stream.held(more, gigabytes, option)


def calibrate(logs: Sequence[Log], cost: str | None, sensors: Sequence[str], settings: Mapping[str, float]) -> Any:
    """Calibrate a sensor from its logs; no sensors named means all."""
    from imufit.calibrating import calibrate  # noqa: PLC0415

    return calibrate(list(logs), cost, sensors=sensors or ("acc", "gyr", "mag"), settings=settings)


def calibrate_live(
    port: str, keep: Path, mapping: Mapping[str, str] | None, *, sensors: Sequence[str], **options: Any
) -> tuple[Any, Log]:
    """Guide through a calibration of the device at `port`; return it and the log that was kept."""
    from imufit.devices.calibrate_live import calibrate_live  # noqa: PLC0415

    chosen = sensors or ("acc", "gyr", "mag")
    return calibrate_live(port, keep, mapping=mapping, sensors=chosen, **options)


def declared_attitude(text: str) -> tuple[str, tuple[str, ...]]:
    """Take kind and columns of an attitude apart."""
    from imufit.joining import declared_attitude  # noqa: PLC0415

    return declared_attitude(text)


def reference_log(path: Path, reading: Reading, attitude: tuple[str, tuple[str, ...]] | None, inverse: bool) -> Log:
    """Read a reference; its attitude stands in the columns of its kind, or in those of a log."""
    from imufit.joining import with_attitude  # noqa: PLC0415

    log = read_log(path, reading, bare=True)
    return log if attitude is None else with_attitude(log, *attitude, inverse=inverse)


def join(log: Log, reference: Log, lag: float | None, skew: float | None) -> Joined:
    """Lay a reference beside a sensor's log; one without a declared attitude is read as the sensor's rates show."""
    from imufit.joining import join, join_as_found  # noqa: PLC0415

    declared = reference.ref_q is not None or reference.ref_angle is not None
    way = join if declared else join_as_found
    return way(log, reference, lag, skew)


def some_rows(log: Any, rows: tuple[int, int]) -> Any:
    """Return the rows from the first number to before the second of a log."""
    from imufit.log import SomeRows  # noqa: PLC0415

    return SomeRows(log, [rows])


def contents(log: Any) -> Contents:
    """Return what a log holds and what it lacks."""
    from imufit.log import contents  # noqa: PLC0415

    return contents(log)


def info(log: Any, effects: bool, progress: Progress) -> LogInfo:
    """Return what is in a log, and which effects it can show."""
    from imufit.inspection import info  # noqa: PLC0415

    return info(log, effects=effects, progress=progress)


def plot(log: Any, progress: Progress, **options: Any) -> Figure:
    """Return a figure of the readings of a log over time."""
    from imufit.inspection import drawing  # noqa: PLC0415

    return drawing(log, progress=progress, **options).root


def sensor_model(effects: Sequence[str] = (), path: Path | None = None) -> Any:
    """Return the model kept in the file `path`, or the ideal sensor, with these `effects` on top."""
    import imufit  # noqa: PLC0415

    model = imufit.SensorModel() if path is None else imufit.SensorModel.load(path)
    for effect in effects:
        model = model.with_effect(effect)
    return model


def ladder(logs: Sequence[Any], model: Any, progress: Progress) -> Ladder:
    """Repeat diagnose and add until nothing is missing."""
    from imufit.verbs import ladder  # noqa: PLC0415

    return ladder(logs, model=model, progress=progress)


def studio(logs: Sequence[Path], reading: Reading, demo: bool, *, port: int, ready: Callable[[str], None]) -> None:
    """Serve the studio on logs, or on the log of a demonstration, until Ctrl-C; `ready` receives the address.

    Raises
    ------
    InputError
        NiceGUI is not installed, the port is taken, or a log cannot be read.
    """
    from imufit.errors import InputError  # noqa: PLC0415

    try:
        from imufit.studio.start import start  # noqa: PLC0415
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("imufit"):
            raise
        raise InputError(
            f"the studio needs the package {error.name}, which is not installed",
            remedy="Install it with: pip install 'imufit[studio]'.",
        ) from None
    start(logs, reading, demo, port=port, ready=ready)


def rows_of_fit(fit: Any, first: Any = None, candidate: str | None = None, *, progress: Progress) -> LogRows:
    """Return the rows of a fit's log that a report shows."""
    from imufit.comparing import rows_of_fit  # noqa: PLC0415

    return rows_of_fit(fit, first, candidate, progress)


def compare_with_rows(model: Any, log: Any, progress: Progress) -> tuple[Comparison, LogRows]:
    """Compare a model as it is with a log, and return the rows of the log that a report shows."""
    from imufit.comparing import compare_with_rows  # noqa: PLC0415

    return compare_with_rows(model, log, progress)


def catalogue() -> list[EffectCard]:
    """Return every effect there is, the user's own included."""
    import imufit  # noqa: PLC0415

    return list(imufit.catalogue())


def explain(effect: str) -> EffectCard:
    """Return the card of one effect."""
    import imufit  # noqa: PLC0415

    return imufit.explain(effect)


def load_effects(path: Path) -> None:
    """Run a user's file of effects, so that the catalogue has them.

    Raises
    ------
    InputError
        The file cannot be run; the message states why.
    """
    import imufit  # noqa: PLC0415
    from imufit.errors import InputError  # noqa: PLC0415

    try:
        imufit.load_effects(path)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"the effects cannot be loaded: {type(error).__name__}: {error}", file=path) from error


def filter_settings() -> Mapping[str, Mapping[str, Any]]:
    """Return the settings of each filter and of the replay's rules: default, unit, meaning by name."""
    from imufit.replaying import SETTINGS  # noqa: PLC0415

    return SETTINGS


def replay(
    log: Any, filters: Sequence[str], progress: Progress, settings: Mapping[str, Mapping[str, float]] | None = None
) -> Any:
    """Run attitude filters over a log.

    Raises
    ------
    InputError
        A filter lacks its sensor, or a setting cannot be.
    """
    from imufit.errors import InputError  # noqa: PLC0415
    from imufit.replaying import replay  # noqa: PLC0415

    try:
        return replay(log, filters=tuple(filters), settings=settings, progress=progress)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(str(error), file=log.path) from error


def allan(log: Log, progress: Progress) -> Any:
    """Take the Allan deviation of each sensor over the longest rest of a log."""
    from imufit.allan_deviation import allan  # noqa: PLC0415

    return allan(log, progress=progress)


def filter_noise(found: Any) -> dict[str, dict[str, float]]:
    """Return the noise settings of the filters that follow from an Allan deviation."""
    from imufit.allan_deviation import filter_noise  # noqa: PLC0415

    return filter_noise(found)


def tune(log: Log, filter_name: str, progress: Progress, **options: Any) -> Any:
    """Tune the gains of a filter on a log.

    Raises
    ------
    InputError
        The log lacks what this takes, or a setting cannot be.
    """
    from imufit.errors import InputError  # noqa: PLC0415
    from imufit.tuning import tune  # noqa: PLC0415

    try:
        return tune(log, filter_name, progress=progress, **options)
    except InputError:
        raise
    except ValueError as error:
        raise InputError(str(error), file=log.path) from error


def write_settings(settings: Mapping[str, Mapping[str, float]], path: Path) -> None:
    """Write settings of filters as TOML, one table a filter."""
    from imufit.replaying import write_settings  # noqa: PLC0415

    write_settings(settings, path)


def read_settings(path: Path) -> dict[str, dict[str, float]]:
    """Read settings of filters from TOML.

    Raises
    ------
    InputError
        No TOML, or no table of numbers; the place is named.
    """
    from imufit.replaying import read_settings  # noqa: PLC0415

    return read_settings(path)


def write_log(log: Any, path: Path) -> None:
    """Write a log as Parquet, CSV or NPZ, by the path's ending."""
    log.write(path)


def export(path: Path, form: str) -> str:
    """Return the constant part of the model in a file, in the words of others.

    Raises
    ------
    InputError
        The model has nothing to export, or a gain without inverse; the file is named.
    """
    from imufit.errors import InputError  # noqa: PLC0415
    from imufit.exporting import export  # noqa: PLC0415

    model = sensor_model(path=path)
    try:
        return export(model, form)
    except InputError as error:
        raise InputError(error.problem, file=path, remedy=error.advice) from None


def changes(recorded: Log, corrected: Log) -> dict[str, dict[str, Any]]:
    """Return by how much the readings of each sensor differ: samples, RMS per axis and largest, with their unit."""
    import numpy as np  # noqa: PLC0415

    units = {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"}
    found = {}
    for name, unit in units.items():
        before, after = getattr(recorded, name), getattr(corrected, name)
        if before is None:
            continue
        change = (after - before)[np.isfinite(after - before)]
        size = {"rms": float(np.sqrt(np.mean(change**2))), "max": float(np.abs(change).max())} if change.size else {}
        found[name] = {"n": int(np.isfinite(after).all(axis=1).sum()), "rms": 0.0, "max": 0.0, **size, "unit": unit}
    return found


def scenarios() -> dict[str, str]:
    """Return the scenarios that can be simulated, with what happens in each."""
    from imufit.lab.simulate.scenarios import SCENARIOS  # noqa: PLC0415

    return {name: scenario.description for name, scenario in SCENARIOS.items()}


def injections() -> list[str]:
    """Return the effects that can be simulated."""
    from imufit.lab.simulate.injections import INJECTIONS  # noqa: PLC0415

    return list(INJECTIONS)


def faults() -> list[str]:
    """Return the faults of the data that can be simulated."""
    from imufit.lab.simulate.faults import FAULTS  # noqa: PLC0415

    return list(FAULTS)


def with_fault(simulation: Simulation, fault: str) -> Simulation:
    """Put a fault of the data into a simulated log.

    Raises
    ------
    InputError
        The log has not the sensor that the fault needs.
    """
    from imufit.errors import InputError  # noqa: PLC0415
    from imufit.lab.simulate.faults import with_fault  # noqa: PLC0415

    try:
        return with_fault(simulation, fault)
    except ValueError as error:
        raise InputError(str(error)) from error


def simulate(scenario: str, effects: Mapping[str, Mapping[str, float] | None], **settings: Any) -> Simulation:
    """Simulate a log with these effects; None instead of parameters draws them.

    Raises
    ------
    InputError
        The scenario cannot have such an effect, or a setting cannot be.
    """
    from imufit.errors import InputError  # noqa: PLC0415
    from imufit.lab.simulate import simulate  # noqa: PLC0415

    try:
        return simulate(scenario, effects, **settings)
    except ValueError as error:
        raise InputError(str(error)) from error


def hidden(scenario: str, seed: int, **settings: Any) -> Simulation:
    """Simulate a log with an effect that the seed picks."""
    from imufit.errors import InputError  # noqa: PLC0415
    from imufit.lab.simulate import hidden  # noqa: PLC0415

    try:
        simulation, _ = hidden(scenario, seed, **settings)
    except ValueError as error:
        raise InputError(str(error)) from error
    return simulation


def save_simulation(simulation: Simulation, path: Path) -> Path:
    """Write the log to `path` and its sealed truth beside it; return where that is."""
    from imufit.lab.simulated_log import save_simulation  # noqa: PLC0415

    return save_simulation(simulation, path)


def emulator(
    source: str,
    reading: Reading,
    *,
    faults: Sequence[str],
    fault_rates: Sequence[str],
    clock: Mapping[str, Any],
    **settings: Any,
) -> Emulator:
    """Return a device without hardware, not yet plugged in; faults and their rates as on the command line.

    Raises
    ------
    InputError
        It cannot be emulated; the message states why.
    """
    from imufit.devices.emulate import Clock, Emulator, parse_fault_rate  # noqa: PLC0415
    from imufit.errors import InputError  # noqa: PLC0415
    from imufit.lab.simulate import SCENARIOS  # noqa: PLC0415
    from imufit.log import Reading  # noqa: PLC0415

    rates = dict(parse_fault_rate(text) for text in fault_rates)
    given: str | Log = source
    if source not in SCENARIOS and Path(source).exists():
        given = read_log(Path(source), reading)
    elif reading != Reading():
        raise InputError("--map, --frame, --noise and --drop are for a log", remedy="Leave them out for a scenario.")
    return Emulator(given, faults=faults, fault_rates=rates, clock=Clock(**clock), **settings)


def data_sheet_errors(seed: int) -> dict[str, dict[str, float] | None]:
    """Return the errors of a sensor within the limits of its data sheet."""
    from imufit.devices.emulate.data_sheet import data_sheet_errors  # noqa: PLC0415

    return {**data_sheet_errors(seed)}


@contextmanager
def running(device: Emulator, watch: Callable[[int, str], None]) -> Iterator[None]:
    """Let a device run until it has sent everything or is asked to end, also where Ctrl-C is ignored at the start.

    `watch` receives the samples so far, and whether a reader is there.
    """
    from imufit.devices.record.signals import requests_to_end  # noqa: PLC0415

    with requests_to_end() as asked, device:
        yield
        while not device.join(0.1) and not asked():
            told = device.summary()
            watch(told["samples"], "not read" if told["samples"] and told["unread"] == told["samples"] else "")


def unseal(path: Path) -> Truth:
    """Return what was done to a simulated log.

    Raises
    ------
    InputError
        The sealed truth beside the log is missing or damaged.
    """
    from imufit.errors import InputError  # noqa: PLC0415
    from imufit.lab.simulate import unseal  # noqa: PLC0415

    try:
        return unseal(path)
    except (ValueError, FileNotFoundError) as error:
        raise InputError(str(error)) from error


def grade_answer(truth: Truth, answer: Mapping[str, Any]) -> Grade:
    """Judge the JSON of `diagnose` or `ladder` against the truth."""
    from imufit.lab.simulate import grade  # noqa: PLC0415

    return grade(truth, answer)


def blind_sets() -> Mapping[str, str]:
    """Return the sets of blind logs with what they hide."""
    from imufit.lab.grade import SETS  # noqa: PLC0415

    return {name: blind_set.title for name, blind_set in SETS.items()}


def grade_blind(*, sets: Sequence[str], logs: int, seed: int, processes: int | None, progress: Progress) -> BlindGrade:
    """Run the blind protocol on many hidden logs."""
    from imufit.lab.grade import grade  # noqa: PLC0415

    return grade(sets, logs=logs, seed=seed, processes=processes, progress=progress)


def status_line(mapping: Sequence[str], quiet: bool, **options: Any) -> Any:
    """Return the status line of a recording; `mapping` holds texts such as ``acc_x=AccX[g]``."""
    from imufit.devices.record.status import StatusLine  # noqa: PLC0415
    from imufit.log import parse_mapping  # noqa: PLC0415

    return StatusLine(parse_mapping(*mapping) or None, quiet, **options)


def rig(axis: str, angle: str, say: Callable[[str], None]) -> Any:
    """Return a one-axis rig at an angle such as ``5deg``, whose next angles are typed into the terminal."""
    from imufit.devices.record import Rig, TypedAngles  # noqa: PLC0415
    from imufit.devices.record.rig import angle_of  # noqa: PLC0415

    return Rig(axis, angle_of(angle), TypedAngles(say))  # type: ignore[arg-type]


def record(port: str, path: Path, mapping: Sequence[str], **options: Any) -> Recording:
    """Record a device; `mapping` as for `status_line`."""
    from imufit.devices.record import record  # noqa: PLC0415
    from imufit.log import parse_mapping  # noqa: PLC0415

    return record(port, path, mapping=parse_mapping(*mapping) or None, **options)


def recover(file: Path, path: Path | None, **options: Any) -> Recording:
    """Make a log of what a crash left."""
    from imufit.devices.record import recover  # noqa: PLC0415

    return recover(file, path, **options)


def monitor(port: str, filters: Sequence[str], mapping: Sequence[str], model: Any, **options: Any) -> Iterator[Any]:
    """Give states of a device until it is stopped; `mapping` as for `status_line`."""
    from imufit.devices.monitor import Monitor  # noqa: PLC0415
    from imufit.devices.record.signals import requests_to_end  # noqa: PLC0415
    from imufit.log import parse_mapping  # noqa: PLC0415

    chosen = parse_mapping(*mapping) or None
    with (
        requests_to_end() as ended,
        Monitor(port, filters, model=model, mapping=chosen, stopped=ended, **options) as states,
    ):
        yield from states
