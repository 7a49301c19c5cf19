"""Values as plain JSON data plus named arrays, and back: what the project file is made of.

A dataclass becomes ``{"type": name, "fields": {...}}``, an array ``{"array": member}``, a mapping
``{"mapping": {...}}``, a number that JSON does not know ``{"number": "nan"}``; tuples become lists.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

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
from skelgen.model.corrections import Correction, Place
from skelgen.model.labelling import Agreement, Doubt, Finding, Tracklets
from skelgen.model.project import Source

_TAKES = (PointCloud, Trajectories, Poses, Identities, Identity, Correction, Place, Source)
_RESULTS = (Labelling, Tracklets, Doubt, Finding, Agreement, Limbs, Topology, Skeleton, Joint, Motion)
_VALUES: dict[str, type] = {cls.__name__: cls for cls in (*_TAKES, *_RESULTS)}

_FIELDS_ON_DISK = {("Labelling", "classic"): "seed_method"}
"""Fields that files call otherwise, as the first version did: by type and field."""

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
        names = {name: _FIELDS_ON_DISK.get((kind, name), name) for name in stored}
        fields = {names[name]: packed(getattr(value, name), f"{member}/{names[name]}", arrays) for name in names}
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
        return data
    if set(data) == {"array"} and isinstance(data["array"], str):
        return array(data["array"])
    if set(data) == {"number"} and data["number"] in _ODD_NUMBERS:
        return float(data["number"])
    if set(data) == {"mapping"} and isinstance(data["mapping"], dict):
        return {key: unpacked(item, array) for key, item in data["mapping"].items()}
    if set(data) == {"type", "fields"} and isinstance(data["fields"], dict):
        return _value(data["type"], {key: unpacked(item, array) for key, item in data["fields"].items()})
    raise ValueError(f"an object with the keys {', '.join(sorted(data)) or 'none'} means nothing here")


def _type_name(value: Any) -> str:
    """Name of the declared type that a value is of, be it a kind of it that computes some fields when asked."""
    return next(cls.__name__ for cls in type(value).__mro__ if "__dataclass_fields__" in vars(cls))


def _value(type_name: Any, fields: dict[str, object]) -> Any:
    if type_name not in _VALUES:
        raise ValueError(f"there is no value of type {type_name!r}")
    cls = _VALUES[type_name]
    for (kind, name), on_disk in _FIELDS_ON_DISK.items():
        if kind == type_name and on_disk in fields:
            fields = {name if key == on_disk else key: value for key, value in fields.items()}
    declared = dataclasses.fields(cls)
    needed = {field.name for field in declared if field.default is dataclasses.MISSING}
    known = {field.name for field in declared}
    if not needed <= set(fields) <= known:  # older files lack what was added since, with a default
        odd = ", ".join(sorted((needed - set(fields)) | (set(fields) - known)))
        raise ValueError(f"the fields of a {type_name} do not fit: {odd}")
    try:
        return cls(**fields)
    except (TypeError, AttributeError, IndexError) as error:
        raise ValueError(f"a field of a {type_name} has the wrong type: {error}") from error
