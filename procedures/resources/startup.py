"""Making the controller ready, and by whose word: the cell file's, a person's, or nobody's.

An emergency stop is a person's to reset. The program does it only before a run begins: of a controller
that has been in one since it was started, where the cell file says so, of any other where a person does.
One that came during a run is reset at the controller, however the run is continued. Switching on and homing
need the cell file's word or a person's.

A reload command may restart the controller, which is then in the emergency stop that it starts in. That is
the program's own doing, for which the cell file's word counts as well.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.errors import StartupNotPermitted
from drivers.interfaces import Controller, StartupAction, StartupActions
from hexacell.errors import Interruption
from procedures.guards.guards import Guards
from procedures.run.questions import YES, Operator, ask_startup
from procedures.run.state import RunState

_RESETS = frozenset({StartupAction.RESET_INITIAL_ESTOP, StartupAction.RESET_ESTOP})


@dataclass(eq=False)
class Startup:
    """What makes the controller of one run ready.

    Attributes:
        stated: what the cell file permits.
        may_have_begun: an order that could have ended its first emergency stop was given.
    """

    controller: Controller
    guards: Guards
    operator: Operator
    stated: StartupActions
    may_have_begun: bool = False

    async def prepare(self, state: RunState) -> None:
        """Make it ready to move.

        Raises:
            AnswerNeeded: a person must permit something, or do it, and there is none.
            Interruption: a person did not permit it.
            HexacellError: it cannot be made ready, or a guard tripped.
        """
        is_during_run = self.may_have_begun or state.is_in_estop
        await self._prepare_asking(_RESETS if is_during_run else frozenset())

    async def reload(self) -> None:
        """Make it reload its config, and make sure that it did; raises as :meth:`prepare` does."""
        try:
            await self.guards.while_not_ready(lambda: self.controller.reload(self.stated))
        except StartupNotPermitted:
            await self._prepare_asking(frozenset({StartupAction.RESET_ESTOP}))
        await self.guards.require_reloaded()

    async def _prepare_asking(self, theirs: StartupActions) -> None:
        """Make it ready; ``theirs`` is what a person does, and this program never."""
        granted: StartupActions = frozenset()
        while True:
            try:
                await self._prepare((self.stated | granted) - theirs)
            except StartupNotPermitted as refusal:
                granted |= await self._permitted(refusal, is_theirs=refusal.needed in theirs)
            else:
                return

    async def _prepare(self, permitted: StartupActions) -> None:
        async def order() -> None:
            try:
                await self.controller.prepare(permitted)
            except StartupNotPermitted:
                raise
            except BaseException:
                self.may_have_begun = True
                raise
            self.may_have_begun = True

        await self.guards.prepare(order)

    async def _permitted(self, refusal: StartupNotPermitted, *, is_theirs: bool) -> StartupActions:
        """What a person permits; nothing where that person has done it."""
        question = ask_startup(refusal.needed, str(refusal), is_theirs=is_theirs)
        if await self.operator.ask(question) != YES:
            raise Interruption(f"{refusal}, which was left as it is")
        return frozenset() if is_theirs else frozenset({refusal.needed})
