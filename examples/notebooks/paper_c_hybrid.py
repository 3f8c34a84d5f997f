# %% [markdown]
# # Paper C: TRIAD, Mahony or both?
#
# A GY-86 on a robot arm that swings back and forth. TRIAD computes an attitude of each row from two vectors, gravity
# and the magnetic field. Mahony's filter integrates the gyroscope with a slow correction by the vectors. The paper's
# hybrid drives Mahony's filter by TRIAD. The claim: the hybrid follows as fast as TRIAD and is better where the arm
# starts and stops, and plain Mahony is the worst.
#
# The paper shows two figures without numbers. This notebook simulates the experiment and measures the filters.
# %%
import imufit
import pandas as pd
from paper_c_hybrid import COLUMNS, SETS, dynamics_figure, measured, redrawn, swung, tuning

log = swung(1)
log
# %% [markdown]
# ## The filters by themselves
#
# `imufit.replay` runs filters over a log and compares them with its reference.
# %%
replay = imufit.replay(log, ["triad", "mahony", "hybrid", "mekf"])
replay
# %%
replay.plot()
# %% [markdown]
# ## The published gains
#
# Two sets of gains stand beside the two figures of the paper:
# %%
pd.DataFrame(SETS)
# %% [markdown]
# Root mean square errors in degrees, lag in ms, scatter at rest in degrees, and the largest error at a start and at a
# stop, with all methods started at the same attitude:
# %%
found = measured((1,))
pd.DataFrame({name: values.mean(axis=0) for name, values in found.items()}, index=COLUMNS).T.round(2)
# %% [markdown]
# With the proven equations Mahony and the hybrid are the same filter to two digits, and both are better than TRIAD. The
# published result follows if the *whole* field is compared with the horizontal vector [1 0 0], as in the printed
# equations. The table calls this filter "Mahony, whole field".
# %%
redrawn(1, "figure 3")
# %% [markdown]
# ## The remaining error
#
# All of these filters take the specific force as gravity. At the end of an arm that starts and stops the error is the
# acceleration of the arm's end. With the sensor's place on the arm as a setting, most of the error disappears:
# %%
dynamics_figure((1,))
# %% [markdown]
# ## Gains for this arm
#
# `imufit.tune` finds gains on one swing and judges them on the rest of it.
# %%
tuning()
# %%
tuning().plot()
# %% [markdown]
# `docs/hybrid.md` has the details, and results of real recordings.
