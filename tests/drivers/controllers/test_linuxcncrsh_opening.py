"""Opening: who answers, and what is said when it is not linuxcncrsh."""

from __future__ import annotations

import asyncio
import socket

import pytest

