"""The guide of a calibration as a person sees it: which way to turn the device, and which sides are ticked."""

from __future__ import annotations


def how_to_lay(side: str) -> str:
    """Say how to turn the device so that one side lies up, by the arrows of the picture.

    Parameters
    ----------
    side : str
        One of ``+x -x +y -y +z -z``.
    """
    way = "up" if side[0] == "+" else "down"
    return f"{side} is up when the {side[1]} arrow points {way}, as in this picture."


def held_side(before: str | None, side: str | None, progress: float, *, moving: bool) -> str | None:
    """Return the side that was held long enough: the guide judges a rest after its end, a person sees the tick before.

    Parameters
    ----------
    before : str or None
        The answer before.
    side : str or None
        Side that lies up.
    progress : float
        How much of the hold is done, 0 to 1.
    moving : bool
        Whether the device moves.

    Returns
    -------
    str or None
        It stays until the device rests on another side: the guide has judged by then.
    """
    if moving:
        return before
    if progress >= 1.0:
        return side
    return before if side == before else None
