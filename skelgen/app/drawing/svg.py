"""Inline SVG in a few words, and the axes of a plot.

Every text and attribute is escaped; colours come from the page's style sheet.
"""

import math
from dataclasses import dataclass

from markupsafe import Markup, escape

from skelgen.app.drawing.scales import ticks
from skelgen.app.drawing.wording import plain
from skelgen.model.arrays import Floats

LEFT, RIGHT, TOP = 52.0, 10.0, 22.0
"""px; left of the plot area for tick labels, right of it, and above it for the title of the y axis."""

_ATTRIBUTE_NAMES = {"cls": "class", "href": "href"}


def tag(name: str, *children: Markup | str, **attributes: str | float) -> Markup:
    """Return one element; underscores in attribute names become hyphens, ``cls`` becomes ``class``.

    Parameters
    ----------
    name : str
        Of the element.
    *children : Markup or str
        What is in it; texts are escaped.
    **attributes : str or float
        Values; numbers are rounded.
    """
    pairs = [(_ATTRIBUTE_NAMES.get(key, key.replace("_", "-")), number(value)) for key, value in attributes.items()]
    head = name + "".join(f' {key}="{escape(value)}"' for key, value in pairs)
    if not children:
        return Markup(f"<{head}/>")
    return Markup(f"<{head}>{''.join(escape(child) for child in children)}</{name}>")


def group(*children: Markup, **attributes: str | float) -> Markup:
    """Return a group of elements.

    Parameters
    ----------
    *children : Markup
        What is in it.
    **attributes : str or float
        See `tag`.
    """
    return tag("g", Markup("").join(children), **attributes)


def line(x1: float, y1: float, x2: float, y2: float, cls: str, **attributes: str | float) -> Markup:
    """Return a straight line [px].

    Parameters
    ----------
    x1, y1, x2, y2 : float, px
        Both ends.
    cls : str
        Classes of the style sheet.
    **attributes
        See `tag`.
    """
    return tag("line", x1=x1, y1=y1, x2=x2, y2=y2, cls=cls, **attributes)


def rect(x: float, y: float, width: float, height: float, cls: str, **attributes: str | float) -> Markup:
    """Return a rectangle [px].

    Parameters
    ----------
    x, y, width, height : float, px
        Upper left corner and size.
    cls : str
        Classes of the style sheet.
    **attributes
        See `tag`.
    """
    return tag("rect", x=x, y=y, width=width, height=height, cls=cls, **attributes)


def circle(x: float, y: float, radius: float, cls: str, hint: str = "") -> Markup:
    """Return a circle [px]; `hint` appears under the pointer.

    Parameters
    ----------
    x, y, radius : float, px
        Middle and radius.
    cls : str
        Classes of the style sheet.
    hint : str
        Appears under the pointer.
    """
    return tag("circle", *([tag("title", hint)] if hint else []), cx=x, cy=y, r=radius, cls=cls)


def text(x: float, y: float, content: str, cls: str = "", *, anchor: str = "start", turn: float = 0.0) -> Markup:
    """Return a text [px], turned clockwise by `turn` degrees about its own place.

    Parameters
    ----------
    x, y : float, px
        Where it stands on its line.
    content : str
        The text.
    cls : str
        Classes of the style sheet.
    anchor : str
        ``start``, ``middle`` or ``end``: which part of it stands there.
    turn : float, degrees
        Clockwise about its own place.
    """
    place: dict[str, str | float] = {"x": x, "y": y, "text_anchor": anchor}
    if turn:
        place["transform"] = f"rotate({number(turn)} {number(x)} {number(y)})"
    if cls:
        place["cls"] = cls
    return tag("text", content, **place)


def image(x: float, y: float, width: float, height: float, uri: str, *, crisp: bool = True) -> Markup:
    """Return an embedded picture stretched to a rectangle [px].

    Parameters
    ----------
    x, y, width, height : float, px
        Upper left corner and size.
    uri : str
        The picture.
    crisp : bool
        Whether pixels keep their edges.
    """
    cls = "crisp" if crisp else "smooth"
    return tag("image", x=x, y=y, width=width, height=height, href=uri, preserveAspectRatio="none", cls=cls)


def drawing(width: float, height: float, label: str, *children: Markup, least: float = 0.0) -> Markup:
    """Return a complete drawing that scales with the page but not below `least` pixels of width (it scrolls then).

    Parameters
    ----------
    width, height : float, px
        Its size.
    label : str
        What it shows, for those who do not see it.
    *children
        Elements.
    least : float, px
        Width below which it scrolls rather than shrinks.
    """
    style = f"max-width:{number(width)}px;min-width:{number(least)}px"
    box = f"0 0 {number(width)} {number(height)}"
    inside = Markup("").join(children)
    return tag(
        "svg", inside, viewBox=box, role="img", aria_label=label, style=style, xmlns="http://www.w3.org/2000/svg"
    )


def path_through(x: Floats, y: Floats) -> str:
    """Return path data through points [px], broken where y is NaN.

    Parameters
    ----------
    x, y : ndarray, shape (n,), px
        The points.
    """
    words, pen = [], "M"
    for across, down in zip(x.tolist(), y.tolist(), strict=True):
        if math.isnan(down):
            pen = "M"
            continue
        words.append(f"{pen}{number(across)} {number(down)}")
        pen = "L"
    return "".join(words)


def number(value: str | float) -> str:
    """Return a coordinate with one decimal at most; strings pass."""
    if isinstance(value, str):
        return value
    return f"{value + 0.0:.1f}".removesuffix(".0")  # plus 0, as a zero may be negative


@dataclass(frozen=True)
class Axes:
    """A plot area with linear axes.

    Attributes
    ----------
    width, height, bottom : float, px
        The whole drawing, and the space below the plot area.
    last_x, last_y : float
        Largest values on the axes.
    first_y : float
        Value at the foot of the y axis.
    """

    width: float
    height: float
    bottom: float
    last_x: float
    last_y: float
    first_y: float = 0.0

    def x(self, value: float) -> float:
        """Return the place [px] of a value on the x axis."""
        return LEFT + (self.width - LEFT - RIGHT) * value / self.last_x

    def y(self, value: float) -> float:
        """Return the place [px] of a value on the y axis."""
        share = (value - self.first_y) / (self.last_y - self.first_y)
        return self.height - self.bottom - (self.height - self.bottom - TOP) * share

    def frame(self, y_title: str, x_title: str = "") -> Markup:
        """Draw grid, tick labels and titles; without a title the x axis has no ticks.

        Parameters
        ----------
        y_title, x_title : str
            With units.
        """
        right, floor = self.width - RIGHT, self.height - self.bottom
        parts = [text(4, 12, y_title, "small")]
        for value in ticks(self.first_y, self.last_y, 4):
            parts += [
                line(LEFT, self.y(value), right, self.y(value), "grid"),
                text(LEFT - 6, self.y(value) + 3.5, plain(value), "small", anchor="end"),
            ]
        if x_title:
            parts += [
                text(self.x(value), floor + 15, plain(value), "small", anchor="middle")
                for value in ticks(0.0, self.last_x, 8)
            ]
            parts.append(text((LEFT + right) / 2, floor + 31, x_title, "small", anchor="middle"))
        parts.append(line(LEFT, floor, right, floor, "axis"))
        return group(*parts)
