"""Draw the pictures of the documents: simulate a log with five effects and let the error fall.

python docs/pictures/make.py [FOLDER]
"""

import sys
from pathlib import Path

import imufit

HIDDEN = ("acc.lever_arm", "acc.scale", "gyr.g_sensitivity", "gyr.bias_temperature", "mag.hard_iron")


def ladder() -> imufit.Ladder:
    """Find five effects, each three times as strong as the noise, in two minutes on a robot arm."""
    log = imufit.simulate.simulate("arm", dict.fromkeys(HIDDEN), size="large").to_log()
    return imufit.ladder(log)


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    ladder().plot().savefig(folder / "ladder.png", dpi=110)
