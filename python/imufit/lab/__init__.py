"""Logs whose truth is known: simulated sensors with effects hidden in them, and how well they are found.

Nothing in the library's core uses this room.
"""
