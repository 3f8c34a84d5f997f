# %% [markdown]
# # Your own data
#
# A log is a table with one row per sample. Most files are read as they are; this notebook shows what to do with one
# that names its columns in its own way and has other units and signs.
#
# First a file to read. Another logger wrote it: milliseconds, g, deg/s, degrees Fahrenheit, both z axes the wrong way
# round, and the attitude of a turntable as three angles. Its gyroscope is off by 0.3 deg/s about y.
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
# ## Say what is what
#
# A mapping names the column behind each quantity, its unit in brackets, and a minus where the axis points the other
# way. `imufit` converts to SI units and says so where a number cannot be in the unit given.
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
# Does it look right? The dashed or grey lines are what the reference says that the gyroscope should read. A wrong sign
# or a wrong order of the axes would show here at once.
#
# ## What can this log show?
# %%
imufit.info(log, effects=False)
# %% [markdown]
# ## From arrays and tables
#
# No file is needed: every question takes a table of pandas or polars, or arrays by name.
# %%
arrays = {"t": log.t, "acc": log.acc, "gyr": log.gyr, "ref_q": log.ref_q}
fit = imufit.fit(arrays)
fit
# %% [markdown]
# ## Ask
# %%
ladder = imufit.ladder(arrays)
ladder
# %%
ladder.fit.plot()
# %% [markdown]
# The gyroscope's bias about y comes out as it was put in. The model corrects any log of this sensor:
# %%
corrected = ladder.fit.model.apply(log)
for name, each in {"as it is": log, "corrected": corrected}.items():
    print(f"mean of gyr_y in the first second, {name}: {np.degrees(each.gyr[:100, 1].mean()):.2f} deg/s")
# %% [markdown]
# And goes where the sensor is read, here as an Arduino sketch:
# %%
print(imufit.export(ladder.fit.model, "arduino")[:700])
folder.cleanup()
