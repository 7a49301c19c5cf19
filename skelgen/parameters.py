"""Parameters declared once: default, unit, bounds, help and their place in ``config.xml``.

A stage declares a frozen dataclass that derives from `StageParameters`, with one `declare` per field. The options of
the command line, ``config.xml``, the tables of the docs and the forms of the window are generated from that.
"""

import dataclasses
import math
from collections.abc import Mapping
from functools import cache
from typing import Any, ClassVar, Self, TypedDict, Unpack, get_type_hints

from skelgen.errors import ParameterError

ParameterValue = float | bool | str
"""What a declared parameter holds; an int counts as a float."""

_KEY = "skelgen"
_IN_WORDS = {int: "a whole number", float: "a number", bool: "yes or no", str: "a text"}


@dataclasses.dataclass(frozen=True)
class Declaration:
    """One declared parameter.

    Attributes
    ----------
    name : str
        Attribute name in its stage's parameters, e.g. ``alpha``.
    kind : type
        ``int``, ``float``, ``str`` or ``bool``.
    default : int, float, str or bool
        Value if none is given.
    help : str
        One sentence for the user.
    unit : str
        Unit of the value, empty for pure numbers.
    low, high : float or None
        Inclusive bounds of a number; None means no bound.
    choices : tuple of str
        Allowed values of a string; empty means any.
    config_name : str
        Name in ``config.xml``, as the classic program (Schönauer 2007, tables 4.13-4.16) calls it; empty where that
        has no such parameter.
    config_codes : tuple of str
        For a choice that the classic ``config.xml`` writes as an integer: the choice that each integer means.
    config_section : str
        Element of ``config.xml`` that holds it, e.g. ``JointFinder/NLCG``; if not given, that of the class
        that declares it.
    basic : bool
        Whether a form shows it at once, rather than among the advanced ones.
    acts_with : str
        When it has an effect, by the values of other parameters of its stage: alternatives joined by ``or``, each of
        conditions joined by ``and``, each a name with the values that suit, as in ``method=spectral and
        local_scaling=no or count=rising/rotation``. Empty means always. `take` stands for what the take holds:
        ``unlabelled``, ``labelled`` or ``bodies``; `n_limbs` for ``given`` or ``found``, and `limbs` for ``small``
        where one has fewer than three markers.
    """

    name: str
    kind: type
    default: Any
    help: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    config_name: str = ""
    config_codes: tuple[str, ...] = ()
    config_section: str = ""
    basic: bool = False
    acts_with: str = ""

    def acts(self, values: Mapping[str, object]) -> bool:
        """Return whether it has an effect beside the values of the other parameters of its stage.

        Parameters
        ----------
        values : mapping of str to value
            By name. A condition on a name that is not there is met.
        """
        alternatives = [alternative.split(" and ") for alternative in self.acts_with.split(" or ")]
        return any(all(_is_met(condition, values) for condition in one) for one in alternatives)

    @property
    def bounds(self) -> str:
        """The allowed values as text, e.g. ``0 .. 1``."""
        if self.choices:
            return " | ".join(self.choices)
        if self.low is None and self.high is None:
            return ""
        low = "-inf" if self.low is None else f"{self.low:g}"
        high = "inf" if self.high is None else f"{self.high:g}"
        return f"{low} .. {high}"

    def check(self, value: Any, where: str = "") -> Any:
        """Return `value` in the declared type, or raise.

        Parameters
        ----------
        value : object
            What the user gave: a value of the declared type, or its text.
        where : str
            Prefix for the error, e.g. ``config.xml:12``.

        Raises
        ------
        ParameterError
            If the value has the wrong type or lies outside the bounds.
        """
        prefix = f"{where}: " if where else ""
        clean = self._converted(value, prefix)
        if self.choices and clean not in self.choices:
            raise ParameterError(f"{prefix}{self.name} is {clean!r}; it must be one of {', '.join(self.choices)}")
        too_low = self.low is not None and clean < self.low
        too_high = self.high is not None and clean > self.high
        if too_low or too_high:
            raise ParameterError(f"{prefix}{self.name} is {clean:g}; it must lie in {self.bounds} {self.unit}".rstrip())
        return clean

    def _converted(self, value: Any, prefix: str) -> Any:
        wrong = ParameterError(f"{prefix}{self.name} is {value!r:.60}; it must be {_IN_WORDS[self.kind]}")
        if self.kind is bool:
            truth = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}
            if isinstance(value, bool):
                return value
            if str(value).strip().lower() in truth:
                return truth[str(value).strip().lower()]
            raise wrong
        if self.kind is str:
            if not isinstance(value, str):
                raise wrong
            return value
        if isinstance(value, bool):
            raise wrong
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError) as error:
            raise wrong from error
        if not math.isfinite(number) or (self.kind is int and number != int(number)):
            raise wrong
        return int(number) if self.kind is int else number


class Facts(TypedDict, total=False):
    """What can be declared of a parameter beside its default and help; see `Declaration`."""

    unit: str
    choices: tuple[str, ...]
    config_name: str
    config_codes: tuple[str, ...]
    config_section: str
    basic: bool
    acts_with: str


def _is_met(condition: str, values: Mapping[str, object]) -> bool:
    name, _, suitable = condition.partition("=")
    if name not in values:
        return True
    value = values[name]
    return (("no", "yes")[value] if isinstance(value, bool) else str(value)) in suitable.split("/")


def declare(
    default: Any, help: str, *, within: tuple[float | None, float | None] = (None, None), **facts: Unpack[Facts]
) -> Any:
    """Declare one parameter as a dataclass field.

    Parameters
    ----------
    default : int, float, str or bool
        Value if none is given.
    help : str
        One sentence for the user.
    within : (low, high)
        Inclusive bounds of a number; None means no bound.
    **facts
        Further attributes of `Declaration`.

    Returns
    -------
    dataclasses.Field
        To be assigned to the field of a `StageParameters`.

    Examples
    --------
    >>> @dataclasses.dataclass(frozen=True)
    ... class Cut(StageParameters):
    ...     stage: ClassVar[str] = "cut"
    ...     length: float = declare(0.5, "Shortest piece.", unit="s", within=(0.0, None))
    >>> Cut().length
    0.5
    >>> Cut(length=-1.0)
    Traceback (most recent call last):
    skelgen.errors.ParameterError: cut: length is -1; it must lie in 0 .. inf s
    """
    return dataclasses.field(
        default=default, metadata={_KEY: {"help": help, "low": within[0], "high": within[1], **facts}}
    )


@dataclasses.dataclass(frozen=True)
class StageParameters:
    """Base of every stage's parameters: validates all fields on construction.

    Attributes
    ----------
    stage : str
        Name of the stage, also its command and the key in a project's parameters.
    config_section : str
        Name of the element that groups these parameters in ``config.xml``.
    retired : mapping of str to str
        Names of parameters that the classic program or earlier versions had, and where they stand in ``config.xml``:
        they are read, and change nothing, which a notice says.
    acts_with : str
        When parameters have an effect that say nothing of it themselves, as in `Declaration`.
    classic : mapping of str to str
        Values that choose the methods of the classic program.
    """

    stage: ClassVar[str] = ""
    config_section: ClassVar[str] = ""
    retired: ClassVar[Mapping[str, str]] = {}
    acts_with: ClassVar[str] = ""
    classic: ClassVar[Mapping[str, str]] = {}

    def __post_init__(self) -> None:
        for declaration in self.declarations():
            object.__setattr__(self, declaration.name, declaration.check(getattr(self, declaration.name), self.stage))

    @classmethod
    @cache
    def declarations(cls) -> tuple[Declaration, ...]:
        """Return what is declared, in order."""
        kinds, found = get_type_hints(cls), []
        for field in dataclasses.fields(cls):
            declaring = [base for base in cls.__mro__ if field.name in vars(base).get("__annotations__", ())]
            usual = {
                "config_section": getattr(declaring[0], "config_section", ""),
                "acts_with": vars(declaring[0]).get("acts_with", ""),
            }
            facts = {**usual, **field.metadata[_KEY]}
            found.append(Declaration(name=field.name, kind=kinds[field.name], default=field.default, **facts))
        return tuple(found)

    @classmethod
    def from_mapping(cls, values: Mapping[str, object], where: str = "") -> Self:
        """Build parameters from names and values.

        Parameters
        ----------
        values : mapping of str to value
            Values or their texts; parameters that are not named keep their defaults.
        where : str
            Prefix for errors, e.g. ``config.xml:12``.

        Raises
        ------
        ParameterError
            If a name is unknown, or a value has the wrong type or lies outside its bounds.
        """
        if not isinstance(values, Mapping):
            raise ParameterError(f"the parameters of {cls.stage} are {values!r:.60}; they must map names to values")
        known = {declaration.name: declaration for declaration in cls.declarations()}
        for name in values:
            if name not in known and name not in cls.retired:
                prefix = f"{where}: " if where else ""
                raise ParameterError(f"{prefix}{cls.stage} has no parameter {name!r}; it has {', '.join(known)}")
        return cls(**{name: known[name].check(value, where) for name, value in values.items() if name in known})

    def idle(self, run: Mapping[str, object]) -> list[Declaration]:
        """Return the parameters that differ from their defaults and have no effect in a run.

        Parameters
        ----------
        run : mapping of str to value
            What is known beside the parameters: `take`, `n_limbs`, `limbs` as in `Declaration.acts_with`.
        """
        values = {**self.as_mapping(), **run}
        changed = [entry for entry in self.declarations() if values[entry.name] != entry.default]
        return [entry for entry in changed if not entry.acts(values)]

    def replace(self, **changes: object) -> Self:
        """Return a copy with some values changed."""
        return dataclasses.replace(self, **changes)

    def as_mapping(self) -> dict[str, ParameterValue]:
        """Return names and values as a plain dict."""
        return dataclasses.asdict(self)
