"""Limbs are named by the shape of their tree and how it moves, where no name of a marker helps."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from skelgen.kinematics.chain.chain import ObservedChain
from skelgen.model import Motion, Skeleton
from skelgen.model.limbs import body_and_limb
from skelgen.stages.names.animals import BodyPlan, find_chain, find_hand, find_quadruped
from skelgen.stages.names.by_markers import SIDES, unique_names
from skelgen.stages.names.likely_segments import OfSet
from skelgen.stages.names.moving_tree import MovingTree, moving_trees, together, tree_of_chain
from skelgen.stages.names.person import find_person, side_evidence

SURE = 3.0
"""Log odds from which sides are decided: nineteen of twenty would be right if signs were independent."""

_LEAST_OTHERS = 2.5
"""Log odds of all signs but the knees, which have to agree with them."""

_LIKE_SET, _WHOLE_SET = 4.0, 16.0
"""Log odds of a limb's segment by a set whose shape its markers have: a similar one, and one that is worn whole."""

_CHAIN, _PERSON = "a chain", "a person"
_STATED = 99.0
_MIRRORED = "a mirrored recording cannot be told from a true one by its shape"


_FOUND: WeakKeyDictionary[Motion, tuple[list[str], list[tuple[MovingTree, str, BodyPlan]]]] = WeakKeyDictionary()
"""What was found in a motion: names that the user states later change nothing of it."""


@dataclass(frozen=True)
class WornShape:
    """A marker set whose shape the markers of a body have.

    Attributes
    ----------
    called : mapping of int to str
        What the set calls limbs; its left may be the right.
    is_whole : bool
        Whether all of the set's markers are there and no others.
    title : str
        Of the set.
    """

    called: Mapping[int, str]
    is_whole: bool
    title: str


@dataclass(frozen=True)
class ShapeNames:
    """Names by shape.

    Attributes
    ----------
    names : tuple of str, length n_limbs
        ``limb7`` where the shape does not tell.
    sentences : tuple of str
        What each tree was taken for, and how sure its sides are.
    """

    names: tuple[str, ...]
    sentences: tuple[str, ...]


def names_by_shape(
    skeleton: Skeleton, motion: Motion, stated: Mapping[int, str], find_worn: Callable[[], Sequence[WornShape]] = tuple
) -> ShapeNames:
    """Return names of limbs by what their trees look like: a person, an animal, a hand, a chain.

    Parameters
    ----------
    skeleton : Skeleton
        With at least one limb.
    motion : Motion
        With at least one frame.
    stated : mapping of int to str
        Names that the user gives limbs; one with a side decides the sides of its body.
    find_worn : callable () -> sequence of WornShape
        Finds the bodies whose markers have the shape of a marker set; asked once for a motion.
    """
    if motion not in _FOUND:
        worn = find_worn()
        notices = [
            f"the markers{_of_body(skeleton, one.called)} have {'the' if one.is_whole else 'nearly the'} shape of "
            f"{one.title}"
            for one in worn
        ]
        _FOUND[motion] = notices, _shapes(moving_trees(skeleton, motion), worn)
    named: dict[int, tuple[float, str]] = {}
    sentences, shapes = [*_FOUND[motion][0]], _FOUND[motion][1]
    for tree, what, shape in shapes:
        evidence = _stated_evidence(shape, stated) or shape.evidence
        named |= {limb: (float(tree.markers[limb].shape[1]), _name(shape, limb, evidence)) for limb in shape.segments}
        sentences.append(_sentence(_of_body(skeleton, shape.segments), what, shape, evidence))
    return ShapeNames(unique_names(named, skeleton.bodies), tuple(sentences))


def _shapes(trees: Sequence[MovingTree], worn: Sequence[WornShape]) -> list[tuple[MovingTree, str, BodyPlan]]:
    """What trees are, in words, and their shapes; trees that are nothing by themselves may be pieces of one person."""
    found, rest, others = [], [], list(trees)
    for one in worn:
        of_set = [tree for tree in others if sum(limb in one.called for limb in tree.limbs) * 2 > len(tree.limbs)]
        whole = together(of_set) if len(of_set) > 1 else next(iter(of_set), None)
        shape = None if whole is None else _person(whole, len(of_set) == 1, _of_set(one))
        if whole is not None and shape is not None:
            found.append((whole, _PERSON, shape))
            others = [tree for tree in others if tree not in of_set]
    for tree in others:
        what, shape = _recognised(tree) or ("", None)
        if shape is None or (what == _CHAIN and len(others) > 1):  # beside others, a piece of them
            rest.append(tree)
        else:
            found.append((tree, what, shape))
    if len(rest) > 1:
        whole = together(rest)
        shape = _person(whole, is_whole=False)
        found += [(whole, _PERSON, shape)] if shape else []
    return found


def segments_by_shape(fit: ObservedChain) -> dict[int, str]:
    """Return the segments of the person that a fitted chain is by shape; none if it is none.

    Parameters
    ----------
    fit : ObservedChain
        In frames spread over the take; every limb has markers.
    """
    tree = tree_of_chain(fit)
    person = None if tree is None else find_person(tree)
    return {} if person is None else dict(person.segments)


def contradicts_sides(skeleton: Skeleton, motion: Motion) -> bool:
    """Whether the names of a person's legs say left where its knees and feet say right.

    Parameters
    ----------
    skeleton : Skeleton
        With names of limbs.
    motion : Motion
        With at least one frame.
    """
    for tree in moving_trees(skeleton, motion):
        found = _recognised(tree)
        if found is not None and found[0] == _PERSON and abs(found[1].evidence) >= SURE:
            stated = _stated_evidence(found[1], dict(enumerate(skeleton.limb_names)))
            if stated * found[1].evidence < 0:
                return True
    return False


def _recognised(tree: MovingTree) -> tuple[str, BodyPlan] | None:
    """What a tree is, in words, and its shape."""
    for what, find in (("a hand", find_hand), ("a four-legged animal", find_quadruped), (_CHAIN, find_chain)):
        shape = find(tree)
        if shape is not None:
            return what, shape
    shape = _person(tree)
    return None if shape is None else (_PERSON, shape)


def _of_set(worn: WornShape) -> dict[int, OfSet]:
    """What limbs are by the names that a set gives them."""
    odds, found = _WHOLE_SET if worn.is_whole else _LIKE_SET, {}
    for limb, name in worn.called.items():
        plain = name.rstrip("0123456789 ")
        side = next((side for side in SIDES if plain.startswith(side)), "")
        found[limb] = OfSet(plain.removeprefix(f"{side} "), SIDES.index(side) if side else -1, odds)
    return found


def _person(tree: MovingTree, is_whole: bool = True, worn: Mapping[int, OfSet] | None = None) -> BodyPlan | None:
    """The shape of the person that a tree is, or None if it is none; the sides of pieces without joints stay unsure."""
    person = find_person(tree, worn)
    if person is None:
        return None
    signs = side_evidence(tree, person)
    knees, total = signs["knees"], sum(signs.values())
    agrees = knees * total > 0 and (total - knees) * np.sign(knees) >= _LEAST_OTHERS and is_whole
    return BodyPlan(dict(person.segments), dict(person.sides), total if agrees else 0.0)


def _stated_evidence(shape: BodyPlan, stated: Mapping[int, str]) -> float:
    """Log odds by the sides in names that the user gave: the majority decides."""
    votes = 0
    for limb, name in stated.items():
        side = body_and_limb(name)[1].partition(" ")[0]
        if side in SIDES and limb in shape.sides:
            votes += 1 if (side == "left") == (shape.sides[limb] == 0) else -1
    return _STATED * votes


def _name(shape: BodyPlan, limb: int, evidence: float) -> str:
    segment = shape.segments[limb]
    if limb not in shape.sides:
        return segment
    side = shape.sides[limb]
    if abs(evidence) < SURE:
        return f"{segment} {'AB'[side]}" if len(set(shape.sides.values())) > 1 else segment
    return f"{SIDES[side if evidence > 0 else 1 - side]} {segment}"


def _of_body(skeleton: Skeleton, limbs: Iterable[int]) -> str:
    """Which body some limbs are of, in words; empty if there is only one, or they are of several."""
    own = set(limbs)
    numbers = [number for number, body in enumerate(skeleton.bodies, start=1) if own & set(body.tolist())]
    return f" of body{numbers[0]}" if len(skeleton.bodies) > 1 and len(numbers) == 1 else ""


def _sentence(whose: str, what: str, shape: BodyPlan, evidence: float) -> str:
    sentence = f"by shape and motion the limbs{whose} are those of {what}"
    if not shape.sides:
        return sentence
    if abs(evidence) >= _STATED:
        return f"{sentence}; its sides are as you say"
    if abs(evidence) < SURE:
        return f"{sentence}; which side is left is not sure, so that sides are called A and B"
    return f"{sentence}, sides by what bends and points which way; {_MIRRORED}"
