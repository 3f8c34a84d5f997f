"""Applying a model inverts its forward gain, whatever matrix and offset it has."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from imufit import Log, SensorModel

SIX = [("x", "y"), ("x", "z"), ("y", "x"), ("y", "z"), ("z", "x"), ("z", "y")]


@settings(max_examples=60, deadline=None)
@given(
    gain=arrays(np.float64, (3, 3), elements=st.floats(-3.0, 3.0)),
    offset=arrays(np.float64, 3, elements=st.floats(-100.0, 100.0)),
    seed=st.integers(0, 1000),
    sensor=st.sampled_from(["acc", "gyr", "mag"]),
)
def test_apply_inverts_any_gain_and_offset(gain, offset, seed, sensor):
    # Parameters hold what a gain differs from one by: a gain that is lost beside one they cannot hold.
    singular = np.linalg.svd(gain, compute_uv=False)
    assume(singular[-1] > 1e-2 and singular[0] < 1e3 * singular[-1])
    x = np.random.default_rng(seed).normal(0.0, 10.0, (50, 3))
    log = Log.from_arrays(np.arange(50) * 0.01, **{sensor: x @ gain.T + offset})
    error = gain - np.eye(3)
    if sensor == "mag":
        soft = {a + b: error[i, j] for i, a in enumerate("xyz") for j, b in enumerate("xyz")}
        wrong = {"mag.soft_iron": soft, "mag.hard_iron": dict(zip("xyz", offset, strict=True))}
    else:
        wrong = {
            f"{sensor}.scale": dict(zip("xyz", np.diag(error), strict=True)),
            f"{sensor}.misalignment": {a + b: error["xyz".index(a), "xyz".index(b)] for a, b in SIX},
            f"{sensor}.bias": dict(zip("xyz", offset, strict=True)),
        }
    parameters = {key: {name: float(v) for name, v in values.items()} for key, values in wrong.items()}
    found = getattr(SensorModel(list(parameters), parameters).apply(log), sensor)
    assert np.abs(found - x).max() < 1e-10 * max(1.0, np.abs(offset).max())
