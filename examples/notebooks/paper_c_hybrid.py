# %% [markdown]
# # Paper C: TRIAD, Mahony or both?
#
# A GY-86 on a robot arm that swings back and forth. TRIAD makes an attitude of each row from two vectors, gravity and
# the magnetic field. Mahony's filter integrates the gyroscope and lets the vectors pull slowly. The paper's hybrid
# drives Mahony's filter by TRIAD. The claim: the hybrid follows as fast as TRIAD and is better where the arm starts and
# stops, and plain Mahony is the worst.
#
# The paper shows two figures and no numbers. Here the experiment is simulated and measured.
# %%
import imufit
import pandas as pd
from paper_c_hybrid import COLUMNS, SETS, dynamics_figure, measured, redrawn, swung, tuning

log = swung(1)
log
# %% [markdown]
# ## The filters by themselves
#
# `imufit.replay` runs filters over a log and holds them against its reference.
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
# With the equations as they are proven, Mahony and the hybrid are the same filter to two digits, and both are better
# than TRIAD. The published picture comes out if the *whole* field is compared with the horizontal vector [1 0 0], as
# the printed equations say; the table calls that "Mahony, whole field".
# %%
redrawn(1, "figure 3")
# %% [markdown]
# ## What is left
#
# All of these take the specific force for gravity. At the end of an arm that starts and stops this is wrong by the
# acceleration of the arm's end. Told where on the arm the sensor sits, the filters lose most of their error:
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
# `docs/hybrid.md` has the whole story, and what real recordings say.
