"""The pages on file formats say what readers and writers do."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from lxml import etree
from skelgen_formats.mfml import read_mfml
from skelgen_formats.registry import write_file

PAGES = Path(__file__).parents[2] / "docs" / "file-formats"


def documented_bytes() -> bytes:
    text = (PAGES / "mfml.md").read_text(encoding="utf-8")
    [block] = re.findall(r"^```text\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    pairs = (re.match(r"((?:[0-9a-f]{2} {1,2})*[0-9a-f]{2})(?: {3}|$)", line).group(1) for line in block.splitlines())
    return bytes.fromhex(" ".join(pairs))


def test_documented_bytes_of_mfml_are_what_the_page_says_they_are(tmp_path):
    (tmp_path / "two.mfml").write_bytes(documented_bytes())
    cloud = read_mfml(tmp_path / "two.mfml")
    np.testing.assert_array_equal(cloud.points, [[100, 200.5, -3.25], [0, 0, 1500], [100, 200.5, -3.25]])
    np.testing.assert_array_equal(cloud.frame_starts, [0, 2, 3])
    np.testing.assert_allclose(cloud.times, [0, 0.01])
    np.testing.assert_array_equal(cloud.attributes["reprojection_error"], [0.25, 0.5, 0.25])
    np.testing.assert_array_equal(cloud.attributes["n_blobs"], [4, 2, 4])
    np.testing.assert_array_equal(cloud.attributes["id"], [7, 8, 7])


def test_writer_makes_the_documented_bytes_of_mfml(tmp_path):
    (tmp_path / "two.mfml").write_bytes(documented_bytes())
    write_file(read_mfml(tmp_path / "two.mfml"), tmp_path / "again.mfml")
    assert (tmp_path / "again.mfml").read_bytes() == documented_bytes()


def words_of_xml(path) -> set[str]:
    """Names of elements, attributes and vectors; those of joints without the numbers of their limbs."""
    words = set()
    for element in etree.parse(path).iter():
        words |= {re.sub(r"^joint\d+-\d+$", "joint0-1", element.tag), *element.attrib}
        if element.tag == "vector":
            words.add(element.get("name"))
    return words


def test_every_word_of_the_output_xml_is_on_its_page_and_no_other(jointed_project, small_project, tmp_path):
    used = set()
    for project in (jointed_project, small_project):
        used |= words_of_xml(write_file(project, tmp_path / "walk.xml", xml_detail="all")[0])
    used = {word for word in used if not word.isdigit()}  # a vector of a joint is named by its frame
    text = (PAGES / "output-xml.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([\w-]+)(?:=\"0\")?`", text))
    assert used - named == set()
    values = {"mm", "s", "1", "ball", "hinge", "universal", "rigid", "undetermined", "NaN"}
    values |= {"world", "motion", "joints", "all"}
    beyond = {"COVARIANCE", "COVARIANCEINBONE", "AXISSTANDARDDEVIATION", "SECONDAXISSTANDARDDEVIATION"}
    beyond |= {"TURNCOVARIANCE", "Noise", "StandardDeviation", "SEEN"}  # only where they were estimated
    assert named - used - values - beyond == set()
