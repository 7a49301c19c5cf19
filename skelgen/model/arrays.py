"""Clean, read-only arrays for the values: one check per meaning."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeGuard, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skelgen.errors import InputError, ParameterError
from skelgen.progress import counted

_Number = TypeVar("_Number", bound=np.generic)
Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.signedinteger[Any]]
Bools = NDArray[np.bool_]


LARGEST_COORDINATE = 1e9
"""mm; beyond a thousand kilometres a unit is wrong or a file broken, and squares lose the millimetre."""


def set_fields(value: object, **fields: object) -> None:
    """Give the fields of a frozen value what the checks of its `__post_init__` returned.

    Parameters
    ----------
    value : object
        The frozen value.
    **fields : object
        Its fields by name.
    """
    for name, field in fields.items():
        object.__setattr__(value, name, field)


def check_floats(values: ArrayLike, shape: Sequence[int | None], what: str, *, finite: bool = False) -> Floats:
    """Return a read-only float64 copy of the stated shape; what nobody can write to is not copied.

    Parameters
    ----------
    values : array_like
        The numbers; infinities are refused, NaN is allowed unless `finite`.
    shape : sequence of int or None
        Expected shape; None leaves an axis free.
    what : str
        Name of the value in errors.
    finite : bool
        Refuse NaN as well.

    Raises
    ------
    InputError
        If the shape or a number is wrong.
    """
    if not _is_frozen(values):
        values = as_floats(values, what, f"{len(shape)} axes")
    array = _frozen(np.asarray(values), shape, what)
    if np.isinf(array).any() or (finite and np.isnan(array).any()):
        raise InputError(f"{what} holds values that are not finite numbers")
    return array


def check_fields(
    value: Any, shapes: Mapping[str, Sequence[int | None]], what: str = "{}", *, finite: bool = False
) -> None:
    """Give fields of a frozen value read-only float64 copies of the stated shapes; None stays where it is the default.

    Parameters
    ----------
    value : object
        The frozen value.
    shapes : mapping of str to sequence of int or None
        Shape of each field by its name; None leaves an axis free.
    what : str
        Name of a field in errors; ``{}`` stands for that in the value.
    finite : bool
        Refuse NaN.

    Raises
    ------
    InputError
        If a shape or a number is wrong.
    """
    for name, shape in shapes.items():
        given = getattr(value, name)
        if given is not None or value.__dataclass_fields__[name].default is not None:
            set_fields(value, **{name: check_floats(given, shape, what.replace("{}", name, 1), finite=finite)})


def as_floats(values: ArrayLike, what: str, shape: str) -> Floats:
    """Return a float64 copy of what can be one; what is masked is NaN.

    Parameters
    ----------
    values : array_like
        The numbers, of any shape.
    what : str
        Name of the value in errors.
    shape : str
        What it must be, in errors: ``3 axes``.

    Raises
    ------
    InputError
        If there is something else than real numbers, or rows are unlike in length.
    """
    try:
        given = np.ma.array(values) if _has_masks(values) else np.asarray(values)
        floats = given.astype(np.float64, casting="unsafe" if given.dtype.kind == "O" else "same_kind")
    except (TypeError, ValueError) as error:
        what = f"{what} must be an array of real numbers with {shape}, all rows of one length"
        raise InputError(f"{what}; it is {values!r:.40}") from error
    return np.asarray(np.ma.filled(floats, np.nan))


def _has_masks(values: ArrayLike) -> bool:
    """Whether numbers may be masked: np.asarray would take what is there for seen."""
    rows = values if isinstance(values, list | tuple) else [values]
    return any(isinstance(row, np.ma.MaskedArray) for row in rows)


def check_probabilities(values: ArrayLike, shape: Sequence[int | None], what: str) -> Floats:
    """Return a read-only float64 copy of the stated shape, whose numbers are 0 to 1 or NaN.

    Parameters
    ----------
    values : array_like
        The probabilities.
    shape : sequence of int or None
        Expected shape; None leaves an axis free.
    what : str
        Name of the value in errors.

    Raises
    ------
    InputError
        If the shape or a number is wrong.
    """
    array = check_floats(values, shape, what)
    if ((array < 0) | (array > 1)).any():
        raise InputError(f"{what} holds values that are no probabilities from 0 to 1")
    return array


def check_ints(values: ArrayLike, shape: Sequence[int | None], what: str) -> Ints:
    """Return a read-only intp copy of the stated shape.

    Parameters
    ----------
    values : array_like
        The whole numbers.
    shape : sequence of int or None
        Expected shape; None leaves an axis free.
    what : str
        Name of the value in errors.

    Raises
    ------
    InputError
        If the shape is wrong, or the values are no whole numbers.
    """
    try:
        array = np.array(values)
    except ValueError as error:  # rows of different lengths
        raise InputError(f"{what} must be whole numbers") from error
    if array.size and not np.issubdtype(array.dtype, np.integer):
        raise InputError(f"{what} must be whole numbers")
    return _frozen(array.astype(np.intp), shape, what)


def check_bools(values: ArrayLike, shape: Sequence[int | None], what: str) -> Bools:
    """Return a read-only boolean copy of the stated shape.

    Parameters
    ----------
    values : array_like
        The truth values.
    shape : sequence of int or None
        Expected shape; None leaves an axis free.
    what : str
        Name of the value in errors.

    Raises
    ------
    InputError
        If the shape is wrong.
    """
    return _frozen(np.array(values, dtype=np.bool_), shape, what)


def check_coordinates(places: Floats, name: str) -> None:
    """Raise `InputError` if a coordinate is impossibly large.

    Parameters
    ----------
    places : ndarray, mm
        Of any shape.
    name : str
        Name of the take in errors.
    """
    largest = float(np.nanmax(np.abs(places), initial=0.0))
    if largest > LARGEST_COORDINATE:
        raise InputError(f"{name}: a coordinate is {largest:g} mm, more than a thousand kilometres; check the unit")


def check_names(names: Sequence[str], count: int, what: str) -> tuple[str, ...]:
    """Return distinct, non-empty names as a tuple.

    Parameters
    ----------
    names : sequence of str
        The names.
    count : int
        How many there must be.
    what : str
        What they name, for errors: ``marker``.

    Raises
    ------
    InputError
        If there are more or fewer, or one is empty or stands twice.
    """
    if not isinstance(names, Iterable) or isinstance(names, str | bytes):
        raise InputError(f"{what} names must be several texts, as in a list, not {names!r:.40}")
    clean = tuple(displayable(str(name)) for name in names)
    if len(clean) != count:
        raise InputError(f"{counted(len(clean), what + ' name')} where {count} belong")
    seen: set[str] = set()
    for name in clean:
        if not name.strip():
            raise InputError(f"a {what} has an empty name")
        if name in seen:
            raise InputError(f"two {what}s are called {name!r}; names must differ")
        seen.add(name)
    return clean


def displayable(text: str) -> str:
    """Return a text that every file can hold: what stands for bytes that are not UTF-8 becomes a question mark."""
    return text.encode("utf-8", "replace").decode()


def check_rate(rate: Any, what: str) -> float:
    """Return a positive, finite rate [Hz].

    Parameters
    ----------
    rate : float, Hz
        The rate.
    what : str
        What has it, for errors: ``the take``.

    Raises
    ------
    InputError
        If it is not above 0.
    """
    try:
        value = float(rate)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what} has a rate of {rate!r:.60}; it must be a number of Hz") from error
    if not np.isfinite(value) or value <= 0:
        raise InputError(f"{what} has a rate of {value:g} Hz; it must be above 0")
    return value


def check_whole(value: Any, least: int, what: str) -> int:
    """Return a whole number.

    Parameters
    ----------
    value : int
        The number.
    least : int
        Smaller ones are refused.
    what : str
        Name of the value in errors.

    Raises
    ------
    ParameterError
        If it is none, or too small.
    """
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer) or value < least:
        raise ParameterError(f"{what} is {value!r:.60}; it must be a whole number of at least {least}")
    return int(value)


def _is_frozen(values: ArrayLike) -> TypeGuard[Floats]:
    """Whether an array comes from another value: an hour of markers need not be held twice."""
    return (
        isinstance(values, np.ndarray)
        and not isinstance(values, np.ma.MaskedArray)
        and values.dtype == np.float64
        and not values.flags.writeable
        and bool(values.flags.owndata)
    )


def _frozen(array: NDArray[_Number], shape: Sequence[int | None], what: str) -> NDArray[_Number]:
    """The same array, read-only, if it has the stated shape."""
    wanted = tuple(have if want is None else want for have, want in zip(array.shape, shape, strict=False))
    if array.ndim != len(shape) or array.shape != wanted:
        axes = ", ".join("any" if want is None else str(want) for want in shape)
        raise InputError(f"{what} has shape {array.shape}; it must be ({axes})")
    return read_only(array)


def read_only(array: NDArray[_Number]) -> NDArray[_Number]:
    """Return the same array, which nobody can write into from now on: values take it as it is."""
    array.flags.writeable = False
    return array


def evenly_spread(indices: Ints, most: int) -> Ints:
    """Return at most so many of some indices, evenly spread over them.

    Parameters
    ----------
    indices : ndarray of intp, shape (n,)
        Rising.
    most : int
        How many are wanted at most.
    """
    if len(indices) <= most:
        return indices
    return indices[np.unique(np.linspace(0, len(indices) - 1, most).astype(np.intp))]


def spread_frames(n_frames: int, most: int) -> Ints:
    """Return at most so many frames of a take, evenly spread.

    Parameters
    ----------
    n_frames : int
        Frames of the take.
    most : int
        How many are wanted at most.
    """
    return evenly_spread(np.arange(n_frames), most)


def numbers_between(low: Ints, high: Ints) -> tuple[Ints, Ints]:
    """Return the numbers of many ranges, one range after the other: which range each is of, and the number.

    Parameters
    ----------
    low, high : ndarray of intp, shape (n_ranges,)
        First number of each range, and the one behind its last; a range that ends before it begins is empty.
    """
    count = np.maximum(high - low, 0)
    which = np.repeat(np.arange(len(low)), count)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(count) - count - low, count)


def runs_of(values: Bools) -> list[tuple[int, int]]:
    """Return the first index of each run of true values, shape (n,), and that behind its last."""
    steps = np.flatnonzero(np.diff(np.concatenate([[False], values, [False]]).astype(np.int8)))
    return [(int(start), int(stop)) for start, stop in steps.reshape(-1, 2)]


def runs_of_equal(*columns: Ints) -> tuple[Ints, Ints]:
    """Return the first row of each run in which no column changes, and the last one, shapes (n_runs,)."""
    n_rows = len(columns[0])
    changes = np.any([column[1:] != column[:-1] for column in columns], axis=0)
    first = np.flatnonzero(np.concatenate([[True], changes])) if n_rows else np.empty(0, dtype=np.intp)
    return first, np.append(first[1:], n_rows)[: len(first)] - 1


def rows_of_each(values: Ints) -> list[Ints]:
    """Return the rows of each value that occurs, shapes (n_rows,), in the order of values and of rows."""
    order = np.argsort(values, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(values[order])) + 1) if len(order) else []
