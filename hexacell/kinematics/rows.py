"""Dataclasses whose fields all have n rows: arrays, and other such classes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar, Self

import numpy as np

from hexacell.kinematics.pose import Index


class Rows:
    """Some of the rows, and those of several in one; a base class of dataclasses."""

    __slots__ = ()
    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __len__(self) -> int:
        return len(getattr(self, next(iter(self.__dataclass_fields__))))

    def __getitem__(self, rows: Index | tuple[Index, Index]) -> Self:
        return type(self)(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @classmethod
    def concatenate(cls, parts: Iterable[Self]) -> Self:
        """The rows of several in one."""
        several = list(parts)
        joined: list[Any] = []
        for name in cls.__dataclass_fields__:
            column = [getattr(part, name) for part in several]
            is_array = isinstance(column[0], np.ndarray)
            joined.append(np.concatenate(column) if is_array else type(column[0]).concatenate(column))
        return cls(*joined)
