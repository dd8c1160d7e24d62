"""What a robot is: six constraints, one a leg, and their derivatives."""
