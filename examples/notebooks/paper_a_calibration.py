# %% [markdown]
# # Paper A: six positions on a table
#
# An accelerometer is laid on each of its six sides. At rest a correct accelerometer reads gravity alone.
# Twelve parameters correct the readings:
#
# corrected = C K reading + b, with the scale K (3), the misalignment C (6) and the bias b (3).
#
# The paper publishes the twelve parameters of an LIS3L06AL and the means of the readings before and after, but not the
# readings. This notebook simulates the readings from the parameters, with noise and the steps of 12 bits. The signs of
# the six misalignments are lost in the paper's text; the notebook assumes one choice.
# %%
import imufit
import numpy as np
from paper_a_calibration import NOISE, G, correction, errors, parameters, run, simulate, table_3

signs = (1, 1, -1, 1, 1, -1)
noise = next(iter(NOISE.values()))
correction(signs).round(4)
# %% [markdown]
# ## The recording
#
# Five seconds on each side at 100 Hz. The label `pose` states the body axis that points up.
# %%
t, readings, labels = simulate(correction(signs), noise, np.random.default_rng(1))
log = imufit.Log.from_arrays(t, acc=readings * G, pose=labels.tolist())
log
# %% [markdown]
# ## Calibrate
#
# The cost `vector` compares each mean reading with the direction of its label. Without labels the cost
# `magnitude` compares only the length with gravity.
# %%
calibration = imufit.calibrate(log, "vector")
calibration
# %%
calibration.plot(log)
# %% [markdown]
# Grey: how far the length of the mean reading was from gravity. Blue: the residual of each side after the
# calibration.
#
# ## Comparison with the paper
# %%
table_3(signs, noise)
# %%
parameters(signs, noise)
# %% [markdown]
# ## Are the standard errors right?
#
# If so, 95 % of the parameters are within two standard errors. Thirty recordings, each with other noise and another
# choice of the signs:
# %%
import itertools

choices = list(itertools.product((1, -1), repeat=6))[::2][:30]
scaled = np.array([errors(each, run(each, noise, k)[2]) for k, each in enumerate(choices)])
print(
    f"{100 * np.mean(np.abs(scaled) < 2.0):.0f} % within two standard errors; the largest error is "
    f"{np.abs(scaled).max():.1f} standard errors"
)
# %%
import matplotlib.pyplot as plt

figure, axes = plt.subplots(figsize=(8, 3), layout="constrained")
axes.hist(scaled.ravel(), bins=np.arange(-3.5, 3.6, 0.5), density=True, color="#56B4E9", label="found")
x = np.linspace(-3.5, 3.5, 200)
axes.plot(x, np.exp(-0.5 * x**2) / np.sqrt(2 * np.pi), color="#222222", label="normal distribution")
axes.set_xlabel("error over its standard error")
axes.set_ylabel("density")
axes.legend(frameon=False)
plt.show()
