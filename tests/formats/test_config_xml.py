from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree
from skelgen_formats.config_xml import read_config, write_config
from skelgen_formats.xml_text import closest_first

from skelgen.errors import FormatError, ParameterError, SkelgenError, WriteError
from skelgen.parameters import StageParameters, declare


@dataclass(frozen=True)
class Search(StageParameters):
    stage: ClassVar[str] = "search"
    config_section: ClassVar[str] = "JointFinder/NLCG"
    retired: ClassVar[Mapping[str, str]] = {"smallest": "JointFinder/NLCG/EPS"}

    method: str = declare(
        "polak",
        "How the direction -- the next one -- is chosen -",
        choices=("fletcher", "polak", "newton"),
        config_name="METHOD",
        config_codes=("fletcher", "polak"),
    )
    tolerance: float = declare(1e-7, "When to stop.", unit="mm", within=(0.0, 0.1), config_name="FTOL")
    anneal: bool = declare(False, "Shake.", config_name="ADDRANDOM")


@dataclass(frozen=True)
class Joints(StageParameters):
    stage: ClassVar[str] = "joints"
    config_section: ClassVar[str] = "JointFinder"

    sampling: int = declare(10, "Every so many frames.", unit="frames", within=(1, None), config_name="SAMPLING")
    file_name: str = declare('a <b> & "c"\'', "Name of a file.")


STAGES = (Joints, Search)


@pytest.fixture
def write(tmp_path):
    """Write the inside of a config.xml and return its path; the text begins in line 2."""

    def make(text):
        path = tmp_path / "config.xml"
        path.write_text(f"<Parameters>\n{text}\n</Parameters>\n", encoding="utf-8")
        return path

    return make


def refused(path, kind=ParameterError):
    with pytest.raises(kind) as caught:
        read_config(path, STAGES)
    return str(caught.value).replace(str(path), "config.xml")


def test_defaults_come_back(tmp_path):
    write_config(tmp_path / "config.xml", STAGES)
    assert read_config(tmp_path / "config.xml", STAGES).parameters == {"joints": Joints(), "search": Search()}


NAMES = st.text(st.characters(blacklist_categories=["Cs", "Cc"], blacklist_characters="\ufffe\uffff"), max_size=20)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    method=st.sampled_from(["fletcher", "polak", "newton"]),
    tolerance=st.floats(0, 0.1),
    anneal=st.booleans(),
    sampling=st.integers(1, 10**9),
    name=NAMES,
)
def test_values_come_back(tmp_path, method, tolerance, anneal, sampling, name):
    given_values = Joints(sampling=sampling, file_name=name), Search(method, tolerance, anneal)
    write_config(tmp_path / "config.xml", given_values)
    back = read_config(tmp_path / "config.xml", STAGES).parameters
    assert (back["joints"], back["search"]) == given_values


def test_elements_are_nested_and_typed_as_in_the_seed(tmp_path):
    write_config(tmp_path / "config.xml", STAGES)
    root = etree.parse(tmp_path / "config.xml").getroot()
    assert root.tag == "Parameters"
    assert dict(root.find("JointFinder/SAMPLING").attrib) == {"value": "10", "type": "int"}
    assert dict(root.find("JointFinder/FILE_NAME").attrib)["type"] == "string"
    assert dict(root.find("JointFinder/NLCG/FTOL").attrib) == {"value": "1e-07", "type": "double"}
    assert dict(root.find("JointFinder/NLCG/METHOD").attrib) == {"value": "1", "type": "int"}
    assert dict(root.find("JointFinder/NLCG/ADDRANDOM").attrib) == {"value": "0", "type": "int"}


def test_help_unit_and_bounds_are_comments(tmp_path):
    write_config(tmp_path / "config.xml", STAGES)
    comments = [node.text.strip() for node in etree.parse(tmp_path / "config.xml").iter(etree.Comment)]
    assert "Every so many frames. [1 .. inf frames]" in comments
    assert "When to stop. [0 .. 0.1 mm]" in comments
    assert any("(0 = fletcher, 1 = polak)" in comment for comment in comments)


def test_missing_parameters_and_groups_keep_their_defaults(write):
    values = read_config(write('<JointFinder><SAMPLING value="3" type="int"/></JointFinder>'), STAGES).parameters
    assert values == {"joints": Joints(sampling=3), "search": Search()}


def test_parameter_of_an_earlier_version_is_read_and_changes_nothing(write):
    text = '<JointFinder><NLCG><EPS value="1e-20" type="double"/></NLCG></JointFinder>'
    read = read_config(write(text), STAGES)
    assert read.parameters["search"] == Search()
    assert read.retired["search"] == ["EPS"]
    assert Search.from_mapping({"smallest": 1e-20, "anneal": True}) == Search(anneal=True)


def test_choice_is_read_as_code_or_as_name(write):
    for value, type_ in (("0", "int"), ("fletcher", "string")):
        text = f'<JointFinder><NLCG><METHOD value="{value}" type="{type_}"/></NLCG></JointFinder>'
        assert read_config(write(text), STAGES).parameters["search"] == Search(method="fletcher")


def test_whole_number_is_read_where_a_number_belongs(write):
    text = '<JointFinder><NLCG><FTOL value="0" type="int"/></NLCG></JointFinder>'
    assert read_config(write(text), STAGES).parameters["search"] == Search(tolerance=0.0)


def test_file_with_names_of_the_classic_program_alone_is_a_classic_file(write):
    assert read_config(write('<JointFinder><SAMPLING value="3" type="int"/></JointFinder>'), STAGES).is_classic
    own = '<JointFinder><SAMPLING value="3" type="int"/><FILE_NAME value="a" type="string"/></JointFinder>'
    assert not read_config(write(own), STAGES).is_classic


def joint_finder(line):
    return f"<JointFinder>\n<!-- a comment\n of two lines -->\n{line}\n</JointFinder>"  # the line is number 5


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('<SAMPLNG value="3" type="int"/>', "JointFinder/SAMPLNG is unknown; JointFinder has SAMPLING,"),
        ('<SAMPLING value="3" type="double"/>', "has the type 'double'; it must be 'int'"),
        ('<SAMPLING value="3.5" type="int"/>', "'3.5'; it must be a whole number"),
        ('<SAMPLING value="0" type="int"/>', "is 0; it must lie in 1 .. inf frames"),
        ('<SAMPLING value="3"/>', "must have the attributes value and type, and hold nothing; it has value"),
        ('<SAMPLING value="3" type="int" unit="s"/>', "it has value, type, unit"),
        ('<NLCG><FTOL value="nan" type="double"/></NLCG>', "'nan'; it must be a number"),
        ('<NLCG><FTOL value="0.2" type="double"/></NLCG>', "is 0.2; it must lie in 0 .. 0.1 mm"),
        ('<NLCG><METHOD value="2" type="int"/></NLCG>', "it must be one of 0 = fletcher, 1 = polak"),
        ('<NLCG><METHOD value="2" type="double"/></NLCG>', "it must be 'int' or 'string'"),
        ('<NLCG><METHOD value="best" type="string"/></NLCG>', "one of fletcher, polak, newton"),
        ('<NLCG><ADDRANDOM value="yes" type="int"/></NLCG>', "it must be 0 or 1"),
        ('<NLCG value="1" type="int"/>', "is a group of parameters and has no value; it holds METHOD, FTOL, ADDRANDOM"),
        ('<SAMPLING value="3" type="int"/><SAMPLING value="4" type="int"/>', "is given twice"),
    ],
)
def test_wrong_parameter_is_an_error_that_names_the_line(write, line, message):
    text = refused(write(joint_finder(line)))
    assert text.startswith("config.xml:5: JointFinder/")
    assert message in text


def test_unknown_group_is_an_error_that_lists_the_groups(write):
    assert refused(write("<JointFnder/>")) == "config.xml:2: JointFnder is unknown; Parameters has JointFinder"


def test_two_parameters_of_one_name_are_refused():
    @dataclass(frozen=True)
    class Other(Joints):
        stage: ClassVar[str] = "other"

    with pytest.raises(ParameterError, match="declares SAMPLING twice"):
        read_config("config.xml", (Joints, Other))


def test_broken_foreign_and_missing_files_are_format_errors(write, tmp_path):
    assert refused(write("<JointFinder>"), FormatError).startswith("config.xml:3: broken XML")
    path = tmp_path / "config.xml"
    path.write_text("<Settings/>")
    assert refused(path, FormatError) == "config.xml:1: the root element is <Settings> where <Parameters> belongs"
    path.write_text('<!DOCTYPE Parameters [<!ENTITY a "b">]><Parameters/>')
    assert "document type" in refused(path, FormatError)
    path.write_text("")
    assert "broken XML" in refused(path, FormatError)
    assert "cannot be read" in refused(tmp_path / "none.xml", FormatError)


def test_text_that_xml_cannot_hold_is_refused_and_leaves_the_old_file(tmp_path):
    path = tmp_path / "config.xml"
    write_config(path, STAGES)
    before = path.read_bytes()
    with pytest.raises(WriteError, match="XML forbids"):
        write_config(path, (Joints(file_name="a\x00b"),))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(at=st.floats(0, 1), length=st.integers(0, 30), patch=st.binary(max_size=6))
def test_mutated_file_is_read_or_a_skelgen_error(tmp_path, at, length, patch):
    path = tmp_path / "config.xml"
    write_config(path, STAGES)
    data = path.read_bytes()
    start = int(at * len(data))
    path.write_bytes(data[:start] + patch + data[start + length :])
    try:
        read_config(path, STAGES)
    except SkelgenError as error:
        assert "config.xml" in str(error)


def test_name_of_a_megabyte_is_compared_in_no_time():
    start = time.perf_counter()
    assert closest_first("alpha" * 200_000, ["beta" * 50_000, "alpha" * 50_000])[0][:5] == "alpha"
    assert time.perf_counter() - start < 1.0
