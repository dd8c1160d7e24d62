"""The technician's screen: a Textual application over a run, a cell and its history.

It draws views that :mod:`hexacell.text.screens` makes and passes on what is pressed. Modules that
the first screen needs import neither numpy nor pydantic: those load behind it.
"""
