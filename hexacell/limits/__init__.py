"""The limits of motion: what may be commanded, what passive joints and legs allow, the gauges' travel."""
