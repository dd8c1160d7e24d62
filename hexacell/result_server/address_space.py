"""The nodes of the server: the latest results of a cell, and the event of a new one.

Names, meanings and values are those of OPC 40001-101 (Machinery, Result Transfer), 1.00: ResultManagement
with its Results, ResultMetaData, ResultReadyEventType. They are in a namespace of their own, because the
types of that specification, its structured data types and its methods among them, are not all here.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from asyncua import ua

from hexacell.result_server.published_result import SEVERITIES, PublishedResult

if TYPE_CHECKING:
    from asyncua.common.node import Node
    from asyncua.server.event_generator import EventGenerator
    from asyncua.server.server import Server

NAMESPACE = "urn:hexacell:results"
MOST_RESULTS = 10
"""Results of a cell in the address space; older ones are in its run folders."""

FIELDS = (
    ("ResultId", ua.VariantType.String),
    ("IsSimulated", ua.VariantType.Boolean),
    ("ResultState", ua.VariantType.Int32),
    ("CreationTime", ua.VariantType.DateTime),
    ("ResultEvaluation", ua.VariantType.Int32),
    ("ResultEvaluationDetails", ua.VariantType.String),
    ("Mode", ua.VariantType.String),
    ("Verdict", ua.VariantType.String),
    ("PositionErrorMm", ua.VariantType.Double),
    ("ExpandedUncertaintyMm", ua.VariantType.Double),
    ("LimitMm", ua.VariantType.Double),
)
META_DATA = 6
"""The first fields are those of ResultMetaData, the others those of ResultContent."""


class ResultNodes:
    """The results of one cell in the address space of a server."""

    def __init__(self, namespace: int, management: Node, results: Node, event: EventGenerator) -> None:
        self._namespace = namespace
        self._management = management
        self._results = results
        self._event = event
        self._shown: deque[Node] = deque()

    @classmethod
    async def of(cls, server: Server, cell: str) -> ResultNodes:
        """Make the nodes of a cell: Objects / its name / ResultManagement / Results."""
        namespace = await server.register_namespace(NAMESPACE)
        event_type = await server.create_custom_event_type(
            namespace, "ResultReadyEventType", properties=list(FIELDS)
        )
        of_cell = await server.nodes.objects.add_object(namespace, cell)
        management = await of_cell.add_object(namespace, "ResultManagement")
        results = await management.add_folder(namespace, "Results")
        event = await server.get_event_generator(event_type, emitting_node=management.nodeid)
        return cls(namespace, management, results, event)

    async def show(self, result: PublishedResult) -> None:
        """Add a result as the newest; the oldest goes where there are too many."""
        node = await self._results.add_object(self._namespace, result.result_id)
        meta = await node.add_object(self._namespace, "ResultMetaData")
        content = await node.add_object(self._namespace, "ResultContent")
        for number, ((name, kind), value) in enumerate(zip(FIELDS, _values(result), strict=True)):
            parent = meta if number < META_DATA else content
            await parent.add_variable(self._namespace, name, value, varianttype=kind)
        self._shown.append(node)
        while len(self._shown) > MOST_RESULTS:
            oldest = ua.DeleteNodesItem(self._shown.popleft().nodeid, DeleteTargetReferences=True)
            await self._event.isession.delete_nodes(ua.DeleteNodesParameters([oldest]))

    async def notify(self, result: PublishedResult) -> None:
        """Raise the event of a result that is ready."""
        event = self._event.event
        event.Severity = SEVERITIES[result.evaluation]
        for (name, _), value in zip(FIELDS, _values(result), strict=True):
            setattr(event, name, value)
        await self._event.trigger(message=result.details)


def _values(result: PublishedResult) -> tuple[object, ...]:
    """The values of a result, in the order of ``FIELDS``."""
    return (
        result.result_id,
        result.is_simulated,
        int(result.state),
        result.created,
        int(result.evaluation),
        result.details,
        result.mode,
        result.verdict,
        result.position_mm,
        result.expanded_mm,
        result.limit_mm,
    )
