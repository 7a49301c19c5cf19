"""Mutations of files for fuzz.py: of bytes, of texts by their tokens, of JSON by its values, of archives by members."""

from __future__ import annotations

import copy
import io
import json
import random
import re
import struct
import zipfile
from collections.abc import Callable
from typing import Any

Change = Callable[[random.Random, bytes], bytes]

MOST_BYTES = 1 << 20
"""Of a mutated file; what grows beyond is cut."""

_NUMBERS = (
    *("0", "-0", "1", "-1", "2", "255", "256", "65535", "65536", "2147483647", "4294967295", "4294967296"),
    *("9223372036854775808", "99999999999999999999", "1e9", "1e15", "1e300", "1e308", "1e309", "-1e308", "1e-320"),
    *("nan", "NaN", "inf", "-inf", "Infinity", "", " ", "x", "1_0", "0x10", "1,5", "1.2.3", "+5", "1e", "٣", "½", "²"),
    *("0.5", "1e-9", "-0.001", "1" * 400, "0." + "3" * 400, "null", "true", "[]"),
)
_WORDS = (
    *("", " ", "\t", ",", ";", ":", "\x00", "\x0b", "\x1c", "\x85", "\u2028", "\ufeff", "\ud800", "é", "日本", "😀"),
    *(
        "DROPOUT",
        "*12",
        "Unlabeled 7",
        "Frame",
        "MOTION",
        "{",
        "}",
        "$Points",
        ":hierarchy",
        "END",
        "a b",
        "a:b",
        "=1+1",
    ),
    *(
        "../../x",
        "/etc/passwd",
        "C:\\x",
        "%s%n",
        "{0}",
        "'",
        '"',
        "''",
        "\\",
        "<a>",
        "</a>",
        "&lt;",
        "&a;",
        "<!--",
        "-->",
    ),
    *("<?x?>", "<![CDATA[", "]]>", "nobody", "limb0", "x" * 5000, "mm", "parsec", "ZYX", "ball", "XYZ"),
)
_BINARY = (
    *(struct.pack(kind, value) for kind in ("<h", ">h", "<i", ">i", "<q") for value in (0, 1, -1, 255, 32767, -32768)),
    *(struct.pack("<I", value) for value in (2**31 - 1, 2**31, 2**32 - 1, 10**9)),
    *(struct.pack("<f", value) for value in (0.0, -0.0, 1e38, -1e38, 1e-40, float("nan"), float("inf"))),
    *(struct.pack("<d", value) for value in (1e308, -1e308, 1e-320, float("nan"), float("inf"), 0.0)),
    b"\x01\x00\x80\x7f",  # a NaN that signals
)
_TOKEN = re.compile(r"[^\s,;=<>\"'/{}\[\]:]+|\s+|.", re.DOTALL)
_VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2**31, 2**63, 2**64, 10**30, 0.5, 1e308, -1e-308, "", "a", "\ud800", "x" * 3000),
    *([], {}, [[]], [0], [0, 1, 2], {"a": 1}, {"array": "take/positions"}, {"array": "absent"}, {"number": "nan"}),
    *({"number": "inf"}, {"mapping": {}}, {"type": "Joint", "fields": {}}, {"type": "Source", "fields": {}}),
)


def mutated_bytes(dice: random.Random, content: bytes) -> bytes:
    """Return content with one to six damages anywhere, rather in its beginning, where headers are."""
    changed = bytearray(content)
    for _ in range(dice.choice((1, 1, 1, 2, 2, 3, 6))):
        _damage(dice, changed)
        del changed[MOST_BYTES:]
    return bytes(changed[:MOST_BYTES])


def _damage(dice: random.Random, changed: bytearray) -> None:
    at, length = _place(dice, len(changed)), min(dice.choice((1, 2, 4, 16, 64, 512)), len(changed))
    match dice.randrange(10):
        case 0:
            changed[at : at + 1] = bytes([dice.randrange(256)])
        case 1:
            changed[at : at + 1] = bytes([(changed[at] if at < len(changed) else 0) ^ (1 << dice.randrange(8))])
        case 2 | 3:
            word = dice.choice(_BINARY)
            changed[at : at + len(word)] = word
        case 4:
            del changed[at : at + length]
        case 5:
            changed[at:at] = changed[at : at + length] * dice.choice((1, 1, 2, 50))
        case 6:
            changed[at:at] = dice.randbytes(length)
        case 7:
            other = _place(dice, len(changed))
            changed[at : at + length] = changed[other : other + length]
        case 8:
            del changed[at:]
        case _:
            changed[at : at + length] = bytes(length) if dice.random() < 0.5 else b"\xff" * length


def _place(dice: random.Random, length: int) -> int:
    return dice.randrange(max(1, min(length, dice.choice((64, 600, 2048, length, length)))))


def mutated_text(dice: random.Random, content: bytes) -> bytes:
    """Return a text with some tokens or lines replaced, doubled, taken away; sometimes in another encoding."""
    text = content.decode("utf-8", "surrogateescape")
    for _ in range(dice.choice((1, 1, 2, 3, 8))):
        text = (_changed_line if dice.random() < 0.35 else _changed_token)(dice, text)[:MOST_BYTES]
    encoding = dice.choice(("utf-8",) * 12 + ("utf-8-sig", "utf-16", "latin-1"))
    if dice.random() < 0.05:
        text = text.replace("\n", dice.choice(("\r", "\r\n", "\n\n")))
    return text.encode(encoding, "replace" if encoding == "latin-1" else "surrogatepass")


def _changed_token(dice: random.Random, text: str) -> str:
    first = dice.randrange(max(1, len(text) - 3000)) if dice.random() < 0.5 else 0
    tokens = [match.span() for match in _TOKEN.finditer(text, first, first + 3000)]
    if not tokens:
        return dice.choice(_WORDS)
    start, end = dice.choice(tokens)
    other = text[slice(*dice.choice(tokens))]
    number = any(character.isdigit() for character in text[start:end])
    choices = _NUMBERS if number and dice.random() < 0.7 else _WORDS
    match dice.randrange(6):
        case 0 | 1 | 2:
            return text[:start] + dice.choice(choices) + text[end:]
        case 3:
            return text[:start] + other + text[end:]
        case 4:
            return text[:start] + text[start:end][:500] * dice.choice((2, 3, 60, 2000)) + text[end:]
        case _:
            return text[:start] + text[end:]


def _changed_line(dice: random.Random, text: str) -> str:
    lines = text.split("\n")
    at, other = dice.randrange(len(lines)), dice.randrange(len(lines))
    match dice.randrange(7):
        case 0:
            del lines[at]
        case 1:
            lines[at:at] = [lines[at][:2000]] * dice.choice((1, 1, 2, 500))
        case 2:
            lines[at], lines[other] = lines[other], lines[at]
        case 3:
            lines[at] = lines[at][: dice.randrange(len(lines[at]) + 1)]
        case 4:
            lines = lines[: at + 1]
        case 5:
            lines[at:at] = [dice.choice(("", "#", "# x", "\t\t\t", " ", ",,,"))] * dice.choice((1, 3, 3000))
        case _:
            mark = next((mark for mark in "\t;, " if mark in lines[at]), " ")
            cells = lines[at].split(mark)
            cells[dice.randrange(len(cells))] = dice.choice(_NUMBERS)
            lines[at] = mark.join(cells)
    return "\n".join(lines)


def mutated_json(dice: random.Random, content: bytes) -> bytes:
    """Return JSON with some values replaced, taken away, moved or wrapped; sometimes damaged as a text."""
    if dice.random() < 0.15:
        return mutated_text(dice, content)
    data = json.loads(content)
    for _ in range(dice.choice((1, 1, 1, 2, 4))):
        places = _places(data)
        holder, key = dice.choice(places)
        match dice.randrange(7):
            case 0 | 1 | 2:
                holder[key] = copy.deepcopy(dice.choice(_VALUES))
            case 3:
                del holder[key]
            case 4:
                other, name = dice.choice(places)
                holder[key] = json.loads(json.dumps(other[name]))  # fails where an earlier change took it away
            case 5:
                holder[key] = [holder[key]] if dice.random() < 0.5 else {"mapping": {"a": holder[key]}}
            case _ if isinstance(holder[key], int | float) and not isinstance(holder[key], bool):
                holder[key] = dice.choice((holder[key] + 1, -holder[key], holder[key] * 10**6, 0, float(holder[key])))
            case _ if isinstance(holder[key], list):
                holder[key] = holder[key] * 2 if dice.random() < 0.5 else holder[key][:-1]
            case _:
                holder[key] = str(holder[key]) + dice.choice(_WORDS)
        if not _places(data):
            break
    return json.dumps(data, ensure_ascii=dice.random() < 0.9).encode("utf-8", "surrogatepass")


def _places(data: Any) -> list[tuple[Any, Any]]:
    """Every place in lists and objects, as holder and key."""
    found, waiting = [], [data]
    while waiting:
        holder = waiting.pop()
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        found += [(holder, key) for key in keys]
        waiting += [holder[key] for key in keys if isinstance(holder[key], dict | list)]
    return found


def mutated_archive(dice: random.Random, content: bytes) -> bytes:
    """Return a zip with one to three members mutated, left out, renamed or compressed; sometimes damaged as bytes."""
    if not content.startswith(b"PK"):
        return mutated_array(dice, content)
    if dice.random() < 0.15:
        return mutated_bytes(dice, content)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
        compression = archive.infolist()[0].compress_type
    names = sorted(members)
    texts = [name for name in names if name.endswith(".json")] or names
    for _ in range(dice.choice((1, 1, 2, 3))):
        name = dice.choice(texts if dice.random() < 0.6 else names)
        if name not in members:
            continue
        if dice.random() < 0.04:
            del members[name]
        elif dice.random() < 0.04:
            members[dice.choice(names)] = members[name]
        else:
            members[name] = (mutated_json if name.endswith(".json") else mutated_array)(dice, members[name])
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression if dice.random() < 0.97 else zipfile.ZIP_DEFLATED) as archive:
        for name, member in members.items():
            archive.writestr(zipfile.ZipInfo(name), member, archive.compression)
    return stream.getvalue()


def mutated_array(dice: random.Random, content: bytes) -> bytes:
    """Return a .npy file with another header that has the stated length, or other numbers."""
    if dice.random() < 0.4 or content[:6] != b"\x93NUMPY":
        return mutated_bytes(dice, content)
    length = int.from_bytes(content[8:10], "little")
    header, numbers = content[10 : 10 + length], content[10 + length :]
    if dice.random() < 0.5:
        header = mutated_text(dice, header)[:60000]
        if dice.random() < 0.7:
            header = header.ljust(length)
        return content[:8] + len(header).to_bytes(2, "little") + header + numbers
    values = bytearray(numbers)
    for _ in range(dice.choice((1, 2, 20))):
        at = 8 * dice.randrange(max(1, len(values) // 8))
        word = dice.choice((*(struct.pack("<q", value) for value in (0, 1, -1, -2, 5, 10**6, 2**62)), *_BINARY[-7:-1]))
        values[at : at + 8] = word.ljust(8, b"\0") if at + 8 <= len(values) else b""
    return content[: 10 + length] + bytes(values)


CHANGES: dict[str, tuple[Change, ...]] = {
    "bytes": (mutated_bytes,),
    "text": (mutated_text, mutated_text, mutated_bytes),
    "json": (mutated_json,),
    "archive": (mutated_archive,),
}
"""Mutations by kind of file; the first are drawn as often as they stand there."""
