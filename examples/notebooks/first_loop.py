# %% [markdown]
# # The first loop
#
# An inertial sensor reads with errors. *Which* physical effect causes the error? This notebook runs the loop once:
# compare, diagnose, add, compare again.
#
# The log here is simulated: a hand-held sensor for one minute, with a reference of its attitude and position. The
# simulation has one effect. Use `imufit.read("your_log.parquet")` for a log of your own.
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
# The ideal sensor is a model without effects: its readings follow from the reference. The difference to the log is the
# residual. A residual of 1.0 times the noise floor is noise only.
# %%
fit = imufit.fit(log)
comparison = fit.compare()
comparison.sensors
# %% [markdown]
# Gyroscope and magnetometer are at their noise; the accelerometer is not. Each panel below shows the mean residual of
# one channel over a possible cause, the largest first. The grey band is the noise of one sample.
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
# What is this effect? Its card states the physics, what it is mistaken for, and the experiment that confirms it.
# %%
imufit.explain(diagnosis.best)
# %% [markdown]
# ## Add it
#
# The step states the error before, the error that was expected, and the error after, on data that the
# fit did not use.
# %%
addition = fit.add(diagnosis.best)
addition
# %%
addition.plot()
# %% [markdown]
# The simulated lever arm is 20 mm along x. The fitted value agrees with it within its standard error.
#
# ## Is anything else missing?
# %%
addition.fit.diagnose().verdict
# %% [markdown]
# No: the residual is noise, as far as this log shows. `imufit.ladder` repeats these steps until nothing is missing.
# %%
ladder = imufit.ladder(log)
ladder.plot()
# %% [markdown]
# ## Use the model
#
# `save` writes the model to a file. `apply` removes its effects from any log of this sensor, also without a reference.
# Every result has `to_dict()`, `to_dataframe()` and `plot()`; `plot(ax=...)` draws on Axes of yours.
# %%
import matplotlib.pyplot as plt

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
ladder.plot(ax=left)
addition.plot(ax=right)
left.set_title("Held-out error")
right.set_title("Lever arm")
plt.show()
