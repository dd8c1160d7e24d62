"""SDO requests that can be interrupted, and that notice a second device answering."""

from __future__ import annotations

from canopen.objectdictionary import ObjectDictionary
from canopen.sdo.client import SdoClient

from drivers.encoders.bus import EncoderBus

SDO_REQUEST = 0x600
SDO_ANSWER = 0x580
_UPLOAD_DEVICE_TYPE = bytes((0x40, 0x00, 0x10, 0, 0, 0, 0, 0))


class CountingSdoClient(SdoClient):
    """canopen's SDO client, waiting on the bus's terms and counting requests and answers.

    ``surplus`` is set once there were more answers than requests: two devices share the node id.
    ``answered`` says whether anybody ever answered.
    """

    RESPONSE_TIMEOUT = 0.0  # the wait has happened before canopen looks

    def __init__(self, bus: EncoderBus, node: int, timeout_s: float) -> None:
        dictionary = ObjectDictionary()  # type: ignore[no-untyped-call]
        super().__init__(SDO_REQUEST + node, SDO_ANSWER + node, dictionary)  # type: ignore[no-untyped-call]
        self.network = bus.network
        self.surplus = False
        self.answered = False
        self._bus = bus
        self._timeout_s = timeout_s
        self._owed = 0
        bus.network.subscribe(self.tx_cobid, self.on_response)

    def probe(self) -> None:
        """Ask for the device type without waiting; the answer shows in ``answered``."""
        self._owed += 1
        self.send_request(_UPLOAD_DEVICE_TYPE)  # type: ignore[no-untyped-call]

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Take an answer that came in; too short a frame is none."""
        if len(data) != 8:
            return
        self.answered = True
        self._owed -= 1
        self.surplus = self.surplus or self._owed < 0
        super().on_response(can_id, data, timestamp)  # type: ignore[no-untyped-call]
        self._bus.news.notify_all()

    def request_response(self, sdo_request: bytes) -> bytes:
        """Send one request and return its answer, once no earlier answer is under way.

        Raises:
            DeviceError: As :meth:`EncoderBus.check`.
            canopen.SdoError: No answer, an abort, or nonsense.
        """
        self._bus.wait_for(lambda: self._owed <= 0, self._timeout_s)
        with self._bus.news:
            self._owed = 1
        answer: bytes = super().request_response(sdo_request)  # type: ignore[no-untyped-call]
        return answer

    def read_response(self) -> bytes:
        """Wait for the answer in bounded slices.

        Raises:
            DeviceError: As :meth:`EncoderBus.check`.
            canopen.SdoError: No answer, or an abort.
        """
        self._bus.wait_for(lambda: not self.responses.empty(), self._timeout_s)
        answer: bytes = super().read_response()  # type: ignore[no-untyped-call]
        return answer
