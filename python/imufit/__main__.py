"""``python -m imufit`` is the program ``imufit``."""

import sys

from imufit.cli.app import main

if __name__ == "__main__":
    sys.exit(main())
