"""--map, --frame, --noise and --drop: the same on every command that reads a log, and in Python."""

from __future__ import annotations

import json
from pathlib import Path

import imufit
import numpy as np
import pytest
from imufit.cli.app import imufit as program
from imufit.cli.app import main
from imufit.errors import InputError
from imufit.lab.simulate import simulate
from imufit.log import parse_noise

OPTIONS = {"--map", "--frame", "--noise", "--drop"}
COMMANDS: dict[str, tuple[str, ...]] = {
    "info": ("info", "LOG", "--quick"),
    "plot": ("plot", "LOG", "-o", "OUT/plot.png"),
    "calibrate": ("calibrate", "LOG", "--sensor", "gyr", "--hold", "1"),
    "compare": ("compare", "LOG"),
    "diagnose": ("diagnose", "LOG"),
    "add": ("add", "gyr.bias", "LOG"),
    "ladder": ("ladder", "LOG"),
    "fit": ("fit", "LOG", "--effects", "gyr.bias"),
    "apply": ("apply", "MODEL", "LOG", "-o", "OUT/applied.parquet"),
    "replay": ("replay", "LOG", "--filter", "accel", "-o", "OUT/replayed.parquet"),
    "tune": ("tune", "LOG", "--filter", "complementary"),
    "allan": ("allan", "LOG", "-o", "OUT/allan.parquet"),
    "convert": ("convert", "LOG", "-o", "OUT/converted.parquet"),
    "join": ("join", "LOG", "LOG", "-o", "OUT/joined.parquet"),
    "emulate": ("emulate", "LOG", "--duration", "0.1", "--no-wait", "--on", "socket://127.0.0.1:0"),
}
"""Each command that reads a log, as short as it can be."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log without metadata in ENU whose magnetometer holds a word: no command reads it as it is."""
    made = tmp_path_factory.mktemp("options")
    log = simulate("poses", {"gyr.bias": {"x": 0.02}}, seed=5, rate=25, frame="ENU", duration=90).to_log()
    log.write(made / "log.csv")
    (made / "log.toml").unlink()
    lines = (made / "log.csv").read_text().splitlines()
    at = lines[0].split(",").index("mag_y")
    cells = lines[700].split(",")
    cells[at] = "oops"
    lines[700] = ",".join(cells)
    (made / "log.csv").write_text("\n".join(lines) + "\n")
    imufit.SensorModel(["gyr.bias"]).fit(log).save(made / "model.toml")
    return made


def run(folder: Path, command: str, *more: str) -> int:
    places = {"LOG": str(folder / "log.csv"), "MODEL": str(folder / "model.toml")}
    words = [places.get(word, word.replace("OUT/", f"{folder}/")) for word in COMMANDS[command]]
    return main([*words, *more])


def test_every_command_with_map_for_a_file_has_all_four_options():
    found = set()
    for name, command in program.commands.items():
        options = {each for parameter in command.params for each in parameter.opts}
        if "--drop" in options:
            assert options >= OPTIONS, name
            found.add(name)
    # The studio serves until it is stopped: tests/test_studio_browser.py reads logs with it.
    assert found == {*COMMANDS, "studio"}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_column_that_cannot_be_read_is_left_out(folder: Path, command: str, capsys: pytest.CaptureFixture[str]):
    # The gyroscope of a rest has a bias that these commands see with no magnetometer.
    assert run(folder, command) == 2
    assert "column mag_y: 'oops' is not a number" in capsys.readouterr().err
    assert run(folder, command, "--drop", "mag", "--frame", "ENU", "--noise", "gyr=0.05[deg/s]") == 0


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--drop", "tmep"), "Did you mean temp?"),
        (("--drop", "mag", "--noise", "gir=1"), "Did you mean gyr?"),
        (("--drop", "mag", "--noise", "gyr=1[uT]"), "the noise of gyr: [uT] is a unit of magnetic flux density"),
        (("--drop", "mag", "--frame", "XYZ"), "unknown frame 'XYZ'"),
    ],
)
def test_an_option_that_cannot_be_is_refused(
    folder: Path, command: str, words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
):
    assert run(folder, command, *words) == 2
    error = capsys.readouterr().err.splitlines()
    assert len(error) == 1
    assert said in error[0]


@pytest.mark.parametrize("command", ["apply", "replay", "allan", "convert"])
def test_a_log_that_is_written_has_what_the_options_say(folder: Path, command: str):
    assert run(folder, command, "--drop", "mag,temp", "--frame", "enu", "--noise", "acc=2[mg],gyr=0.001") == 0
    written = imufit.read(folder / COMMANDS[command][-1].removeprefix("OUT/"))
    assert written.metadata.frame == "ENU"
    assert written.mag is None
    assert written.temp is None
    if command != "allan":  # which measures the noise itself
        assert written.metadata.noise == pytest.approx({"acc": 2e-3 * 9.80665, "gyr": 0.001})


def test_the_frame_decides_over_the_error_of_a_replay(folder: Path, capsys: pytest.CaptureFixture[str]):
    errors = {}
    for frame in ("ENU", "NED"):
        assert (
            main(
                [
                    "replay",
                    str(folder / "log.csv"),
                    "--filter",
                    "accel",
                    "--drop",
                    "mag",
                    "--frame",
                    frame,
                    "--json",
                    "-",
                ]
            )
            == 0
        )
        errors[frame] = json.loads(capsys.readouterr().out)["filters"]["accel"]["inclination_deg"]
    assert errors["ENU"] < 1.0
    assert errors["NED"] > 30.0


def test_the_noise_is_the_one_on_the_error_axis(folder: Path):
    floors = {}
    for noise in (0.02, 0.2):
        log = imufit.read(folder / "log.csv", drop="mag", frame="ENU", noise={"acc": noise})
        floors[noise] = imufit.SensorModel().compare(log).to_dict()["channels"]["acc_x"]["noise_floor"]
    assert floors[0.2] > 5.0 * floors[0.02]


def test_a_frame_against_the_file_is_told(tmp_path: Path):
    log = simulate("handheld", {}, seed=1, duration=5).to_log()
    log.write(tmp_path / "own.parquet")
    assert log.metadata.frame == "NED"
    read = imufit.read(tmp_path / "own.parquet", frame="NWU", noise={"gyr": 0.5})
    assert read.metadata.frame == "NWU"
    assert read.metadata.noise == {**log.metadata.noise, "gyr": 0.5}
    assert any("the frame is NWU as asked; the file states NED" in note for note in read.notes)
    assert not any("frame" in note for note in imufit.read(tmp_path / "own.parquet", frame="NED").notes)


FOREIGN = "Time (s),AccX (g),AccY (g),AccZ (g),MagX,MagY,MagZ,note\n" + "".join(
    f"{k / 100},{0.01 * (k % 3)},0,1,{5000 + k % 7},{4000 + k % 5},{-9000 + k % 3},x\n" for k in range(300)
)


@pytest.mark.parametrize("drop", ["mag", "mag,note", ("MagX", "MagY,MagZ"), ("mag_x,mag_y,mag_z",)])
def test_what_is_left_out_of_another_makers_file_is_not_asked_about(tmp_path: Path, drop: str | tuple[str, ...]):
    path = tmp_path / "phone.csv"
    path.write_text(FOREIGN)
    with pytest.raises(InputError, match="unit of the magnetometer"):
        imufit.read(path)
    log = imufit.read(path, drop=drop)
    assert log.mag is None
    assert not log.covariates
    assert ("note" in log.labels) == ("note" not in drop)
    assert np.allclose(log.acc[:, 2], 9.80665)


def test_a_name_with_a_comma_is_one_column(tmp_path: Path):
    path = tmp_path / "a.csv"
    path.write_text('t,acc_x,acc_y,acc_z,"a,b",a,b\n' + "".join(f"{k / 10},0,0,9.8,1,2,3\n" for k in range(20)))
    assert set(imufit.read(path, drop="a,b").covariates) == {"a", "b"}
    assert set(imufit.read(path, drop=["a", "b"]).covariates) == {"a,b"}


@pytest.mark.parametrize(
    ("reading", "said"),
    [
        ({"drop": "MagX"}, "They belong together: leave out mag"),
        ({"drop": "mag", "mapping": {"mag_x": "MagX"}}, "mapped and left out at once"),
        ({"drop": "MagX,MagY,MagZ", "mapping": {"heading": "MagX"}}, "the mapping takes heading from it"),
        ({"drop": "mag,nte"}, "Did you mean note"),
        ({"drop": "acc,mag,note", "mapping": {"t": "Time (s)"}}, "no sensor"),
        ({"frame": "SEU"}, "Write NED, ENU or NWU"),
        ({"noise": {"acc": -1.0}}, "no sensor has such a standard deviation"),
    ],
)
def test_a_reading_that_contradicts_itself_is_refused(tmp_path: Path, reading: dict, said: str):
    path = tmp_path / "phone.csv"
    path.write_text(FOREIGN)
    with pytest.raises(InputError, match=said):
        imufit.read(path, **reading)


def test_noise_in_the_units_of_a_data_sheet():
    assert parse_noise("acc=200[ug],gyr=0.1[deg/s]", "mag=300[nT]") == pytest.approx(
        {"acc": 200e-6 * 9.80665, "gyr": np.radians(0.1), "mag": 0.3}
    )
    for text in ("acc", "acc=", "acc=x", "acc=1[g", "=1", "acc=1,acc=2", "acc=1[ug/sqrt(Hz)]"):
        with pytest.raises(InputError):
            parse_noise(text)
