"""The steps of a run, those that belong together in one file: data, events, effects, changes, words.

``registry.py`` lists them, ``docs/add-a-step.md`` describes how one is added.
"""
