"""Figures of the loop: plain arrays in, a matplotlib Figure out; matplotlib is loaded only by the modules that draw.

``residuals`` (binned residual against covariates), ``spectrum``, ``candidates`` (ranked effects), ``parameters``
(predicted size beside the typical one), ``waterfall`` (the held-out error over the ladder's steps), ``tilt`` (angles by
several methods over time); ``quantity`` writes numbers and units for people; ``style`` holds the colours.
"""
