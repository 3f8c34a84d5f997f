"""Log files: read, check, convert, write."""

from imufit.errors import InputError
from imufit.log.any_table import AnyTable
from imufit.log.anything import AnyLog, AnyLogs, log_of, logs_of_any, pandas_of
from imufit.log.contents import Contents, contents
from imufit.log.excerpt import judged_rows
from imufit.log.frame import FrameSource
from imufit.log.log import Chunk, Log, LogSource, concatenate, whole
from imufit.log.metadata import Metadata
from imufit.log.reading import Reading, parse_noise
from imufit.log.segments import gaps
from imufit.log.some_rows import SomeRows
from imufit.log.stream import LogStream, open_log, read
from imufit.log.units import parse_mapping

__all__ = [
    "AnyLog",
    "AnyLogs",
    "AnyTable",
    "Chunk",
    "Contents",
    "FrameSource",
    "InputError",
    "Log",
    "LogSource",
    "LogStream",
    "Metadata",
    "Reading",
    "SomeRows",
    "concatenate",
    "contents",
    "gaps",
    "judged_rows",
    "log_of",
    "logs_of_any",
    "open_log",
    "pandas_of",
    "parse_mapping",
    "parse_noise",
    "read",
    "whole",
]
