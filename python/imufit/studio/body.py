"""A body in three dimensions that shows attitudes, alone or with a slider over the time of a log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from nicegui import ui
from nicegui.elements.scene.scene_object3d import Object3D
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.figures.style import AXES, GREY, ORANGE, SKY
from imufit.rests.poses import UP
from imufit.studio.attitudes import Track, error_deg, scene_rotation

Array = NDArray[np.float64]

SIZE: Final = (2.0, 1.3, 0.35)
"""Length, width and height of the body in the scene: its three axes are distinguished at a glance."""
HEIGHT: Final = 1.5
"""Height of the body's centre above the ground, so that no corner reaches below the grid."""
AXIS: Final = 1.45
"""Length of the drawn axes from the centre."""
LOOKS: Final[Mapping[str, tuple[str, float, bool]]] = {
    "measured": (SKY, 1.0, False),
    "predicted": (ORANGE, 0.35, False),
    "reference": (GREY, 1.0, True),
    "wanted": (ORANGE, 0.55, False),
}
"""Colour, opacity, and whether only the edges are drawn, by name of an attitude."""
GROWN: Final = {"measured": 1.0, "predicted": 1.02, "reference": 1.04, "wanted": 1.0}
"""Sizes by name: surfaces of equal attitudes would flicker through one another."""
TURNS: Final = "Drag to turn, use the wheel to zoom."
GROUND: Final = 2
"""Half the width of the ground, in its squares."""
PICTURES: Final = 15.0
"""Pictures a second of the player."""
SPEEDS: Final = (0.25, 0.5, 1.0, 2.0, 5.0, 20.0)
"""Speeds of the player, times real."""

Matrix = list[list[float]]


def side_rotation(side: str) -> Array:
    """Return the matrix of a body that lies with one side up, body to the axes of the scene.

    Parameters
    ----------
    side : str
        One of ``+x -x +y -y +z -z``.

    Returns
    -------
    (3, 3) array
        It takes the axis of that side to up by the shortest way from lying with z up.
    """
    up = UP[side]
    axis = np.cross(up, UP["+z"])
    if not axis.any():
        axis = np.pi * UP["+x"] if up[2] < 0.0 else np.zeros(3)
    else:
        axis *= np.pi / 2.0  # of the other sides each is a quarter turn away
    return np.asarray(Rotation.from_rotvec(axis).as_matrix())


class Body:
    """A scene with one body for each attitude: east to the right, north away from the viewer, up.

    Parameters
    ----------
    names : sequence of str
        Of ``measured``, ``predicted``, ``reference``, ``wanted``.
    compass : bool
        Whether north and east are named, which a filter without a magnetometer does not know.
    ground : bool
        Whether the ground is drawn.
    """

    def __init__(self, names: Sequence[str], *, compass: bool = True, ground: bool = True) -> None:
        self.rotations: dict[str, Array | None] = dict.fromkeys(names)
        self._hidden: set[str] = set()
        self._bodies: dict[str, Object3D] = {}
        camera = ui.scene.perspective_camera(fov=42)
        # The scene's own ground is a plane in its background's colour, which a dark page would show as a white one.
        scene = ui.scene(width=360, height=280, grid=False, camera=camera, fps=int(PICTURES), background_color="#fff")
        # The canvas follows its frame, and the page's colour shines through it in light and dark.
        scene.classes("studio-body w-full").style("width: 100% !important; max-width: 100%; touch-action: pan-y")
        scene.on("init", lambda: ui.run_javascript(f"getElement({scene.id})?.renderer?.setClearColor(0xffffff, 0)"))
        self.scene = scene
        with scene:
            for k in range(-GROUND, GROUND + 1) if ground else ():
                scene.line([k, -GROUND, 0], [k, GROUND, 0]).material(GREY, 0.6)
                scene.line([-GROUND, k, 0], [GROUND, k, 0]).material(GREY, 0.6)
            if compass:
                for word, place in (("N", (0.0, GROUND + 0.3)), ("E", (GROUND + 0.3, 0.0))):
                    scene.text(word, "font-weight: 600; opacity: 0.7").move(place[0], place[1], 0.0)
            for name in names:
                self._bodies[name] = self._body(name)
        ui.label(TURNS).classes("studio-muted")
        scene.move_camera(
            x=-3.3, y=-5.6, z=5.05, look_at_x=0.0, look_at_y=0.0, look_at_z=0.6 if ground else HEIGHT, duration=0.0
        )

    def _body(self, name: str) -> Object3D:
        """Make the body of one attitude: a plate with a nose to its x axis, and the three axes with their names."""
        colour, opacity, edges = LOOKS[name]
        length, width, height = (GROWN[name] * each for each in SIZE)
        scene = self.scene
        group = scene.group().with_name(name).move(0.0, 0.0, HEIGHT)
        with group:
            scene.box(length, width, height, wireframe=edges).material(colour, opacity)
            nose = scene.cylinder(0.0, 0.3, 0.5, 24, wireframe=edges).material(colour, opacity)
            # A cone of the scene points along y.
            nose.rotate_R([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).move(0.5 * length + 0.25, 0.0, 0.0)
            if name in ("measured", "wanted"):
                for k, axis in enumerate("xyz"):
                    end = [AXIS * (j == k) for j in range(3)]
                    scene.line([0.0, 0.0, 0.0], end).material(AXES[axis])
                    scene.text(axis, f"font-weight: 600; color: {AXES[axis]}").move(*(1.12 * each for each in end))
        group.visible(False)
        return group

    def show(self, name: str, q: Array | None, frame: str) -> None:
        """Show one attitude, or hide its body where the attitude is unknown.

        Parameters
        ----------
        name : str
            One of the names.
        q : (4,) array or None
            Unit quaternion, scalar first, body to `frame`.
        frame : {"NED", "ENU", "NWU"}
            Reference frame.
        """
        self.turn(name, None if q is None or not np.isfinite(q).all() else scene_rotation(q, frame))

    def turn(self, name: str, rotation: Array | None) -> None:
        """Show one body by its matrix, body to the axes of the scene; None hides it.

        Parameters
        ----------
        name : str
            One of the names.
        rotation : (3, 3) array or None
            The matrix.
        """
        body = self._bodies[name]
        self.rotations[name] = rotation
        if rotation is not None:
            matrix: Matrix = np.round(rotation, 5).tolist()
            body.rotate_R(matrix)
        body.visible(rotation is not None and name not in self._hidden)

    def hide(self, name: str, hidden: bool) -> None:
        """Hide one body, or show it again.

        Parameters
        ----------
        name : str
            One of the names.
        hidden : bool
            Whether to hide it.
        """
        (self._hidden.add if hidden else self._hidden.discard)(name)
        self.turn(name, self.rotations[name])


class Player:
    """Plays the attitudes of a log: a body, a slider, play and pause, a legend with the angles.

    Parameters
    ----------
    tracks : sequence of Track
        At least one.
    """

    def __init__(self, tracks: Sequence[Track]) -> None:
        self.tracks = {track.name: track for track in tracks}
        self.begin = min(float(track.t[0]) for track in tracks)
        self.end = max(float(track.t[-1]) for track in tracks)
        # A filter needs some rows before its first attitude: the player starts where every body has one.
        known = max((track.known for track in tracks), default=self.begin)
        self.time, self.playing, self.speed = known, False, 1.0
        with ui.column().classes("w-full gap-1 studio-player"):
            self.body = Body(tuple(self.tracks))
            self._words: dict[str, ui.label] = {}
            for name in self.tracks:
                self._legend(name)
            with ui.row().classes("w-full items-center no-wrap gap-2"):
                self._button = ui.button(icon="play_arrow", on_click=self.toggle).props(
                    'flat dense aria-label="play" title="play or pause"'
                )
                self._slider = ui.slider(
                    min=self.begin, max=self.end, step=max((self.end - self.begin) / 2000.0, 1e-3), value=self.time
                ).props('aria-label="time of the attitude"')
                self._slider.on_value_change(lambda event: self.go(float(event.value)))
            with ui.row().classes("w-full items-center gap-2"):
                self._clock = ui.label().classes("text-sm tabular-nums")
                ui.space()
                ui.select(
                    {speed: f"{speed:g} ×" for speed in SPEEDS}, value=1.0, on_change=self._faster, label="speed"
                ).props("dense options-dense").classes("w-20")
        self._timer = ui.timer(1.0 / PICTURES, self._tick, active=False)
        self.go(self.time)

    def _legend(self, name: str) -> None:
        colour, _, edges = LOOKS[name]
        look = f"border: 2px solid {colour};" + ("" if edges else f" background: {colour};")
        with ui.row().classes("w-full items-center no-wrap gap-2"):
            box = ui.checkbox(value=True, on_change=lambda event: self.body.hide(name, not event.value)).props("dense")
            box.props(f'aria-label="show {name}"')
            ui.element("span").style(f"width: 1em; height: 1em; flex: none; {look}")
            ui.label(name).classes("text-sm").style("width: 6em; flex: none")
            self._words[name] = ui.label().classes("text-sm tabular-nums")

    def toggle(self) -> None:
        """Play, or pause."""
        self.playing = not self.playing
        if self.playing and self.time >= self.end:
            self.time = self.begin
        self._timer.active = self.playing
        self._button.props(f"icon={'pause' if self.playing else 'play_arrow'}")

    def go(self, time: float) -> None:
        """Show the attitudes of one time.

        Parameters
        ----------
        time : float
            s of the log.
        """
        self.time = min(max(time, self.begin), self.end)
        present = {name: track.at(self.time) for name, track in self.tracks.items()}
        reference = present.get("reference")
        for name, q in present.items():
            track = self.tracks[name]
            self.body.show(name, q, track.frame)
            off = (
                ""
                if q is None or reference is None or name == "reference"
                else f", off {error_deg(q, reference):.1f} deg"
            )
            self._words[name].text = angles_in_words(q) + off
        self._clock.text = f"{self.time:.2f} s of {self.end:.1f} s"

    def seek(self, time: float) -> None:
        """Move the slider, and show the attitudes of that time.

        Parameters
        ----------
        time : float
            s of the log.
        """
        self.time = min(max(time, self.begin), self.end)
        self._slider.value = self.time

    def close(self) -> None:
        """Stop playing for good."""
        self._timer.cancel()

    def _tick(self) -> None:
        self.seek(self.time + self.speed / PICTURES)
        if self.time >= self.end:
            self.toggle()

    def _faster(self, event: object) -> None:
        self.speed = float(getattr(event, "value", 1.0))


def angles_in_words(q: Array | None) -> str:
    """Return roll, pitch and yaw of an attitude in words.

    Parameters
    ----------
    q : (4,) array or None
        Unit quaternion, scalar first; None where it is unknown.
    """
    if q is None or not np.isfinite(q).all():
        return "not known"
    euler = np.degrees(_imufit.euler_from_quaternion(np.ascontiguousarray(q.reshape(1, 4)))[0])
    roll, pitch, yaw = np.round(euler, 1) + 0.0  # no minus before a zero
    return f"roll {roll:.1f}, pitch {pitch:.1f}, yaw {yaw:.1f} deg"
