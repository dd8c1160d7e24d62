"""Between the program and the disk: every call that changes files in a folder, seen and spoilt.

What Python programs do to files goes through a dozen functions of ``os`` and through ``open``. While
:func:`intercepted` lasts, each of them asks a hook first. The hook may write the call down, let it
fail with an ``errno``, let it do half its work, or end the process there and then.
"""

from __future__ import annotations

import builtins
import io
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
BY_PATH = ("mkdir", "unlink", "rmdir", "replace", "rename", "link", "symlink")
BY_DESCRIPTOR = ("fsync", "fdatasync", "ftruncate", "fchmod", "fchown")


@dataclass(frozen=True)
class Call:
    """One call that changes a file or makes a change last.

    Attributes:
        name: of the function; ``open`` only where it may write.
        path: what it concerns, ``other`` where to, for a renaming.
        data: what is written.
        length: of the file after a truncation.
    """

    name: str
    path: str
    other: str = ""
    data: bytes = b""
    length: int = 0


Hook = Callable[[Call], Exception | None]
"""Asked before each call; what it returns is raised after half of the data is written, if any."""


@contextmanager
def intercepted(folder: Path, hook: Hook) -> Iterator[None]:
    """Ask ``hook`` before each call that changes anything in ``folder``; others pass."""
    patches = _Patches(os.path.realpath(folder), hook)
    patches.make()
    try:
        yield
    finally:
        patches.undo()


@dataclass
class Failing:
    """A hook that counts the calls, and fails ``width`` of them (all, if none) from number ``at`` on.

    Attributes:
        error: with this ``errno``; none to end the process instead, without a word.
        only: calls that do not concern a path with these words in it are not counted.
    """

    at: int | None = None
    width: int | None = None
    error: int | None = None
    only: str = ""
    calls: list[Call] = field(default_factory=list)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __call__(self, call: Call) -> Exception | None:
        if self.only not in call.path + call.other:
            return None
        with self._lock:
            number = len(self.calls)
            self.calls.append(call)
        if self.at is None or number < self.at or (self.width and number >= self.at + self.width):
            return None
        if self.error is None:
            os.kill(os.getpid(), signal.SIGKILL)
        return OSError(self.error or 0, os.strerror(self.error or 0))


class _Patches:
    """Replacements of the functions that change files."""

    def __init__(self, folder: str, hook: Hook) -> None:
        self._folder = folder
        self._hook = hook
        self._real: list[tuple[Any, str, Any]] = []

    def make(self) -> None:
        for name in BY_PATH:
            self._replace(os, name, self._by_path(name, getattr(os, name)))
        for name in BY_DESCRIPTOR:
            self._replace(os, name, self._by_descriptor(name, getattr(os, name)))
        for name in ("write", "pwrite"):
            self._replace(os, name, self._writing(getattr(os, name)))
        self._replace(os, "open", self._opening(os.open))
        for module in (builtins, io):
            self._replace(module, "open", self._opening_stream(io.open))

    def undo(self) -> None:
        for module, name, real in reversed(self._real):
            setattr(module, name, real)

    def _replace(self, module: Any, name: str, replacement: Any) -> None:
        self._real.append((module, name, getattr(module, name)))
        setattr(module, name, replacement)

    def _ask(self, call: Call) -> Exception | None:
        """Only what is in the folder is anybody's concern."""
        concerned = (call.path, call.other)
        return self._hook(call) if any(path.startswith(self._folder) for path in concerned) else None

    def _tell(self, call: Call) -> None:
        if error := self._ask(call):
            raise error

    def _by_path(self, name: str, real: Any) -> Any:
        def call(path: Any, *others: Any, **more: Any) -> Any:
            other = _absolute(others[0]) if name in {"replace", "rename", "link", "symlink"} else ""
            self._tell(Call(name, _absolute(path), other))
            return real(path, *others, **more)

        return call

    def _by_descriptor(self, name: str, real: Any) -> Any:
        def call(descriptor: int, *others: Any) -> Any:
            length = others[0] if name == "ftruncate" else 0
            self._tell(Call(name, _path_of(descriptor), length=length))
            return real(descriptor, *others)

        return call

    def _writing(self, real: Any) -> Any:
        def call(descriptor: int, data: bytes, *others: Any) -> Any:
            if error := self._ask(Call("write", _path_of(descriptor), data=bytes(data))):
                real(descriptor, data[: len(data) // 2], *others)
                raise error
            return real(descriptor, data, *others)

        return call

    def _opening(self, real: Any) -> Any:
        def call(path: Any, flags: int, *others: Any, **more: Any) -> Any:
            if flags & WRITING:
                self._tell(Call("open", _absolute(path)))
            return real(path, flags, *others, **more)

        return call

    def _opening_stream(self, real: Any) -> Any:
        def call(path: Any, mode: str = "r", *others: Any, **more: Any) -> Any:
            if not set(mode) & set("wax+") or isinstance(path, int):
                return real(path, mode, *others, **more)
            if "opener" not in more:
                self._tell(Call("open", _absolute(path)))
            stream = real(path, mode, *others, **more)
            if _absolute(path).startswith(self._folder):
                return _Stream(stream, self._ask, _absolute(path))
            return stream

        return call


class _Stream:
    """An open file whose writing is asked for too; everything else is the file's own."""

    def __init__(self, stream: Any, ask: Hook, path: str) -> None:
        self._stream, self._ask, self._path = stream, ask, path

    def write(self, data: Any) -> int:
        written = data.encode() if isinstance(data, str) else bytes(data)
        if error := self._ask(Call("write", self._path, data=written)):
            self._stream.write(data[: len(data) // 2])
            raise error
        return int(self._stream.write(data))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def __enter__(self) -> _Stream:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()


def _absolute(path: Any) -> str:
    """A path from the root, folders' links followed, its own not."""
    name = Path(os.fsdecode(path))
    return str(name.parent.resolve() / name.name)


def _path_of(descriptor: int) -> str:
    with suppress(OSError):
        return str(Path(f"/proc/self/fd/{descriptor}").readlink())
    return ""
