"""Columns written as every format that the commands read."""

import io
import json
import math
import warnings
import zipfile
from collections.abc import Mapping
from random import Random
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from mutated.column_mutations import Columns

Metadata = Mapping[str, Any]


def csv(columns: Columns) -> bytes:
    lists = [_texts(values) for values in columns.values()]
    rows = range(max(map(len, lists), default=0))
    lines = [",".join(columns)]
    lines += [",".join(each[k] if k < len(each) else "" for each in lists) for k in rows]
    return ("\n".join(lines) + "\n").encode("utf-8", "surrogatepass")


def _texts(values: Any) -> list[str]:
    array = np.atleast_1d(np.asarray(values))
    if array.dtype.kind == "f":
        return ["" if math.isnan(x) else repr(x) for x in array.reshape(-1).tolist()]
    return [str(x) for x in array.reshape(-1).tolist()]


def npz(columns: Columns, metadata: Metadata | None = None, compressed: bool = False) -> bytes:
    """Write by hand rather than by numpy, which refuses some of the names."""
    out = io.BytesIO()
    method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w", method) as file:
        warnings.simplefilter("ignore")
        for name, values in columns.items():
            file.writestr(zipfile.ZipInfo(f"{name}.npy"), npy(values))
        if metadata is not None:
            file.writestr(zipfile.ZipInfo("imufit.npy"), npy(np.array(json.dumps(metadata))))
    return out.getvalue()


def npy(values: Any) -> bytes:
    out = io.BytesIO()
    np.save(out, np.asanyarray(values))
    return out.getvalue()


def parquet(columns: Columns, metadata: bytes | None, rng: Random) -> bytes:
    """Write with arrow; what it cannot hold is written as text or left out."""
    arrays: list[tuple[str, pa.Array]] = []
    n = max((len(np.atleast_1d(values)) for values in columns.values()), default=0)
    encoded = rng.choice(("", "", "one", "all"))
    for k, (name, values) in enumerate(columns.items()):
        array = _arrow(values, n)
        if array is None:
            continue
        if encoded == "all" or (encoded == "one" and k == len(columns) // 2):
            encodable = not (pa.types.is_nested(array.type) or pa.types.is_null(array.type))
            array = array.dictionary_encode() if encodable else array
        arrays.append((name.encode("utf-8", "replace").decode(), array))
    table = pa.Table.from_arrays([array for _, array in arrays], names=[name for name, _ in arrays])
    if metadata is not None:
        table = table.replace_schema_metadata({b"imufit": metadata})
    out = io.BytesIO()
    compression = rng.choice(("snappy", "none", "gzip", "zstd"))
    pq.write_table(table, out, compression=compression, row_group_size=rng.choice((None, 7, 100)))
    return out.getvalue()


def _arrow(values: Any, n: int) -> pa.Array | None:
    array = np.atleast_1d(np.asanyarray(values))
    try:
        made = pa.array(array.tolist() if array.ndim > 1 else array)
    except (pa.ArrowInvalid, pa.ArrowTypeError, pa.ArrowNotImplementedError, ValueError, OverflowError, TypeError):
        made = pa.array([str(x)[:400].encode("utf-8", "replace").decode() for x in array.reshape(-1).tolist()])
    if len(made) > n:
        return made.slice(0, n)
    return made if len(made) == n else pa.concat_arrays([made, pa.nulls(n - len(made), made.type)])


def transcript(columns: Columns, rng: Random) -> bytes:
    """Print one line a row as boards do."""
    form = rng.randrange(5)
    names = [name for name in columns if not name.startswith("ref_") or form == 0]
    lists = {name: _texts(columns[name]) for name in names}
    lines = ["I (12) boot: hello", "WHO_AM_I=0x70"]
    for k in range(max(map(len, lists.values()), default=0)):
        cells = {name: each[k] if k < len(each) else "" for name, each in lists.items()}
        if form == 0:
            lines.append(" ".join(f"{name}={cell}" for name, cell in cells.items()))
        elif form == 1:
            lines.append("{" + ", ".join(f'"{name}": {cell}' for name, cell in cells.items()) + "}")
        elif form == 2:
            lines.append("IMU a: " + ", ".join(f"{name}: {cell}" for name, cell in cells.items()))
        elif form == 3:
            acc, gyr = ([cells.get(f"{sensor}_{axis}", "") for axis in "xyz"] for sensor in ("acc", "gyr"))
            lines.append(f"t={cells.get('t', '')} acc=({', '.join(acc)}) gyr: {' '.join(gyr)}")
        else:
            clock = f"12:{k // 3000 % 60:02d}:{k // 50 % 60:02d}.{k % 50 * 20:03d}"
            lines.append(f"{clock} -> " + " ".join(f"{name}={cell}" for name, cell in cells.items() if name != "t"))
        if k % 97 == 50:
            lines.append(rng.choice(("# face_begin +X", "# face_end +X", "W (9) wifi: gone", "\x1b[0;32mI ok\x1b[0m")))
    return ("\n".join(lines) + "\n").encode("utf-8", "surrogatepass")
