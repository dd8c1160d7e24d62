"""How good a solution is: accuracy, correlation, tolerances, repeatability, variances."""
