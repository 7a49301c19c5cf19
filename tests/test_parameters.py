"""Parameters declared once: types, bounds, choices, and every stage's own."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import ClassVar

import pytest

from skelgen.app.configuration import parameters_class
from skelgen.errors import ParameterError
from skelgen.model.project import STAGES
from skelgen.parameters import StageParameters, declare


@dataclass(frozen=True)
class Soup(StageParameters):
    """Something to declare parameters for."""

    stage: ClassVar[str] = "soup"
    litres: float = declare(1.5, "How much.", unit="l", within=(0.0, 20.0), config_name="LITRES")
    eggs: int = declare(2, "How many.", within=(0, None))
    is_hot: bool = declare(True, "Whether it is heated.")
    kind: str = declare("pea", "Which.", choices=("pea", "bean"), config_codes=("pea", "bean"))


def stage_parameters():
    return [parameters_class(stage) for stage in STAGES]


@pytest.mark.parametrize(
    ("name", "given", "clean"),
    [
        ("litres", 2, 2.0),
        ("litres", "0.5", 0.5),
        ("eggs", "3", 3),
        ("eggs", 4.0, 4),
        ("is_hot", "no", False),
        ("is_hot", "True", True),
        ("kind", "bean", "bean"),
        ("litres", 20, 20.0),
        ("litres", 0, 0.0),
    ],
)
def test_values_and_their_texts_become_the_declared_type(name, given, clean):
    value = getattr(Soup.from_mapping({name: given}), name)
    assert value == clean
    assert type(value) is type(clean)


@pytest.mark.parametrize(
    ("name", "given", "sentence"),
    [
        ("litres", 21, "litres is 21; it must lie in 0 .. 20 l"),
        ("litres", -0.1, "it must lie in 0 .. 20 l"),
        ("eggs", -1, "it must lie in 0 .. inf"),
        ("eggs", 1.5, "eggs is 1.5; it must be a whole number"),
        ("eggs", True, "a whole number"),
        ("litres", "much", "litres is 'much'; it must be a number"),
        ("litres", float("nan"), "must be a number"),
        ("litres", "inf", "must be a number"),
        ("litres", None, "must be a number"),
        ("is_hot", "perhaps", "must be yes or no"),
        ("is_hot", 2, "must be yes or no"),
        ("kind", "leek", "kind is 'leek'; it must be one of pea, bean"),
        ("kind", 0, "must be a text"),
    ],
)
def test_bad_values_are_refused_with_what_would_do(name, given, sentence):
    with pytest.raises(ParameterError, match=sentence):
        Soup(**{name: given})


def test_unknown_names_are_answered_with_the_known_ones():
    with pytest.raises(ParameterError, match="soup has no parameter 'salt'; it has litres, eggs, is_hot, kind"):
        Soup.from_mapping({"salt": 1})


def test_errors_begin_with_their_place():
    with pytest.raises(ParameterError, match=r"^config.xml:12: litres is 99"):
        Soup.from_mapping({"litres": 99}, "config.xml:12")
    with pytest.raises(ParameterError, match=r"^config.xml:3: soup has no"):
        Soup.from_mapping({"salt": 1}, "config.xml:3")


def test_replaced_values_are_checked_too():
    assert Soup().replace(eggs=5).eggs == 5
    with pytest.raises(ParameterError):
        Soup().replace(eggs=-5)


def test_mapping_round_trips():
    soup = Soup(litres=3, kind="bean")
    assert Soup.from_mapping(soup.as_mapping()) == soup


def test_parameters_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Soup().eggs = 1


def test_declarations_keep_their_order_and_facts():
    first = Soup.declarations()[0]
    assert [declaration.name for declaration in Soup.declarations()] == ["litres", "eggs", "is_hot", "kind"]
    assert (first.unit, first.config_name, first.bounds, first.kind) == ("l", "LITRES", "0 .. 20", float)
    assert Soup.declarations()[3].bounds == "pea | bean"
    assert Soup.declarations()[2].bounds == ""


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage_declares_parameters_under_its_name(stage):
    declared = parameters_class(stage)
    assert declared.stage == stage
    assert declared.config_section
    assert declared().as_mapping() == {one.name: one.default for one in declared.declarations()}


def test_every_parameter_has_help_and_every_number_bounds():
    for declared in stage_parameters():
        for one in declared.declarations():
            assert len(one.help) > 10, one.name
            assert one.kind not in (int, float) or None not in (one.low, one.high), one.name


def test_codes_of_the_classic_program_name_choices():
    for declared in stage_parameters():
        for one in declared.declarations():
            assert set(one.config_codes) <= set(one.choices), one.name


def test_seed_names_the_issue_lists_are_there():
    names = {one.config_name for declared in stage_parameters() for one in declared.declarations()}
    assert {"SAMPLING", "MINRANGE", "TRIMRANGE", "LOCALSIGMA", "M", "ALPHA", "FTOL", "ITMAX", "METHOD"} <= names


@pytest.mark.parametrize("declared", stage_parameters(), ids=lambda declared: declared.stage)
def test_parameters_of_the_classic_method_say_so(declared):
    chosen = {f"{name}={value}" for name, value in declared.classic.items()}
    silent = [
        entry.name
        for entry in declared.declarations()
        if chosen & set(entry.acts_with.replace(" or ", " and ").split(" and "))
        and not entry.help.lower().startswith("classic method")
    ]
    assert silent == []
