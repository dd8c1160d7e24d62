"""Serial ports: one owner, bounded waits, a trace of every byte."""
