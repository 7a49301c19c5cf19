"""Values as plain JSON data plus named arrays, and back: what the project file is made of.

A dataclass becomes ``{"type": name, "fields": {...}}``, an array ``{"array": member}``, a mapping
``{"mapping": {...}}``, a number that JSON does not know ``{"number": "nan"}``; tuples become lists.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from skelgen.model import (
    Identities,
    Identity,
    Joint,
    Labelling,
    Limbs,
    Motion,
    PointCloud,
    Poses,
    Skeleton,
    Topology,
    Trajectories,
)
from skelgen.model.arrays import displayable
from skelgen.model.corrections import Correction, Place
from skelgen.model.joint_spans import JointSpan
from skelgen.model.labelling import Agreement, Doubt, Finding, Tracklets
from skelgen.model.project import Source

_TAKES = (PointCloud, Trajectories, Poses, Identities, Identity, Correction, Place, Source)
_RESULTS = (Labelling, Tracklets, Doubt, Finding, Agreement, Limbs, Topology, JointSpan, Skeleton, Joint, Motion)
_VALUES: dict[str, type] = {cls.__name__: cls for cls in (*_TAKES, *_RESULTS)}

_FORMER_FIELDS = {("Labelling", "seed_method"): "classic"}
"""What fields are called now that older files call otherwise: by type and former name."""

_ODD_NUMBERS = ("nan", "inf", "-inf")


def packed(value: Any, member: str, arrays: dict[str, NDArray[Any]]) -> Any:
    """Return `value` as JSON data and put its arrays into `arrays`.

    Parameters
    ----------
    value : object
        A value of `skelgen.model`, an array, a mapping, a tuple, a text, a number or None.
    member : str
        Name under which arrays of this value are stored, e.g. ``limbs``.
    arrays : dict of str to ndarray
        Receives the arrays by name.
    """
    if isinstance(value, np.ndarray):
        arrays[member] = value
        return {"array": member}
    if isinstance(value, Mapping):
        items = enumerate(value.items())  # a key may hold what no file name can
        return {"mapping": {key: packed(item, f"{member}/{index}", arrays) for index, (key, item) in items}}
    if isinstance(value, tuple | list):
        return [packed(item, f"{member}/{index}", arrays) for index, item in enumerate(value)]
    if dataclasses.is_dataclass(value):
        kind = _type_name(value)
        stored = [field.name for field in dataclasses.fields(value) if field.metadata.get("is_stored", True)]
        fields = {name: packed(getattr(value, name), f"{member}/{name}", arrays) for name in stored}
        return {"type": kind, "fields": fields}
    if isinstance(value, float) and not math.isfinite(value):
        return {"number": str(value)}
    return value


def unpacked(data: Any, array: Callable[[str], NDArray[Any]]) -> Any:
    """Return the value that `packed` made `data` from.

    Parameters
    ----------
    data : object
        JSON data.
    array : callable (member) -> ndarray
        Delivers an array by its name.

    Raises
    ------
    ValueError
        If `data` is not what `packed` returns.
    InputError
        If a value refuses its fields.
    """
    if isinstance(data, list):
        return tuple(unpacked(item, array) for item in data)
    if not isinstance(data, dict):
        return displayable(data) if isinstance(data, str) else data
    if set(data) == {"array"} and isinstance(data["array"], str):
        return array(data["array"])
    if set(data) == {"number"} and data["number"] in _ODD_NUMBERS:
        return float(data["number"])
    if set(data) == {"mapping"} and isinstance(data["mapping"], dict):
        return {key: unpacked(item, array) for key, item in data["mapping"].items()}
    if set(data) == {"type", "fields"} and isinstance(data["fields"], dict):
        fields = {key: unpacked(item, array) for key, item in data["fields"].items()}
        if data["type"] == Source.__name__:
            fields["path"] = data["fields"]["path"]  # as the disk has it, be it UTF-8 or not
        return _value(data["type"], fields)
    raise ValueError(f"an object with the keys {', '.join(sorted(data)) or 'none'} means nothing here")


def _type_name(value: Any) -> str:
    """Name of the declared type that a value is of, be it a kind of it that computes some fields when asked."""
    return next(cls.__name__ for cls in type(value).__mro__ if "__dataclass_fields__" in vars(cls))


def _value(type_name: Any, fields: dict[str, object]) -> Any:
    if type_name not in _VALUES:
        raise ValueError(f"there is no value of type {type_name!r}")
    cls = _VALUES[type_name]
    fields = {_FORMER_FIELDS.get((type_name, name), name): value for name, value in fields.items()}
    declared = dataclasses.fields(cls)
    unset = dataclasses.MISSING
    needed = {field.name for field in declared if field.default is unset and field.default_factory is unset}
    known = {field.name for field in declared}
    if not needed <= set(fields) <= known:  # older files lack what was added since, with a default
        odd = ", ".join(sorted((needed - set(fields)) | (set(fields) - known)))
        raise ValueError(f"the fields of a {type_name} do not fit: {odd}")
    hints = get_type_hints(cls)
    for name, value in fields.items():
        if not _fits(value, hints[name]):
            raise ValueError(f"{name} of a {type_name} is of the wrong type, {type(value).__name__}")
    try:
        return cls(**fields)
    except (TypeError, AttributeError, IndexError) as error:
        raise ValueError(f"a field of a {type_name} has the wrong type: {error}") from error


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is of the type that a field declares."""
    kind, parts = get_origin(hint), get_args(hint)
    if kind is UnionType:
        return any(_fits(value, part) for part in parts)
    if kind is tuple:
        same = len(parts) == 2 and parts[1] is ...
        wanted = parts[:1] * len(value) if same and isinstance(value, tuple) else parts
        return isinstance(value, tuple) and len(value) == len(wanted) and all(map(_fits, value, wanted))
    if kind is Mapping:
        return isinstance(value, Mapping) and all(_fits(item, parts[1]) for item in value.values())
    if hint is float:
        return isinstance(value, float | int) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return hint is Any or (kind is not Callable and isinstance(value, kind or hint))
