"""A sign for each kind of joint."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QPainterPath

_ROUND = 2.0


def joint_sign(kind: str, at: QPointF, size: float) -> QPainterPath:
    """Return the sign of a kind: ball a disc, hinge a bar, universal a cross, rigid a square, others a ring.

    Parameters
    ----------
    kind : str
        Of the joint; empty where it is not known yet.
    at : QPointF, px
        Middle of the sign.
    size : float, px
        Half its height.
    """
    path = QPainterPath()
    if kind == "ball":
        path.addEllipse(at, size, size)
    elif kind == "hinge":
        path.addRoundedRect(_box(at, 0.45 * size, 1.2 * size), _ROUND, _ROUND)
    elif kind == "universal":
        path.addRoundedRect(_box(at, 0.4 * size, 1.2 * size), _ROUND, _ROUND)
        across = QPainterPath()
        across.addRoundedRect(_box(at, 1.2 * size, 0.4 * size), _ROUND, _ROUND)
        path = path.united(across)
    elif kind == "rigid":
        path.addRect(_box(at, 0.9 * size, 0.9 * size))
    else:
        path.addEllipse(at, size, size)
        path.addEllipse(at, 0.5 * size, 0.5 * size)
    return path


def _box(at: QPointF, half_width: float, half_height: float) -> QRectF:
    return QRectF(at.x() - half_width, at.y() - half_height, 2 * half_width, 2 * half_height)
