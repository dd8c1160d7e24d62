"""The conformance tests as a class that pytest collects in the tests of a package."""

from __future__ import annotations

from typing import ClassVar

from hexacell.conformance.example import MechanismExample
from hexacell.conformance.frame_checks import (
    check_changes_of_frames,
    check_identifiable,
    check_normal_form,
    check_rules,
)
from hexacell.conformance.identification_checks import check_identification
from hexacell.conformance.kinematics_checks import (
    check_batches,
    check_derivatives,
    check_encoder_zeros,
    check_forward,
    check_inverse,
    check_legs,
    check_lengths,
)


class MechanismConformance:
    """The tests of one mechanism.

    Subclass it in a test module, with an ``example``::

        class TestMine(MechanismConformance):
            example = MechanismExample(Mine(), drawing, branch=(), points=points, tolerances={"base": 1.0})

    Each test raises ``AssertionError`` with what does not agree.
    """

    example: ClassVar[MechanismExample]

    def test_the_inverse_closes_every_leg(self) -> None:
        """On its branch; out of reach it is NaN."""
        check_inverse(self.example)

    def test_constraints_are_lengths(self) -> None:
        """In mm of the leg's error."""
        check_lengths(self.example)

    def test_derivatives_are_those_of_the_constraints(self) -> None:
        """By pose, joint variables and every parameter."""
        check_derivatives(self.example)

    def test_forward_and_inverse_agree(self) -> None:
        """For robots within the tolerances."""
        check_forward(self.example)

    def test_encoder_zeros_are_changes_of_parameters(self) -> None:
        """Which one level of identification leaves to them alone."""
        check_encoder_zeros(self.example)

    def test_batches_of_geometries(self) -> None:
        """Each pose has its own."""
        check_batches(self.example)

    def test_legs_in_space(self) -> None:
        """Platform joints, the platform's radius, guides."""
        check_legs(self.example)

    def test_the_rules_take_as_many_numbers_as_the_frames_are_free(self) -> None:
        """Each rule once."""
        check_rules(self.example)

    def test_the_convention_is_idempotent(self) -> None:
        """And finds its frames from any others."""
        check_normal_form(self.example)

    def test_changes_of_frames_change_no_machine(self) -> None:
        """Joint variables are the same at the same poses."""
        check_changes_of_frames(self.example)

    def test_the_free_parameters_are_those_that_poses_determine(self) -> None:
        """No fewer and no more."""
        check_identifiable(self.example)

    def test_exact_records_are_identified(self) -> None:
        """To a nanometre."""
        check_identification(self.example)
