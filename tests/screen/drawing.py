"""Whether an application has drawn all that it was told."""

from textual.app import App
from textual.widget import Widget

MARKS = ("layout", "repaint", "scroll", "recompose", "refresh_styles")


def is_all_drawn(app: App[int]) -> bool:
    """Whether no message waits anywhere, and nothing is marked to be composed, styled or drawn.

    What lies below the screen in front stays marked until it is in front again.
    """
    front, *below = [screen.walk_children(Widget, with_self=True) for screen in reversed(app.screen_stack)]
    is_marked = any(getattr(widget, f"_{mark}_required") for widget in front for mark in MARKS)
    waits = any(
        widget.message_queue_size or widget._pending_message or widget._next_callbacks
        for widgets in (front, *below)
        for widget in widgets
    )
    return not (app.message_queue_size or app.screen._dirty_widgets or is_marked or waits)
