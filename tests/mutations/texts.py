"""Mutations of bytes and of TOML and CSV texts, as a careless or hostile hand makes them."""

import json
import random
import re
from collections.abc import Callable, Sequence
from functools import partial
from unicodedata import category

SIGNS = (
    "\x1b[2J", "\x1b]0;t\x07", "\x1bP1$r\x1b\\", "\x9b31m", "\a\b", "\r", "\u202e\u2066", "\u200b", "\u2028"
)  # fmt: skip
"""What acts on a terminal, or hides how a line reads."""
NO_TEXT = "\udcff"
"""A byte in the name of a file that is no UTF-8."""

ADDRESSES = (
    "http://[::1/", "http://[::1]:99999/", "https://user:pass@127.0.0.1:9/a?b=c#d", "http://127.0.0.1:-1/",
    "http://[::ffff:169.254.169.254]/", "mqtts://[fe80::1%lo]:9", "spy:///dev/ttyS0?file=canary", "loop://",
    "socket://127.0.0.1:70000", "rfc2217://u@[::1]:9?logging=debug", "hwgrep://.*", "postgresql://[",
    "interface=virtual,channel=\x1b[2J", "interface=slcan,channel=/dev/full,bitrate=0", "127.0.0.1:9",
    "127.0.0.1:99999999999", "mailto://127.0.0.1:9?from=a@b&to=c@d&smtp=169.254.169.254", "file:///etc/hosts",
    *(f"http://127.0.0.1:9/{sign}" for sign in SIGNS), *(f"socket://{sign}:9" for sign in SIGNS),
)  # fmt: skip

STRANGE_NUMBERS = (
    "1e308", "-1e308", "1e-320", "5e-324", "nan", "inf", "-inf", "-0.0", "-0", "0", "0.0", "-1", "1", "2",
    "9223372036854775807", "-9223372036854775808", "9223372036854775808", "123456789012345678901234",
    "0.1234567890123456789012345", "1e6", "-1e6", "1000001", "999999.9", "1e-9", "1e9", "5500.0", "0x7f",
    "1_000", "+5", "3.", ".5", "1e400", "07",
)  # fmt: skip
STRANGE_TEXTS = (
    "", " ", "\\u0000", "../../outside", "/etc/passwd", "../outside/canary", "x" * 300, "é", "日本",
    "%s%n", "{0}", "${HOME}", "$(id)", "a\\nb", "\\t", "true", "1", "nan", ".", "..", "/dev/zero",
    "/dev/stdin", "CON", "-rf", "--help", "\\ud800", "\U0001f916", "x" * 5000,
    *SIGNS, *(sign.encode("unicode_escape").decode().replace("\\x", "\\u00") for sign in SIGNS),
)  # fmt: skip
STRANGE_TOKENS = (
    "true", "false", "[]", "{}", "[[]]", "[1, 2]", "{ a = 1 }", '""', "1979-05-27", "07:32:00",
    "1979-05-27T07:32:00Z", "null", "[[[[1]]]]", '"1.0"', "[" * 60 + "]" * 60, "=", "#", '"', "'", ",",
)  # fmt: skip
STRANGE_BYTES = (
    b"\0", b"\xff", b"\xfe\xff", b"\xed\xa0\x80", b"\x0c", b"\x85", b"\xef\xbb\xbf", *map(str.encode, SIGNS)
)  # fmt: skip

_NUMBER = r"(?<![\w.])[-+]?\d[\d_]*(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])"
_VALUE = r"(?m)(?<==)[ \t]*(\"[^\"\n]*\"|\[[^\n]*\]|[^\s#\[\"]+)"
_TOKEN = re.compile(r"[A-Za-z_]\w*|[-+]?\d[\d.eE+-]*|[\[\]{}=,\"'#.]")


def raw_signs(text: str) -> list[str]:
    """The signs that a terminal or a reader may take for something else than they are."""
    return [sign for sign in text if category(sign) in {"Cc", "Cf", "Cs", "Zl", "Zp"} and sign != "\n"]


Mutation = Callable[[bytes, random.Random], bytes]


def flipped(data: bytes, draw: random.Random) -> bytes:
    """A few bytes replaced."""
    changed = bytearray(data)
    for _ in range(draw.choice((1, 1, 1, 2, 8))):
        if changed:
            changed[draw.randrange(len(changed))] = draw.randrange(256)
    return bytes(changed)


def inserted(data: bytes, draw: random.Random) -> bytes:
    """Bytes that belong in no text."""
    place = draw.randrange(len(data) + 1)
    return data[:place] + draw.choice(STRANGE_BYTES) + data[place:]


def cut(data: bytes, draw: random.Random) -> bytes:
    """The end, the beginning or a part lost."""
    first, second = sorted(draw.randrange(len(data) + 1) for _ in range(2))
    return draw.choice((data[:first], data[second:], data[:first] + data[second:]))


def other_encoding(data: bytes, draw: random.Random) -> bytes:
    """Other line ends, a byte order mark, another encoding."""
    text = data.decode("utf-8", "replace")
    marked = b"\xef\xbb\xbf" + data
    lines = (data.replace(b"\n", b"\r\n"), data.replace(b"\n", b"\r"), data.rstrip(b"\n"))
    others = (text.encode("utf-16"), text.replace("\n", "\u2028").encode(), marked, marked[:3] + marked)
    return draw.choice(lines + others)


def other_lines(data: bytes, draw: random.Random) -> bytes:
    """A line deleted, repeated, moved or exchanged with another."""
    lines = data.splitlines(keepends=True)
    if len(lines) < 2:
        return data
    first, second = draw.randrange(len(lines)), draw.randrange(len(lines))
    match draw.randrange(4):
        case 0:
            del lines[first]
        case 1:
            lines.insert(second, lines[first])
        case 2:
            lines[first], lines[second] = lines[second], lines[first]
        case 3:
            lines[first:first] = [lines[second]] * draw.choice((2, 30, 1000))
    return b"".join(lines)


def scaled_number(data: bytes, draw: random.Random) -> bytes:
    """A number a thousand times too large, negative, or a little off."""
    text = data.decode("utf-8", "replace")
    found = list(re.finditer(_NUMBER, text))
    if not found:
        return data
    one = draw.choice(found)
    number = float(one[0].replace("_", "")) * draw.choice((-1.0, 1e3, 1e-3, 1.1, 0.0, 1e5)) + draw.choice(
        (0, 0, 1)
    )
    token = f"{number:.0f}" if re.fullmatch(r"[-+]?\d+", one[0]) and draw.random() < 0.7 else repr(number)
    return f"{text[: one.start()]}{token}{text[one.end() :]}".encode()


def other_token(data: bytes, draw: random.Random) -> bytes:
    """A word, a number or a sign deleted, repeated or replaced."""
    text = data.decode("utf-8", "replace")
    found = list(_TOKEN.finditer(text))
    if not found:
        return data
    one, other = draw.choice(found), draw.choice(found)
    token = draw.choice(
        ("", one[0] * 2, other[0], one[0][::-1], one[0].upper(), draw.choice(STRANGE_TOKENS))
    )
    return f"{text[: one.start()]}{token}{text[one.end() :]}".encode()


def _one_replaced(pattern: str, tokens: Sequence[str], data: bytes, draw: random.Random) -> bytes:
    text = data.decode("utf-8", "replace")
    found = list(re.finditer(pattern, text))
    if not found:
        return data
    one = draw.choice(found)
    return f"{text[: one.start()]}{draw.choice(tokens)}{text[one.end() :]}".encode("utf-8", "surrogatepass")


other_number = partial(_one_replaced, _NUMBER, STRANGE_NUMBERS)
other_text = partial(_one_replaced, r'(?<=")[^"\n]*(?=")', STRANGE_TEXTS)
other_type = partial(_one_replaced, _VALUE, STRANGE_TOKENS + STRANGE_NUMBERS)
other_key = partial(_one_replaced, r"(?m)^[\w.]+(?= =)", [f'"{one}"' for one in STRANGE_TEXTS])
other_address = partial(
    _one_replaced, r'(?<=url = |ort = |ost = )"[^"\n]*"', [json.dumps(one) for one in ADDRESSES]
)


def other_cell(data: bytes, draw: random.Random) -> bytes:
    """A cell of a CSV file replaced, a column lost or repeated."""
    rows = [row.split(",") for row in data.decode("utf-8", "replace").splitlines()]
    if not rows:
        return data
    row = draw.choice(rows)
    place = draw.randrange(len(row))
    match draw.randrange(5):
        case 0:
            for each in rows:
                del each[min(place, len(each) - 1)]
        case 1:
            row.insert(place, draw.choice(STRANGE_NUMBERS))
        case 2:
            for each in rows[1:]:
                each[min(place, len(each) - 1)] = draw.choice(STRANGE_NUMBERS)
        case _:
            row[place] = draw.choice((*STRANGE_NUMBERS, "", "a", '"', "1;2", "1,5", "٣", *SIGNS))
    return "\n".join(",".join(each) for each in rows).encode()


ANY: tuple[Mutation, ...] = (flipped, inserted, cut, other_encoding, other_lines)
TOML: tuple[Mutation, ...] = (
    *ANY, other_number, other_number, other_number, scaled_number, scaled_number, other_text, other_type,
    other_type, other_token, other_key, other_address,
)  # fmt: skip
CSV: tuple[Mutation, ...] = (*ANY, other_number, scaled_number, other_cell, other_cell, other_lines)


def mutated(data: bytes, mutations: Sequence[Mutation], draw: random.Random) -> bytes:
    """The data after one mutation, now and then after a few."""
    for _ in range(draw.choice((1, 1, 1, 1, 2, 3))):
        data = draw.choice(mutations)(data, draw)
    return data
