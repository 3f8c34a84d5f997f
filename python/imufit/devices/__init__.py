"""Sensors on a line: their formats, the recorder, filters on live rows, and a device without hardware.

Nothing in the library's core uses this room.
"""
