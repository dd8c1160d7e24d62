"""Servers on loopback are reached at once, and again at once where they refuse."""

import pytest


@pytest.fixture(autouse=True)
def reached_at_once(monkeypatch):
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    monkeypatch.setattr("hexacell.services.unattended.delivery.PAUSES_S", (0.0, 0.0))
