"""Regularized weighted least squares: from a problem to a geometry with its covariance."""
