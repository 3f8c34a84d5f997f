"""Every file that is written: whole or not at all, through no link, and never over an input."""

import contextlib
import errno
import io
import json
import os
import stat
import threading
from pathlib import Path

import imufit
import numpy as np
import pytest
from imufit import InputError, Log, SensorModel
from imufit.cli.app import main
from imufit.cli.output import Output
from imufit.lab.simulate import Truth, seal
from imufit.replaying import write_settings
from imufit.whole_file import whole_file, write_text

MODEL = SensorModel(["gyr.bias"], {"gyr.bias": {"x": 0.01, "y": 0.02, "z": 0.03}})
OLD = b"what was here before"


def log():
    t = np.arange(300) / 100.0
    return Log.from_arrays(t, gyr=np.full((300, 3), 0.02), acc=np.full((300, 3), 9.81 / 3**0.5))


def figure():
    from matplotlib.figure import Figure

    made = Figure()
    made.add_subplot().plot([0, 1], [1, 0])
    return made


WRITERS = {
    "model.toml": MODEL.save,
    "settings.toml": lambda path: write_settings({"mahony": {"k_p": 1.0}}, path),
    "log.parquet": lambda path: log().write(path),
    "log.npz": lambda path: log().write(path),
    "log.csv": lambda path: log().write(path),
    "answer.json": lambda path: Output(path).json({"a": 1}),
    "report.html": lambda path: Output().html(path, "<html></html>"),
    "figure.png": lambda path: Output().plot(path, figure()),
    "figure.svg": lambda path: Output().plot(path, figure()),
    "a.parquet.sealed": lambda path: seal(Truth("handheld", 1), path.with_suffix("")),
}


@pytest.fixture(params=list(WRITERS))
def writer(request):
    return request.param, WRITERS[request.param]


def names(folder):
    """Names in a folder, but for the metadata of a CSV or NPZ log."""
    return sorted(file.name for file in folder.iterdir() if file.name != "log.toml")


def test_what_is_replaced_keeps_its_other_names_and_its_mode(writer, tmp_path):
    name, write = writer
    path, other = tmp_path / name, tmp_path / "other name"
    path.write_bytes(OLD)
    path.chmod(0o640)
    os.link(path, other)
    write(path)
    assert path.read_bytes() != OLD
    assert other.read_bytes() == OLD, "nothing is written through a hard link"
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert names(tmp_path) == sorted([name, "other name"]), "nothing is left beside it"


def test_a_symbolic_link_stays_one_and_its_target_is_replaced(writer, tmp_path):
    name, write = writer
    (tmp_path / "links").mkdir()
    (tmp_path / "files").mkdir()
    path, target = tmp_path / "links" / name, tmp_path / "files" / f"target of {name}"
    target.write_bytes(OLD)
    path.symlink_to(Path("..") / "files" / target.name)
    write(path)
    assert path.is_symlink()
    assert target.read_bytes() == path.read_bytes() != OLD
    assert names(tmp_path / "links") == [name]
    assert names(tmp_path / "files") == [target.name]


def test_a_disk_that_fills_leaves_the_old_file_and_nothing_half_made(writer, tmp_path, monkeypatch):
    name, write = writer
    path = tmp_path / name
    path.write_bytes(OLD)

    def full(*_arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(imufit.whole_file.os, "fsync", full)
    with pytest.raises((OSError, InputError), match="No space left on device"):
        write(path)
    monkeypatch.undo()
    assert path.read_bytes() == OLD
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_a_reader_never_sees_a_part(tmp_path):
    path, seen, stop = tmp_path / "model.toml", set(), threading.Event()
    other = SensorModel(["acc.bias"], {"acc.bias": {"x": 1.0, "y": 2.0, "z": 3.0}})
    MODEL.save(path)
    whole = {path.read_bytes()}
    other.save(path)
    whole.add(path.read_bytes())

    def read():
        while not stop.is_set():
            seen.add(path.read_bytes())

    reader = threading.Thread(target=read)
    reader.start()
    for _ in range(100):
        MODEL.save(path)
        other.save(path)
    stop.set()
    reader.join()
    assert seen <= whole


def test_the_new_files_name_cannot_be_foreseen_and_takes_no_place(tmp_path, monkeypatch):
    made, opened = [], os.open

    def watched(path, flags, *rest, **named):
        if flags & os.O_CREAT:
            assert flags & os.O_EXCL, "what stands there already is never opened"
            made.append(Path(path).name)
        return opened(path, flags, *rest, **named)

    monkeypatch.setattr(imufit.whole_file.os, "open", watched)
    for _ in range(10):
        MODEL.save(tmp_path / "model.toml")
    assert len(set(made)) == 10
    assert all(name.startswith(".model.toml.") for name in made)


def test_a_link_at_the_old_predictable_name_of_a_log_is_not_followed(tmp_path):
    victim = tmp_path / "victim"
    victim.write_bytes(OLD)
    for suffix in (".parquet", ".csv"):
        (tmp_path / f".a.new{suffix}").symlink_to(victim)
        log().write(tmp_path / f"a{suffix}")
        assert imufit.read(tmp_path / f"a{suffix}").n == 300
        assert not (tmp_path / f"a{suffix}").is_symlink()
    assert victim.read_bytes() == OLD


def test_a_new_file_gets_the_mode_that_the_umask_leaves(tmp_path):
    before = os.umask(0o027)
    try:
        MODEL.save(tmp_path / "model.toml")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "model.toml").stat().st_mode) == 0o640


def test_a_link_to_nowhere_makes_the_file_that_it_names(tmp_path):
    (tmp_path / "link.toml").symlink_to("later.toml")
    MODEL.save(tmp_path / "link.toml")
    assert (tmp_path / "link.toml").is_symlink()
    assert SensorModel.load(tmp_path / "later.toml").effects == ("gyr.bias",)


def test_links_that_lead_in_a_circle_are_refused(tmp_path):
    (tmp_path / "a.toml").symlink_to("b.toml")
    (tmp_path / "b.toml").symlink_to("a.toml")
    with pytest.raises(InputError, match=r"^a\.toml: .*cannot be written \(Too many levels of symbolic links\)"):
        MODEL.save(tmp_path / "a.toml")
    assert (tmp_path / "a.toml").is_symlink()


def test_a_folder_that_is_missing_is_named_by_the_file_that_was_asked_for(tmp_path):
    with pytest.raises(InputError, match=r"^model\.toml: .*none/model\.toml cannot be written \(No such file"):
        MODEL.save(tmp_path / "none" / "model.toml")
    with pytest.raises(FileNotFoundError) as caught:
        write_text(tmp_path / "none" / "page.html", "")
    assert caught.value.filename == str(tmp_path / "none" / "page.html")


def test_an_exception_while_writing_leaves_the_old_file(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(OLD)
    with contextlib.suppress(KeyboardInterrupt), whole_file(path) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert path.read_bytes() == OLD
    assert [file.name for file in tmp_path.iterdir()] == ["a"]


def test_a_pipe_is_written_to_and_stays_one(tmp_path):
    path, got = tmp_path / "pipe", io.BytesIO()
    os.mkfifo(path)
    reader = threading.Thread(target=lambda: got.write(path.read_bytes()))
    reader.start()
    write_text(path, "through the pipe")
    reader.join()
    assert got.getvalue() == b"through the pipe"
    assert stat.S_ISFIFO(path.stat().st_mode)


def test_a_log_whose_metadata_cannot_be_written_stays_as_it_was(tmp_path):
    log().write(tmp_path / "a.csv")
    before = (tmp_path / "a.csv").read_bytes()
    (tmp_path / "a.toml").write_text("effects = []\n")
    with pytest.raises(InputError, match="this file is in the way"):
        imufit.read(log_with_other_rows(tmp_path)).write(tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_bytes() == before
    assert (tmp_path / "a.toml").read_text() == "effects = []\n"


def log_with_other_rows(folder):
    log().rows(0, 250).write(folder / "b.parquet")
    return folder / "b.parquet"


@pytest.fixture
def files(tmp_path):
    log().write(tmp_path / "log.csv")
    MODEL.save(tmp_path / "model.toml")
    return tmp_path


def refused(capsys, *arguments):
    code = main([str(argument) for argument in arguments])
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    return code == 2 and "would be overwritten" in err


@pytest.mark.parametrize("make", [os.symlink, os.link], ids=["symbolic", "hard"])
def test_a_link_to_an_input_is_that_input(files, capsys, make):
    make(files / "log.csv", files / "link.csv")
    make(files / "model.toml", files / "link.json")
    before = (files / "log.csv").read_bytes()
    assert refused(capsys, "apply", files / "model.toml", files / "log.csv", "-o", files / "link.csv")
    assert refused(capsys, "export", files / "model.toml", "--to", "json", "-o", files / "link.json")
    assert (files / "log.csv").read_bytes() == before


@pytest.mark.parametrize("make", [os.symlink, os.link], ids=["symbolic", "hard"])
def test_a_log_that_is_named_twice_by_links_counts_once(files, capsys, make):
    make(files / "log.csv", files / "link.csv")
    assert main(["diagnose", str(files / "log.csv"), str(files / "link.csv")]) == 2
    assert "is named twice" in capsys.readouterr().err


def test_the_metadata_beside_an_input_are_kept_too(files, capsys):
    assert (files / "log.toml").exists()
    before = (files / "log.toml").read_bytes()
    assert refused(capsys, "fit", files / "log.csv", "--effects", "gyr.bias", "-o", files / "log.toml")
    out = files / "model.csv"  # its metadata would stand in model.toml
    assert refused(capsys, "apply", files / "model.toml", files / "log.csv", "-o", out)
    assert (files / "log.toml").read_bytes() == before
    assert not out.exists()


def test_a_file_of_its_own_is_written(files, capsys):
    code = main(["export", str(files / "model.toml"), "--to", "json", "-o", str(files / "gains.json")])
    assert code == 0, capsys.readouterr().err
    assert json.loads((files / "gains.json").read_text())
