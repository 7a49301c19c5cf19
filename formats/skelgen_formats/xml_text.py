"""XML files that people edit: read with line numbers and without anything that reaches outside, and written whole."""

import difflib
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, indent, tostring

from skelgen.errors import FormatError, WriteError
from skelgen.files import read_content, replacing

SAFE_XML: dict[str, Any] = {"resolve_entities": False, "no_network": True, "load_dtd": False, "huge_tree": False}
"""How lxml parses what strangers wrote: nothing outside of the file is reached, nothing grows without bound."""

_COMPARED = 64  # characters of names: the comparison takes time as the square of their length
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # XML 1.0, production 2 (Char)


def read_root(path: Path, root_name: str, file_name: str, largest: int) -> Any:
    """Parse a file and return its root element; comments are gone, elements know their lines.

    Parameters
    ----------
    path : Path
        The file.
    root_name : str
        Name that the root element must have; any if empty.
    file_name : str
        What such a file is called in errors, e.g. ``config.xml``.
    largest : int
        Bytes that no such file exceeds; -1 if it may have any number.

    Raises
    ------
    FormatError
        If the file cannot be read, is too large, is no well-formed XML, declares a document type or has another root.
    """
    from lxml import etree  # noqa: PLC0415 - costs 50 ms, and most runs read no such file

    parser = etree.XMLParser(remove_comments=True, remove_pis=True, **SAFE_XML)
    content = read_content(path, largest + 1 or -1)
    if 0 <= largest < len(content):
        raise FormatError(path, "", f"the file is larger than {largest} bytes; no {file_name} is")
    try:
        root = etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        raise FormatError(path, error.lineno or "", f"broken XML: {error.msg}") from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise FormatError(path, 1, f"a document type is declared; {file_name} has none")
    if root_name and root.tag != root_name:
        raise FormatError(path, root.sourceline or 1, f"the root element is <{root.tag}> where <{root_name}> belongs")
    return root


def quoted(text: str) -> str:
    """Return a text as the value of an attribute, in quotes."""
    from xml.sax.saxutils import quoteattr  # noqa: PLC0415 - loads urllib, which takes 30 ms

    return quoteattr(text)


def write_lines(path: Path, lines: Iterable[str]) -> None:
    """Write the lines of an XML document, its declaration before them, replacing the file as a whole.

    Parameters
    ----------
    path : Path
        The file.
    lines : iterable of str
        Without their ends.

    Raises
    ------
    WriteError
        If a text holds a character that XML forbids, or the file cannot be written.
    """
    text = "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', *lines]) + "\n"
    if (found := _NOT_XML.search(text)) is not None:
        raise WriteError(f"{path}: a value holds the character {found[0]!r}, which XML forbids")
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def comment_text(sentence: str) -> str:
    """Return a sentence as a comment can hold it, which must not hold two hyphens in a row."""
    return re.sub("--+", "-", sentence)


def number_text(numbers: Iterable[float]) -> str:
    """Return numbers with all their digits, blanks between."""
    return " ".join(repr(float(number)) for number in numbers)


def write_tree(path: Path, root: Element) -> None:
    """Write an element with all it holds as an indented document; see `write_lines`.

    Parameters
    ----------
    path : Path
        The file.
    root : Element
        Its root element.
    """
    indent(root)
    write_lines(path, tostring(root, encoding="unicode").split("\n"))


def closest_first(name: object, known: Sequence[str]) -> list[str]:
    """Return known names, those that are most like a wrong one first.

    Parameters
    ----------
    name : object
        The wrong name.
    known : sequence of str
        The right ones.
    """

    def similarity(one: str) -> float:
        return difflib.SequenceMatcher(None, str(name)[:_COMPARED].lower(), one[:_COMPARED].lower()).ratio()

    return sorted(known, key=similarity, reverse=True)
