"""The steps of a run, one a file: its data, its events, what it does, what it changes, how it reads.

``events.py`` lists them, ``docs/add-a-step.md`` describes how one is added.
"""
