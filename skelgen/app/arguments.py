"""Arguments of the face: refused in a sentence where nothing can be done with their type."""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

from skelgen.errors import InputError
from skelgen.model import Identities, PointCloud, Poses, Project, Trajectories
from skelgen.progress import Monitor

_P = ParamSpec("_P")
_R = TypeVar("_R")

_KINDS: Mapping[str, tuple[type, ...]] = {
    "format": (str,),
    "identities": (Identities, Path, str),
    "inputs": (Iterable,),
    "joined": (Iterable,),
    "kind": (str,),
    "monitor": (Monitor,),
    "names": (Iterable,),
    "output": (Path, str),
    "parted": (Iterable,),
    "path": (Path, str),
    "project": (Project,),
    "root": (str,),
    "frames": (Sequence,),
    "subject": (Project, Path, str, Sequence),
    "take": (PointCloud, Trajectories, Poses, Project),
    "takes": (Iterable,),
}
"""What arguments must be that no value checks."""


def with_checked_arguments(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Refuse, in a sentence, arguments that do not exist or are of types that nothing can be done with."""
    signature = inspect.signature(function)

    @wraps(function)
    def checked(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        try:
            given = signature.bind(*args, **kwargs).arguments
        except TypeError as error:
            takes = ", ".join(signature.parameters)
            raise InputError(f"{function.__name__} {error}; its arguments are {takes}") from error
        for name, value in given.items():
            kinds = _KINDS.get(name, (object,))
            if not isinstance(value, kinds) and value is not signature.parameters[name].default:
                wanted = " or ".join(kind.__name__ for kind in kinds)
                raise InputError(f"{name} is {value!r:.60}; {function.__name__} takes a {wanted} there")
        return function(*args, **kwargs)

    return checked
