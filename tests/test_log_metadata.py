"""Metadata in Parquet, NPZ and sidecars."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from imufit.errors import InputError
from imufit.log import Log, Metadata, read


def log(**metadata: object) -> Log:
    return Log.from_arrays(np.arange(20.0) * 0.01, acc=np.tile([0.0, 0.0, 9.81], (20, 1)), **metadata)


def test_sidecar_overrules_key_by_key(tmp_path: Path) -> None:
    log(frame="ENU", sensor="A", place="lab").write(tmp_path / "a.parquet")
    (tmp_path / "a.toml").write_text('frame = "NWU"\nweather = "rain"\n')
    assert read(tmp_path / "a.parquet").metadata == Metadata(
        frame="NWU", sensor="A", extra={"place": "lab", "weather": "rain"}
    )


def test_existing_sidecar_is_rewritten(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('frame = "NWU"\n')
    log(frame="ENU").write(tmp_path / "a.parquet")
    assert read(tmp_path / "a.parquet").metadata.frame == "ENU"


def test_other_toml_file_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text('title = "something else"\n')
    with pytest.raises(InputError, match=r"a\.toml: this file is in the way"):
        log().write(tmp_path / "a.csv")
    assert not (tmp_path / "a.csv").exists()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        (
            "frame",
            "FRD",
            "a.parquet: column frame: metadata frame is 'FRD', which is not a frame. Write NED, ENU or NWU.",
        ),
        ("gravity", "x", "metadata gravity is 'x', which is not a gravity in m/s². Write a number such as 9.80665."),
        ("gravity", True, "metadata gravity is True"),
        ("gravity", 981, "metadata gravity is 981"),
        ("mag_reference", [1, 2], "metadata mag_reference is [1, 2], not three numbers. Write [x, y, z] in uT"),
        ("mag_reference", [1, 2, "z"], "not three numbers"),
        ("mag_reference", 5, "not three numbers"),
        ("rig_axis", "w", "metadata rig_axis is 'w', which is not a body axis."),
        ("sensor", 5, "metadata sensor is 5, not text."),
        ("noise", 0.1, "metadata noise is 0.1, not a table."),
        ("noise", {"temp": 0.1}, "metadata noise names the sensor 'temp'."),
        ("noise", {"acc": -1}, "metadata noise.acc is -1; no sensor has such a standard deviation."),
        ("noise", {"gyr": 1e-308}, "metadata noise.gyr is 1e-308; no sensor has such a standard deviation."),
    ],
)
def test_bad_metadata_names_the_key(tmp_path: Path, key: str, value: object, message: str) -> None:
    import pyarrow.parquet as pq

    log().write(tmp_path / "a.parquet")
    table = pq.read_table(tmp_path / "a.parquet").replace_schema_metadata({"imufit": json.dumps({key: value})})
    pq.write_table(table, tmp_path / "a.parquet")
    with pytest.raises(InputError) as caught:
        read(tmp_path / "a.parquet")
    assert message in str(caught.value)
    assert caught.value.column == key
    assert "\n" not in str(caught.value)


def test_bad_sidecar_is_named(tmp_path: Path) -> None:
    log().write(tmp_path / "a.csv")
    (tmp_path / "a.toml").write_text("frame = \n")
    with pytest.raises(InputError, match=r"^a.toml: not valid TOML"):
        read(tmp_path / "a.csv")
    (tmp_path / "a.toml").write_text('frame = "FRD"\n')
    with pytest.raises(InputError, match=r"^a.toml: column frame: "):
        read(tmp_path / "a.csv")


def test_bad_json_is_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", t=np.arange(3.0), acc=np.ones((3, 3)), metadata="{")
    with pytest.raises(InputError, match="the metadata are not valid JSON"):
        read(tmp_path / "a.npz")
    np.savez(tmp_path / "a.npz", t=np.arange(3.0), acc=np.ones((3, 3)), metadata="[]")
    with pytest.raises(InputError, match="the metadata are not a JSON object"):
        read(tmp_path / "a.npz")
