"""The free rotation of a calibration in three dimensions: in which directions of the device the field has pointed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from nicegui import ui
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit.calibrating.free_turning import DIRECTIONS, ENOUGH
from imufit.figures.style import GREEN, ORANGE, SKY
from imufit.studio.body import HEIGHT, Body

Array = NDArray[np.float64]

AWAY: Final = 1.75
"""Distance of the dots from the centre of the body: beyond its nose and the names of its axes."""
DOT: Final = 0.11
"""Radius of a dot."""
SEEN: Final = 0.6
"""Size of a dot once the field has pointed there, over its size before: colour is not all that distinguishes them."""
HOW: Final = (
    "The picture turns with the device. The blue arrow is the magnetic field. "
    "Turn the device until the arrow points at an orange dot, then at the next one: "
    f"{ENOUGH} of the {len(DIRECTIONS)} dots are enough."
)
"""Words over the picture."""


class Directions:
    """A body with a dot for each direction, orange until the field has pointed there, and the field as an arrow."""

    def __init__(self) -> None:
        ui.label(HOW).classes("text-sm").props('data-testid="how"')
        self._body = Body(("wanted",), compass=False, ground=False)
        self._body.turn("wanted", np.eye(3))
        scene = self._body.scene
        with scene:
            self._dots = [scene.sphere(DOT).move(*self._place(k)) for k in range(len(DIRECTIONS))]
            self._arrow = scene.group().move(0.0, 0.0, HEIGHT)
            with self._arrow:
                # Cylinders and cones of the scene point along y.
                scene.cylinder(0.04, 0.04, AWAY - 0.3).material(SKY).move(0.0, 0.5 * (AWAY - 0.3), 0.0)
                scene.cylinder(0.0, 0.12, 0.3).material(SKY).move(0.0, AWAY - 0.15, 0.0)
            self._arrow.visible(False)
        self._open: frozenset[int] | None = None

    @staticmethod
    def _place(k: int) -> list[float]:
        x, y, z = AWAY * DIRECTIONS[k]
        return [x, y, z + HEIGHT]

    def show(self, still_open: Sequence[int], field: Sequence[float] | None) -> None:
        """Colour the dots, and turn the arrow.

        Parameters
        ----------
        still_open : sequence of int
            Rows of `DIRECTIONS` in which the field has not pointed yet.
        field : (3,) sequence or None
            Unit vector of the field in the body; None while it is not known.
        """
        if frozenset(still_open) != self._open:
            self._open = frozenset(still_open)
            for k, dot in enumerate(self._dots):
                dot.material(ORANGE if k in self._open else GREEN).scale(1.0 if k in self._open else SEEN)
        self._arrow.visible(field is not None)
        if field is not None:
            turn = Rotation.align_vectors(np.array([field]), np.array([[0.0, 1.0, 0.0]]))[0]
            self._arrow.rotate_R(np.round(turn.as_matrix(), 4).tolist())
