# %% [markdown]
# # The first loop
#
# An inertial sensor reads something else than physics says. *Which* physical effect is behind the difference? This
# notebook asks once around the loop: compare, diagnose, add, look again.
#
# The log here is simulated: a sensor in a hand for one minute, beside a reference that knows its attitude and position.
# One effect was put in. Take `imufit.read("your_log.parquet")` instead for a log of your own.
# %%
import imufit

log = imufit.simulate("handheld", {"acc.lever_arm": {"x": 0.02}}, duration=60.0).to_log()
log
# %% [markdown]
# Columns are in SI units: time in s, specific force in m/s², angular rate in rad/s, magnetic field in µT, and the
# reference as a quaternion, scalar first. A figure shows itself when it is the last line of a cell.
# %%
log.plot(begin=0.0, end=20.0)
# %% [markdown]
# ## Where does the ideal sensor fail?
#
# The ideal sensor has no effect at all: its readings follow from the reference. Held against the log it leaves a
# residual. A residual of 1.0 times the noise floor would be nothing but noise.
# %%
fit = imufit.fit(log)
comparison = fit.compare()
comparison.sensors
# %% [markdown]
# Gyroscope and magnetometer are at their noise; the accelerometer is not. Each panel below shows the mean residual of
# one channel against something that may cause it, worst first. The grey band is the noise of one sample.
# %%
comparison.plot()
# %% [markdown]
# ## Which effect is missing?
#
# Every effect of the catalogue is tried. A bar goes from the error now to the error expected with that effect.
# %%
diagnosis = fit.diagnose()
diagnosis.plot()
# %%
print(diagnosis.sentence)
# %% [markdown]
# What is this effect? Its card tells the physics, what it is mistaken for, and the experiment that confirms it.
# %%
imufit.explain(diagnosis.best)
# %% [markdown]
# ## Add it
#
# The step tells the error before, the error that was expected, and the error that came out, on data that the fit has
# not seen.
# %%
addition = fit.add(diagnosis.best)
addition
# %%
addition.plot()
# %% [markdown]
# The lever arm that was put in is 20 mm along x. The fitted value agrees with it within its standard error.
#
# ## Is anything else missing?
# %%
addition.fit.diagnose().verdict
# %% [markdown]
# No: what is left is noise, as far as this log can tell. `imufit.ladder` repeats these steps until nothing is missing.
# %%
ladder = imufit.ladder(log)
ladder.plot()
# %% [markdown]
# ## Use the model
#
# `save` writes the model to a file, `apply` takes its effects out of any log of this sensor, also without a reference.
# Every result has `to_dict()`, `to_dataframe()` and `plot()`; `plot(ax=...)` draws on Axes of yours.
# %%
import matplotlib.pyplot as plt

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
ladder.plot(ax=left)
addition.plot(ax=right)
left.set_title("Held-out error")
right.set_title("Lever arm")
plt.show()
