# %% [markdown]
# # Your own data
#
# A log is a table with one row per sample. Most files are read as they are. This notebook reads a file with
# other names, units and signs.
#
# The first cell writes a file of another logger: milliseconds, g, deg/s, degrees Fahrenheit, both z axes inverted, and
# the attitude of a turntable as three angles. Its gyroscope is off by 0.3 deg/s about y.
# %%
import tempfile
from pathlib import Path

import imufit
import numpy as np
import pandas as pd
from foreign_csv import MAPPING, foreign_file
from scipy.spatial.transform import Rotation

folder = tempfile.TemporaryDirectory()
file = Path(folder.name) / "rig.csv"
foreign_file(file)
pd.read_csv(file).head(3).round(3)
# %% [markdown]
# ## The mapping
#
# A mapping names the column behind each quantity, its unit in brackets, and a minus for an inverted
# axis. `imufit` converts to SI units, and refuses a number that is impossible in the stated unit.
# %%
MAPPING
# %%
log = imufit.read(file, mapping=MAPPING)
log
# %% [markdown]
# Specific force points **up** at rest: a level sensor in frame NED reads -9.81 m/s² along z. See
# `docs/conventions.md` for frames, signs and quaternions.
#
# ## The reference
#
# The three angles are still columns of numbers. They become the reference attitude here: the rotation from the axes of
# the sensor to those of the reference frame.
# %%
angles = np.stack([log.covariates[name] for name in ("Yaw", "Pitch", "Roll")], axis=1)
log = log.with_reference(Rotation.from_euler("ZYX", angles, degrees=True))
log.plot()
# %% [markdown]
# Is the reference right? The dashed or grey lines are the ideal readings of the gyroscope from the reference. A wrong
# sign or a wrong order of the axes would be visible here.
#
# ## What can this log show?
# %%
imufit.info(log, effects=False)
# %% [markdown]
# ## From arrays and tables
#
# A file is not needed: every function takes a table of pandas or polars, or arrays by name.
# %%
arrays = {"t": log.t, "acc": log.acc, "gyr": log.gyr, "ref_q": log.ref_q}
fit = imufit.fit(arrays)
fit
# %% [markdown]
# ## Diagnose
# %%
ladder = imufit.ladder(arrays)
ladder
# %%
ladder.fit.plot()
# %% [markdown]
# The fitted gyroscope bias about y equals the simulated one. The model corrects any log of this sensor:
# %%
corrected = ladder.fit.model.apply(log)
for name, each in {"as it is": log, "corrected": corrected}.items():
    print(f"mean of gyr_y in the first second, {name}: {np.degrees(each.gyr[:100, 1].mean()):.2f} deg/s")
# %% [markdown]
# The export writes the correction for the device, here as an Arduino sketch:
# %%
print(imufit.export(ladder.fit.model, "arduino")[:700])
folder.cleanup()
