"""A running device in the browser: its readings, its attitude, a recorder, and the guide through a calibration.

`imufit.studio.live.listening` follows the device without drawing; `imufit.studio.live.page` is the page.
All pages share `imufit.studio.live.device`.
"""
