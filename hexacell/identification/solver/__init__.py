"""The solver: regularized weighted least squares by Levenberg-Marquardt."""
