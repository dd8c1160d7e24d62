"""The messages for people that the program's source has: errors, rules of the cell file, guards."""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
GAP = "…"
"""Stands for what a message says of the case at hand: a name, a number."""


@dataclass(frozen=True)
class Message:
    """A message for people: what is wrong, and what to do, as far as the program's text says it."""

    kind: str
    problem: str
    action: str


HEADINGS = {
    "HexacellError": "The command, a file or the plan",
    "LimitError": "Limits and data",
    "ConvergenceError": "Limits and data",
    "IdentifiabilityError": "Limits and data",
    "DeviceError": "Devices and links",
    "AnswerNeeded": "A person is needed",
    "CellBusy": "The cell is in use, or it is not the time",
    "Interruption": "The cell is in use, or it is not the time",
    "OutOfTime": "The cell is in use, or it is not the time",
    "WriteBackUndone": "The write was undone",
    "Trip": "Guards that stop the robot",
    "broken_rule": "Keys of the cell file",
}
"""The headings, by the nearest base class of an error."""


@cache
def raised_messages() -> tuple[Message, ...]:
    """The messages of all errors, rules of the cell file and guards, as the source has them."""
    trees = [
        ast.parse(path.read_text(encoding="utf-8"))
        for package in ("hexacell", "drivers", "procedures")
        for path in sorted((ROOT / package).rglob("*.py"))
        if not {"simulated", "study", "conformance", "replay"} & set(path.parts)
    ]
    bases = {
        node.name: [base.id for base in node.bases if isinstance(base, ast.Name)]
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    }
    found = [message for tree in trees for message in _messages_in(tree, bases)]
    return tuple(dict.fromkeys(found))


def _messages_in(tree: ast.Module, bases: dict[str, list[str]]) -> Iterator[Message]:
    for scope in ast.walk(tree):
        if not isinstance(scope, ast.FunctionDef | ast.AsyncFunctionDef | ast.Module):
            continue
        names = _assigned_texts(scope)
        for node in _within(scope):
            if isinstance(node, ast.Call) and (kind := _heading(_called(node), bases)):
                yield from _message(node, kind, names)


def _within(scope: ast.AST) -> Iterator[ast.AST]:
    """The nodes of a function without those of the functions in it."""
    for node in ast.iter_child_nodes(scope):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node
            yield from _within(node)


def _assigned_texts(scope: ast.AST) -> dict[str, list[str]]:
    names: dict[str, list[str]] = {}
    for node in _within(scope):
        match node:
            case (
                ast.Assign(targets=[ast.Name(name)], value=value)
                | ast.AnnAssign(target=ast.Name(name), value=ast.expr() as value)
                | ast.NamedExpr(target=ast.Name(name), value=value)
            ):
                names.setdefault(name, []).extend(_texts(value, {}))
    return names


def _called(node: ast.Call) -> str:
    return node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")


def _heading(name: str, bases: dict[str, list[str]]) -> str | None:
    """Under which heading a class or function that makes messages belongs; None for all others."""
    if name in {"SeveralErrors", "GuardTripped", "RobotNotStopped"}:
        return None
    if name in HEADINGS:
        return HEADINGS[name]
    return next(filter(None, (_heading(base, bases) for base in bases.get(name, ()))), None)


def _message(node: ast.Call, kind: str, names: dict[str, list[str]]) -> Iterator[Message]:
    positional = list(node.args)
    actions = [keyword.value for keyword in node.keywords if keyword.arg == "action"]
    match _called(node):
        case "broken_rule":
            actions += positional[1:2]
        case "Trip":
            actions += positional[3:4]
            positional = positional[2:3]
        case "CommandRefused" | "MoveRefused" | "PoseRefused":
            return  # its words are the controller's own
    problems = _texts(positional[0], names) if positional else []
    for problem in problems:
        if re.search(r"[a-z]{3}", problem):
            action = " / ".join(_texts(actions[0], names)) if actions else ""
            yield Message(kind, problem, action if action.strip(f"{GAP} ") else "")


def _texts(node: ast.expr, names: dict[str, list[str]]) -> list[str]:
    """The texts that an expression may be, with a gap for what is only known while it runs."""
    match node:
        case ast.Constant(value=str(text)):
            return [text]
        case ast.IfExp():
            return _texts(node.body, names) + _texts(node.orelse, names)
        case ast.JoinedStr():
            return ["".join(part.value if isinstance(part, ast.Constant) else GAP for part in node.values)]
        case ast.BinOp(op=ast.Add()):
            lefts, rights = _texts(node.left, names), _texts(node.right, names)
            return [left + right for left in lefts for right in rights]
        case ast.Name() if names.get(node.id):
            return names[node.id]
        case _:
            return [GAP]
