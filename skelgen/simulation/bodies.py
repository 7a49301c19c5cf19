"""The bodies of a human, of the seed's human and of a quadruped, in mm, with plausible proportions and ranges."""

from __future__ import annotations

from skelgen.simulation.articulated import LimbModel, Structure
from skelgen.simulation.limbs import Swing, limb

_SIDES = {"left": 1.0, "right": -1.0}
_TRUNK = Swing((25, 30, 35))


def human(n_markers_per_limb: int = 3) -> Structure:
    """Return a human of 15 limbs, 1.75 m tall, with hinges in elbows and knees, universal wrists and ankles.

    Parameters
    ----------
    n_markers_per_limb : int
        Markers on every limb.
    """
    n = n_markers_per_limb
    limbs = [
        limb("pelvis", "", "free", (0, 0, 960), (0, 110, 0), radius=95, n=n, start=(0, -110, 0)),
        limb("chest", "pelvis", "ball", (-15, 0, 110), (0, 0, 300), radius=120, n=n, swing=_TRUNK),
        limb("head", "chest", "ball", (10, 0, 370), (15, 0, 190), radius=80, n=n, swing=Swing((30, 35, 50))),
    ]
    for side in _SIDES:
        limbs += _arm(side, n) + _leg(side, n)
    return Structure("human", tuple(limbs))


def _arm(side: str, n: int) -> list[LimbModel]:
    s, upper, fore, hand = _SIDES[side], f"{side} upper arm", f"{side} forearm", f"{side} hand"
    elbow = Swing((50,), (60,), [(-0.1 * s, -1, 0.15 * s)])
    wrist = Swing((40, 30), (5, 0), [(0, -1, 0), (1, 0, 0)])
    return [
        limb(upper, "chest", "ball", (0, 185 * s, 300), (0, 0, -300), radius=45, n=n, swing=_shoulder(s)),
        limb(fore, upper, "hinge", (0, 10 * s, -305), (0, 0, -250), radius=36, n=n, swing=elbow),
        limb(hand, fore, "universal", (5, 5 * s, -260), (0, 0, -170), radius=28, n=n, swing=wrist),
    ]


def _leg(side: str, n: int) -> list[LimbModel]:
    s, thigh, shank, foot = _SIDES[side], f"{side} thigh", f"{side} shank", f"{side} foot"
    knee = Swing((45,), (50,), [(0.05 * s, 1, -0.1 * s)])
    ankle = Swing((30, 25), axes=[(0, 1, 0), (1, 0, 0.3 * s)])
    return [
        limb(thigh, "pelvis", "ball", (0, 95 * s, -70), (0, 0, -415), radius=70, n=n, swing=_hip(s)),
        limb(shank, thigh, "hinge", (0, 5 * s, -420), (0, 0, -390), radius=50, n=n, swing=knee),
        limb(foot, shank, "universal", (-10, 0, -405), (190, 0, -55), radius=34, n=n, swing=ankle),
    ]


def _shoulder(s: float) -> Swing:
    return Swing((40, 50, 40), (15 * s, -15, 0))


def _hip(s: float) -> Swing:
    return Swing((30, 40, 30), (8 * s, -15, 0))


def seed_human() -> Structure:
    """Return a human of 13 bones and 31 markers, most limbs with two, as in tables 5.2 and 5.3 of the seed.

    The knees are hinges; all other joints are balls, as the joint errors in the seed's table 5.4 tell.
    """
    limbs = [
        limb("breast", "", "free", (0, 0, 1250), (0, 0, 250), radius=120, n=3, start=(0, 0, -50)),
        limb("head", "breast", "ball", (10, 0, 300), (15, 0, 190), radius=80, n=2),
        limb("hip", "breast", "ball", (0, 0, -120), (0, 0, -150), radius=110, n=2, swing=_TRUNK),
    ]
    for side in _SIDES:
        limbs += _seed_arm(side) + _seed_leg(side)
    return Structure("seed-human", tuple(limbs))


def _seed_arm(side: str) -> list[LimbModel]:
    s, upper, fore, hand = _SIDES[side], f"{side} upper arm", f"{side} forearm", f"{side} hand"
    elbow = Swing((25, 45, 35), (0, -55, 0))
    return [
        limb(upper, "breast", "ball", (0, 185 * s, 220), (0, 0, -300), radius=45, n=2, swing=_shoulder(s)),
        limb(fore, upper, "ball", (0, 10 * s, -305), (0, 0, -250), radius=36, n=2, swing=elbow),
        limb(hand, fore, "ball", (5, 5 * s, -260), (0, 0, -170), radius=28, n=2),
    ]


def _seed_leg(side: str) -> list[LimbModel]:
    s, thigh, shank = _SIDES[side], f"{side} thigh", f"{side} lower leg"
    knee = Swing((45,), (50,), [(0, 1, 0)])
    return [
        limb(thigh, "hip", "ball", (0, 95 * s, -220), (0, 0, -415), radius=70, n=3, swing=_hip(s)),
        limb(shank, thigh, "hinge", (0, 5 * s, -420), (0, 0, -390), radius=50, n=3, swing=knee),
    ]


def quadruped() -> Structure:
    """Return a dog-like animal of 17 limbs with three markers each: hinges in elbows, stifles and carpi."""
    limbs = [
        limb("pelvis", "", "free", (-300, 0, 600), (60, 0, 0), radius=90, n=3, start=(-100, 0, 0)),
        limb("trunk", "pelvis", "ball", (80, 0, 10), (440, 0, 0), radius=110, n=3, swing=Swing((20, 20, 25))),
        limb("neck", "trunk", "ball", (480, 0, 40), (130, 0, 130), radius=55, n=3, swing=Swing((20, 35, 35))),
        limb("head", "neck", "ball", (150, 0, 150), (200, 0, -30), radius=55, n=3, swing=Swing((30, 30, 35))),
        limb("tail", "pelvis", "ball", (-140, 0, 20), (-320, 0, 0), radius=20, n=3, swing=Swing((20, 30, 45))),
    ]
    for side in _SIDES:
        limbs += _foreleg(side) + _hindleg(side)
    return Structure("quadruped", tuple(limbs))


def _foreleg(side: str) -> list[LimbModel]:
    s, upper, fore, foot = _SIDES[side], f"{side} upper foreleg", f"{side} forearm", f"{side} forefoot"
    shoulder = Swing((20, 35, 20))
    elbow, carpus = Swing((40,), (30,), [(0.1 * s, -1, 0)]), Swing((45,), (20,), [(0, 1, 0.2 * s)])
    return [
        limb(upper, "trunk", "ball", (380, 100 * s, -60), (-40, 0, -190), radius=40, n=3, swing=shoulder),
        limb(fore, upper, "hinge", (-45, 0, -200), (20, 0, -190), radius=30, n=3, swing=elbow),
        limb(foot, fore, "hinge", (20, 0, -200), (50, 0, -110), radius=24, n=3, swing=carpus),
    ]


def _hindleg(side: str) -> list[LimbModel]:
    s, thigh, shank, foot = _SIDES[side], f"{side} thigh", f"{side} shank", f"{side} hind foot"
    hip = Swing((20, 35, 20))
    stifle, hock = Swing((40,), (30,), [(0.1 * s, 1, 0)]), Swing((35, 20), axes=[(0, 1, 0), (1, 0, 0)])
    return [
        limb(thigh, "pelvis", "ball", (-40, 80 * s, -50), (40, 0, -210), radius=55, n=3, swing=hip),
        limb(shank, thigh, "hinge", (45, 0, -220), (-70, 0, -190), radius=35, n=3, swing=stifle),
        limb(foot, shank, "universal", (-75, 0, -200), (60, 0, -130), radius=24, n=3, swing=hock),
    ]
