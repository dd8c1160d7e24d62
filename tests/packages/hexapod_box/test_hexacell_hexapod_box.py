"""The driver passes what every controller must: the whole test of such a package."""

from collections.abc import Iterator
from contextlib import contextmanager

from hexacell_hexapod_box import HexapodBox
from hexacell_hexapod_box_twin import HexapodBoxTwin

from drivers.conformance import ControllerConformance, ControllerTwin
from drivers.interfaces import Controller
from hexacell.cell.robot import ControllerSettings


class TestHexapodBox(ControllerConformance):
    def driver(self, settings: ControllerSettings) -> Controller:
        controller: Controller = HexapodBox(settings)
        return controller

    @contextmanager
    def twin(self) -> Iterator[ControllerTwin]:
        with HexapodBoxTwin() as twin:
            yield twin
            twin.shutdown()
