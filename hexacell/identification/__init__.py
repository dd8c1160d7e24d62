"""Identification: from records to a geometry with its covariance."""
