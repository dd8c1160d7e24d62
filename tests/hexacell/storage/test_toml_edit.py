"""Only the numbers asked for change."""

import tomllib
from collections.abc import Mapping

import pytest

from hexacell.storage.toml_document import KeyPath, TomlDocument
from tests.hexacell.storage.toml_texts import leaves

LAYOUTS = {
    "table": "[g]\na = [1, 2] # 1, 2\nb = 3\n",
    "CRLF": "[g]\r\na = [1,\r\n 2]\r\n\r\nb = 3\r\n",
    "mixed line ends": "[g]\r\na = [1,\n 2]\nb = 3\r\n",
    "byte order mark": "\ufeff[g]\na = [1, 2]\nb = 3\n",
    "no final newline": "[g]\na = [1, 2]\nb = 3",
    "blanks at the end": "[g]\na = [1, 2]\nb = 3 \t",
    "inline table": "g = { a = [1 , 2], b=3 } # 1, 2, 3\n",
    "inline table, arrays over lines": "g = {a=[\n1,\n 2 # 2\n,], b = 3}\n",
    "dotted keys": "g.a = [1, 2]\ng . b=3\n",
    "dotted keys with others between": "g.a = [1, 2]\nx = 1\ng.b = 3\ny = 2\n",
    "quoted keys": '["g"]\n\'a\' = [1, 2]\n"b" = 3\n',
    "comments in lists": "[g]\na = [ # 1, 2]\n 1 # 1\n , # 2\n # 2\n 2, # 3\n # 4\n]\nb = 3\n",
    "odd blanks": "\n\t [ g ]\t\n\ta\t= [\t1\t,2  ]  \n  b=3\n\n\n",
    "no blanks": "[g]\na=[1,2]\nb=3",
    "spellings": "[g]\na = [0x1F, 1_000.5e-0_1]\nb = +7E+2\nx = [0b1_1, 0o17, -0.0, 1_0, nan, -inf]\n",
    "not ASCII": "# Längen in µm\n'µ' = \"\\u00e4ä😀\"\n[g]\na = [1, 2] # é\nb = 3\n",
    "table in pieces": "[g]\na = [1, 2]\n[x]\ny = 1\n[g.z]\nb = 3\n[x.w]\n[g.v]\nu = 1\n",
    "arrays of tables": "[[t]]\nn = 1\n[[t]]\nn = 2\n[t.s]\nm = [1]\n[g]\na = [1, 2]\nb = 3\n",
    "tables of an array apart": "[[t]]\nn = 1\n[g]\na = [1, 2]\n[[t]]\nn = 2\n",
    "date in a list": "[g]\na = [1, 2]\nd = [ 1979-05-27 07:32:00 ]\n",
    "deep list": f"[g]\na = 1\nd = {'[' * 101}2{']' * 101}",
    "strings": "s = '''\n[g]\na = [1, 2]\n'''\nt = \"\"\"\nb = 3\\\n \"\"\"\n[g]\na = [1, 2]\nb = 3\n",
}


def replaced(text: str, tokens: Mapping[KeyPath, str]) -> str:
    return TomlDocument.parse(text).replaced(tokens)


def numbers(text: str) -> dict[KeyPath, int | float]:
    """Every number in the text."""
    found = leaves(tomllib.loads(text.removeprefix("\ufeff")))
    return {
        path: value
        for path, value in found.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }


@pytest.mark.parametrize("text", LAYOUTS.values(), ids=LAYOUTS)
def test_every_number_alone_can_be_replaced_and_restored(text: str) -> None:
    assert replaced(text, {}) == text
    for path in numbers(text):
        changed = replaced(text, {path: "4711.5"})
        before, _, after = changed.partition("4711.5")
        assert text.startswith(before)
        assert text.endswith(after)
        old = text.removeprefix(before).removesuffix(after)
        assert repr(tomllib.loads(f"x = {old}")["x"]) == repr(numbers(text)[path])
        assert replaced(changed, {path: old}) == text
