# %% [markdown]
# # Paper B: the tilt of a machine tool
#
# An MPU6050 lies on the table of a five-axis machine. The paper measures the tilt by four methods: accelerometer,
# gyroscope, complementary filter and Kalman filter. Filtering makes the angle quiet, but an error of a quarter of a
# degree stays, whatever the filter. This notebook finds out what it is.
#
# No recordings are published. One simulated sensor, within the tolerances of its data sheet, makes the published
# errors.
# %%
import imufit
from paper_b_tilt import (
    METHODS,
    RMSE,
    SD,
    blow,
    errors_at_rest,
    move,
    rmse_and_sd,
    small_tilts,
    standing,
    sweep,
)

log = standing(1.5, seed=1)
log
# %% [markdown]
# ## Quiet is not right
#
# The table stands at 1.5 degrees. Root mean square error and standard deviation of each method, in degrees, beside the
# published ones:
# %%
import pandas as pd

found = rmse_and_sd(errors_at_rest(log, 1.5))
rows = {"RMSE, published": RMSE[1.5], "RMSE": found[0], "SD, published": SD[1.5], "SD": found[1]}
pd.DataFrame(rows, index=METHODS).T.round(3)
# %% [markdown]
# The Kalman filter takes away nearly all of the scatter and nearly nothing of the error: both angles follow the same
# wrong accelerometer.
#
# ## A move and a blow
#
# The table turns to -5 degrees, and the gyroscope loses part of the move. The filters settle where the accelerometer
# says.
# %%
move(1).plot()
# %% [markdown]
# A hammer strikes the standing machine. The accelerometer takes the blow for tilt.
# %%
blow(1).plot()
# %% [markdown]
# Figures of merit of all methods, and their ranks:
# %%
move(1).comparison()
# %% [markdown]
# ## What is the error?
#
# The loop asks which physical effect is missing. The small tilts of the experiment leave it open how much is bias and
# how much is misalignment: near the level they do the same.
# %%
small = imufit.ladder(small_tilts(1))
print(small.first.sentence)
# %% [markdown]
# A wide sweep, from -110 to 30 degrees, tells them apart.
# %%
wide = imufit.ladder(sweep(1))
wide.plot()
# %%
wide.fit.plot()
# %% [markdown]
# ## What the model is worth
#
# The model of the sweep is applied to a recording that the loop has not seen, before any filter:
# %%
other = standing(1.5, seed=11)
pairs = [rmse_and_sd(errors_at_rest(each, 1.5))[0] for each in (other, wide.fit.model.apply(other))]
pd.DataFrame(pairs, index=["RMSE as it is, deg", "RMSE with the model, deg"], columns=METHODS).round(3)
# %% [markdown]
# What no filter removes goes when the model of the sensor is complete. The gyroscope alone still drifts: its zero is
# another one in each recording. `docs/tilt.md` has the whole story.
