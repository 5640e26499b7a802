"""Palette of all pictures, so that a thing has the same colour in each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]

PAPER: Colour = (255, 255, 255)
INK: Colour = (31, 41, 55)
FAINT_INK: Colour = (107, 114, 128)
RULE: Colour = (209, 213, 219)

FREE: Colour = (255, 255, 255)
OCCUPIED: Colour = (44, 52, 64)
UNKNOWN: Colour = (222, 226, 231)

COVERED: Colour = (226, 238, 247)
# Colours by number of visits: two, three, four and more.
REVISITED: tuple[Colour, ...] = ((255, 232, 176), (255, 206, 140), (250, 172, 120))
LEFT_OUT: Colour = (244, 214, 232)
# Reachable floor that was not swept: darker than cells left out, as it may lie on them.
UNSWEPT: Colour = (233, 120, 170)
BY_OTHERS: Colour = (205, 230, 208)
UNREACHABLE: Colour = (200, 60, 60)

START: Colour = (13, 128, 92)
END: Colour = (190, 24, 60)

# Okabe and Ito's colours, safe for colour-blind people; without yellow, hard to see on white.
BLUE: Colour = (0, 114, 178)
VERMILION: Colour = (213, 94, 0)
GREEN: Colour = (0, 158, 115)
PURPLE: Colour = (204, 121, 167)
SKY: Colour = (86, 180, 233)
ORANGE: Colour = (230, 159, 0)

BROWN: Colour = (140, 86, 75)
VIOLET: Colour = (117, 80, 200)
# Colours of a fleet's robots by number, with their names.
ROBOTS: tuple[tuple[str, Colour], ...] = (
    ("blue", BLUE),
    ("orange", ORANGE),
    ("green", GREEN),
    ("pink", PURPLE),
    ("sky", SKY),
    ("red", VERMILION),
    ("brown", BROWN),
    ("violet", VIOLET),
)


def robot(number: int) -> tuple[str, Colour]:
    """Return name and value of the colour of the robot with a number; colours repeat."""
    return ROBOTS[number % len(ROBOTS)]


def tint(colour: Colour, opacity: float) -> Colour:
    """Return a colour painted on white with an opacity."""
    red, green, blue = (round(255 - opacity * (255 - value)) for value in colour)
    return red, green, blue


# Nine colours, evenly spaced over the first four fifths of Matplotlib's plasma (CC0): perceptually
# uniform, and without the yellow end, which is hard to see on white.
_GRADIENT = np.array(
    [
        (13, 8, 135),
        (65, 4, 157),
        (106, 0, 168),
        (143, 13, 164),
        (177, 42, 144),
        (204, 71, 120),
        (225, 100, 98),
        (242, 132, 75),
        (252, 166, 54),
    ],
    np.float64,
)


def gradient(fractions: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return colours, uint8 (n, 3), for fractions (n,) from 0 (start) to 1 (end)."""
    places = np.linspace(0.0, 1.0, len(_GRADIENT))
    channels = [np.interp(fractions, places, _GRADIENT[:, channel]) for channel in range(3)]
    return np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
