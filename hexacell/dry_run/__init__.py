"""A plan carried out on virtual robots before anything moves: records, time, probable verdicts."""
