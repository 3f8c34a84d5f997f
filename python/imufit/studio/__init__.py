"""The loop in a browser: a page that this computer alone serves, on a log of its own.

`imufit.studio.server` serves pages to one address with a token; `imufit.studio.session` holds what they show.
"""
