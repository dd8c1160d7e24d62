"""Random TOML texts in all kinds of layouts, and the places in them."""

from typing import Any

from hexacell.storage.toml_document import KeyPath


def leaves(node: Any, path: KeyPath = ()) -> dict[KeyPath, Any]:
    """Every value in what tomllib read, tables and arrays included, by its path."""
    found = {path: node} if path else {}
    if isinstance(node, dict):
        for key, child in node.items():
            found |= leaves(child, (*path, key))
    if isinstance(node, list):
        for index, child in enumerate(node):
            found |= leaves(child, (*path, index))
    return found
