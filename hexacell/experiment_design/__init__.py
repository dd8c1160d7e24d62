"""Which pose to measure next: candidates, predicted records, criteria, selection."""
