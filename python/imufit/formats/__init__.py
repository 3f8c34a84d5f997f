"""Files of other programs, read through well-kept libraries into plain tables: one file a format.

Nothing here knows what a log is: which column is which sensor is decided by `imufit.log`.
"""

from imufit.formats.recording import Recording, Table

__all__ = ["Recording", "Table"]
