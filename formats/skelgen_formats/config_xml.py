"""``config.xml`` (Schönauer 2007, 4.9): all parameters, grouped by the part of the program that they steer.

The root is ``Parameters``. An element with the attributes ``value`` and ``type`` (``double``, ``int`` or ``string``) is
a parameter, any other element a group. Parameters bear the classic names where there is one, else their own in
capitals. Truth values are 0 or 1; a choice that the classic file codes as a number is written as that number and read
as either. A number of type ``int`` is read where a ``double`` belongs.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from skelgen.errors import ParameterError
from skelgen.parameters import Declaration, StageParameters
from skelgen_formats.xml_text import closest_first, quoted, read_root, write_lines

ROOT = "Parameters"

_TYPES: Mapping[type, str] = {float: "double", int: "int", bool: "int", str: "string"}
_INDENT = "  "
_LARGEST_FILE = 1 << 20  # bytes; all parameters with their comments take some 20 kB

AnyStage = type[StageParameters] | StageParameters


@dataclass
class _Group:
    """One element that groups parameters and other groups; names in the order of the file."""

    parameters: dict[str, tuple[AnyStage, Declaration]] = field(default_factory=dict)
    groups: dict[str, _Group] = field(default_factory=dict)
    retired: dict[str, str] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        return [*self.parameters, *self.groups]


@dataclass(frozen=True, eq=False)
class Config:
    """What a ``config.xml`` holds.

    Attributes
    ----------
    parameters : dict of str to StageParameters
        One per class that was asked for, by the name of its stage; what the file does not mention has its default.
    given : dict of str to set of str
        Names of the parameters that the file sets, by stage.
    retired : dict of str to list of str
        Names in the file that set nothing any more, by stage.
    """

    parameters: dict[str, StageParameters]
    given: dict[str, set[str]]
    retired: dict[str, list[str]]

    @property
    def is_classic(self) -> bool:
        """Whether the file sets nothing but what the classic program has."""
        return all(
            declaration.config_name or declaration.name not in self.given[stage]
            for stage, parameters in self.parameters.items()
            for declaration in parameters.declarations()
        )


def write_config(path: Path | str, stages: Sequence[AnyStage]) -> None:
    """Write parameters with their help, unit and bounds as comments.

    Parameters
    ----------
    path : Path or str
        File to write, replaced as a whole.
    stages : sequence of StageParameters or of their classes
        Values to write; a class stands for its defaults.

    Raises
    ------
    WriteError
        If a text holds a character that XML forbids, or the file cannot be written.
    """
    write_lines(Path(path), [f"<{ROOT}>", *_group_lines(_tree(stages), _INDENT), f"</{ROOT}>"])


def read_config(path: Path | str, stages: Sequence[type[StageParameters]]) -> Config:
    """Read parameters.

    Parameters
    ----------
    path : Path or str
        The file.
    stages : sequence of StageParameters classes
        What is declared.

    Raises
    ------
    FormatError
        If the file cannot be read or is no well-formed XML.
    ParameterError
        If a group or a parameter is unknown or given twice, a value has the wrong type or lies out of its bounds.
    """
    path, tree = Path(path), _tree(stages)
    values: dict[str, dict[str, object]] = {cls.stage: {} for cls in stages}
    retired: dict[str, list[str]] = {cls.stage: [] for cls in stages}
    root = read_root(path, ROOT, "config.xml", _LARGEST_FILE)
    for where, stage, name, value in _read_group(path, root, tree, ""):
        if name in values[stage] or name in retired[stage]:
            raise ParameterError(f"{where} is given twice; leave one")
        if value is None:
            retired[stage].append(name)
        else:
            values[stage][name] = value
    parameters = {cls.stage: cls.from_mapping(values[cls.stage], str(path)) for cls in stages}
    return Config(parameters, {stage: set(given) for stage, given in values.items()}, retired)


def _tree(stages: Iterable[AnyStage]) -> _Group:
    """Sort the declarations into the groups of the file."""
    root = _Group()
    for stage in stages:
        for declaration in stage.declarations():
            section = declaration.config_section or stage.config_section or stage.stage
            group = root
            for name in section.split("/"):
                group = group.groups.setdefault(name, _Group())
            name = declaration.config_name or declaration.name.upper()
            if name in group.names:
                raise ParameterError(f"the stage {stage.stage!r} declares {name} twice in {ROOT}/{section}")
            group.parameters[name] = (stage, declaration)
        for place in stage.retired.values():
            section, _, name = place.rpartition("/")
            group = root
            for part in section.split("/"):
                group = group.groups.setdefault(part, _Group())
            group.retired[name] = stage.stage
    return root


def _group_lines(group: _Group, indent: str) -> Iterator[str]:
    for name, (stage, declaration) in group.parameters.items():
        type_, text = _written(declaration, getattr(stage, declaration.name))
        yield f"{indent}<!-- {_comment(declaration)} -->"
        yield f'{indent}<{name} value={quoted(text)} type="{type_}"/>'
    for name, inner in group.groups.items():
        yield f"{indent}<{name}>"
        yield from _group_lines(inner, indent + _INDENT)
        yield f"{indent}</{name}>"


def _comment(declaration: Declaration) -> str:
    bounds = f"{declaration.bounds} {declaration.unit}".strip()
    if declaration.config_codes:
        bounds += f" ({_codes(declaration)})"
    text = f"{declaration.help} [{bounds}]" if bounds else declaration.help
    return re.sub("-(?=-)", "- ", text).rstrip("-")  # two hyphens would end the comment


def _codes(declaration: Declaration) -> str:
    return ", ".join(f"{code} = {choice}" for code, choice in enumerate(declaration.config_codes))


def _written(declaration: Declaration, value: Any) -> tuple[str, str]:
    """Type and text of a value in the file."""
    if value in declaration.config_codes:
        return "int", str(declaration.config_codes.index(value))
    if declaration.kind is bool:
        return "int", str(int(value))
    return _TYPES[declaration.kind], repr(value) if declaration.kind is float else str(value)


def _read_group(path: Path, element: Any, group: _Group, at: str) -> Iterator[tuple[str, str, str, Any]]:
    """Yield place, stage, name and value of every parameter; the value is None of those that set nothing any more."""
    for child in element:
        name = f"{at}/{child.tag}" if at else str(child.tag)
        where = f"{path}:{child.sourceline}: {name}"
        if child.tag in group.parameters:
            stage, declaration = group.parameters[child.tag]
            yield where, stage.stage, declaration.name, _value(where, child, declaration)
        elif child.tag in group.groups and not child.attrib:
            yield from _read_group(path, child, group.groups[child.tag], name)
        elif child.tag in group.groups:
            held = ", ".join(group.groups[child.tag].names)
            raise ParameterError(f"{where} is a group of parameters and has no value; it holds {held}")
        elif child.tag in group.retired:
            yield where, group.retired[child.tag], child.tag, None
        else:
            known = ", ".join(closest_first(child.tag, group.names))
            raise ParameterError(f"{where} is unknown; {at or ROOT} has {known}")


def _value(where: str, element: Any, declaration: Declaration) -> Any:
    if set(element.attrib) != {"value", "type"} or len(element):
        found = ", ".join(map(str, element.attrib)) or "none"
        raise ParameterError(f"{where} must have the attributes value and type, and hold nothing; it has {found}")
    type_, text = element.get("type"), element.get("value")
    if declaration.config_codes and type_ == "int":
        if not (text.isascii() and text.isdigit() and float(text) < len(declaration.config_codes)):
            raise ParameterError(f"{where} is {text!r}; it must be one of {_codes(declaration)}")
        text = declaration.config_codes[int(text)]
    elif type_ not in _read_as(declaration.kind):
        raise ParameterError(f"{where} has the type {type_!r}; it must be {_allowed_types(declaration)}")
    if declaration.kind is bool and text not in {"0", "1"}:
        raise ParameterError(f"{where} is {text!r}; it must be 0 or 1")
    return declaration.check(text, where)


def _allowed_types(declaration: Declaration) -> str:
    read = _read_as(declaration.kind)
    return " or ".join(map(repr, dict.fromkeys(("int", *read) if declaration.config_codes else read)))


def _read_as(kind: type) -> tuple[str, ...]:
    """Types that a value of a kind may have in the file; the classic program keeps both kinds of numbers as one."""
    return ("double", "int") if kind is float else (_TYPES[kind],)
