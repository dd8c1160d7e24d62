"""How much work is put into the search for poses and into trying a plan out before anything moves."""

from dataclasses import dataclass

from hexacell.design.candidate_refinement import QUICK, THOROUGH, Rounds


@dataclass(frozen=True, slots=True)
class SearchEffort:
    """The effort of searching; the defaults are those of the program, tests of other things have less.

    Numbers of candidates are powers of two: a Sobol' sequence is even over no other number.

    Attributes:
        candidates: orientations that the pose of each record is chosen from; likewise for other poses.
        pilot_candidates: with four times as many the records are as good.
        planned_candidates: orientations that the sets of a forecast are chosen from, beside which records
            have to gain.
        forecast_held_out_candidates: how wide held-out poses are hardly changes with more.
        checked_candidates: orientations among which preflight looks for any safe pose at a point.
        checked_robots: robots within the tolerances that preflight asks whether they reach the points.
        dry_run_robots: robots that a plan is carried out on to say what it gives.
        rounds: in which the best candidates are refined; ``late_rounds`` from ``late_records`` on, and of
            ``late_candidates``, so that the decisions with most records to fit take no longer.
    """

    candidates: int = 2048
    pilot_candidates: int = 256
    held_out_candidates: int = 2048
    planned_candidates: int = 128
    forecast_held_out_candidates: int = 256
    checked_candidates: int = 128
    checked_robots: int = 32
    dry_run_robots: int = 2
    rounds: Rounds = THOROUGH
    late_rounds: Rounds = QUICK
    late_candidates: int = 512
    late_records: int = 44

    def refinement(self, records: int) -> Rounds:
        """The rounds of refinement of a decision that is made after some records."""
        return self.late_rounds if records >= self.late_records else self.rounds

    def considered(self, records: int, *, is_well_known: bool) -> int:
        """How many candidates such a decision considers.

        The best are refined: more are needed only where the robot is not well known, and few of them safe.
        """
        if not is_well_known:
            return self.candidates
        usual = self.candidates // 2
        return min(usual, self.late_candidates) if records >= self.late_records else usual


USUAL_EFFORT = SearchEffort()
"""The effort of the program."""
