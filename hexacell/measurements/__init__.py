"""Records of joint variables and deviations, in memory and as CSV."""
