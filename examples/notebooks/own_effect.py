# %% [markdown]
# # An effect of your own
#
# The catalogue holds the effects that inertial sensors usually have. Your rig may have one that is not among them. An
# effect takes about ten lines, and is fitted, ranked and explained like the built-in ones.
#
# In this example a cooling fan stands beside the sensor. Its vibration shifts the bias of the gyroscope's z axis, and
# the log holds the current of the fan.
# %%
from dataclasses import replace

import imufit
import numpy as np

# %% [markdown]
# ## A recording
#
# Nothing in this simulation uses the effect that is written below.
# %% [source]
from own_effect import recorded

# %%
log = recorded()
log.plot(columns=["fan_current"], end=40.0)
# %% [markdown]
# ## Without the effect
#
# The loop reports a missing effect. A linear dependence on the column `fan_current` reduces the residual, which is a
# hint and not an explanation.
# %%
before = imufit.diagnose(log)
print(before.sentence)
# %% [markdown]
# ## The effect
#
# An effect returns the derivative of the reading with respect to each of its parameters. Here the reading grows in
# proportion to the current, along z alone. The texts appear on its card.
# %% [source]
from own_effect import fan

# %%
imufit.explain("gyr.fan")
# %% [markdown]
# `needs` names the columns without which the effect cannot be tested; `typical` is its usual size in the unit of the
# parameter, which sets the loop's range of plausible values.
#
# ## With the effect
# %%
after = imufit.diagnose(log)
after.plot()
# %%
ladder = imufit.ladder(log)
ladder
# %%
ladder.fit.plot()
# %% [markdown]
# The command line runs the same lines: `imufit diagnose fan.parquet --effects-from own_effect.py`. See
# `docs/own_effect.md` for effects with several parameters and for effects that are not linear.
