"""The encoders pass what all encoders must: the whole test of such a package."""

from collections.abc import Iterator
from contextlib import contextmanager

from hexacell_scale_box import ScaleBox
from hexacell_scale_box_twin import ScaleBoxTwin

from drivers.conformance import EncoderConformance, EncoderTwin
from drivers.interfaces import EncoderBank


class TestScaleBox(EncoderConformance):
    def driver(self, twin: EncoderTwin) -> EncoderBank:
        bank: EncoderBank = ScaleBox(twin.settings)
        return bank

    @contextmanager
    def twin(self) -> Iterator[EncoderTwin]:
        with ScaleBoxTwin() as twin:
            yield twin
            twin.shutdown()
