# %% [markdown]
# # Paper A: six positions on a table
#
# An accelerometer is laid on each of its six sides. At rest it should read gravity and nothing else; twelve parameters
# make it do so:
#
# corrected = C K reading + b, with the scale K (3), the misalignment C (6) and the bias b (3).
#
# The paper publishes the twelve parameters of an LIS3L06AL and the means of the readings before and after, but no
# readings. They are simulated here from these parameters, with noise and the steps of 12 bits. The signs of the six
# misalignments did not survive in the paper's text; one choice is taken here.
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
# Five seconds on each side at 100 Hz. The label `pose` says which axis of the body points up.
# %%
t, readings, labels = simulate(correction(signs), noise, np.random.default_rng(1))
log = imufit.Log.from_arrays(t, acc=readings * G, pose=labels.tolist())
log
# %% [markdown]
# ## Calibrate
#
# The cost `vector` holds each mean reading against the direction that its label tells. Without labels the cost
# `magnitude` holds only the length against gravity.
# %%
calibration = imufit.calibrate(log, "vector")
calibration
# %%
calibration.plot(log)
# %% [markdown]
# Grey: how far the length of the mean reading was from gravity. Blue: what is left of each side after the calibration.
#
# ## Beside the paper
# %%
table_3(signs, noise)
# %%
parameters(signs, noise)
# %% [markdown]
# ## Are the standard errors right?
#
# If they are, 95 % of the parameters lie within two of them. Thirty recordings, each with other noise and another
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
