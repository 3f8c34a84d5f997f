"""Inputs that nobody meant, one by a seed and an index, put to the commands, and what may come of them.

Written from the public contract alone: it shares no code with the readers that it judges.
"""
