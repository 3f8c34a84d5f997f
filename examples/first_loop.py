"""The loop in ten lines: a log, the missing effect, the error before and after.

python examples/first_loop.py [LOG]
"""

import sys

import imufit

if len(sys.argv) > 1:
    log = imufit.read(sys.argv[1])
else:  # a hand-held sensor whose accelerometer sits 2 cm from where the reference says
    log = imufit.simulate("handheld", {"acc.lever_arm": {"x": 0.02}}, duration=60.0).to_log()

fit = imufit.SensorModel().fit(log)  # the ideal sensor: no effect, nothing to fit yet
diagnosis = fit.diagnose()
while diagnosis.best is not None and diagnosis.verdict == "missing":
    print(diagnosis.sentence)
    addition = fit.add(diagnosis.best)
    print(f"  held out: {addition.before:.2f}, expected {addition.expected:.2f}, now {addition.after:.2f}")
    fit = addition.fit
    diagnosis = fit.diagnose()
print(diagnosis.sentence)
print(fit.to_dataframe().to_string(index=False))
