"""Whether an application has drawn all that it was told."""

from textual.app import App
from textual.screen import Screen
from textual.widget import Widget


def is_all_drawn(app: App[int]) -> bool:
    """Whether no message waits anywhere, and nothing is marked to be composed, styled or drawn.

    What lies below the screen in front stays marked until it is in front again.
    """
    front = app.screen
    is_quiet = app.message_queue_size == 0 and not any(map(_has_messages, app.screen_stack))
    return is_quiet and not front._dirty_widgets and not any(map(_is_marked, _widgets(front)))


def _widgets(screen: Screen[object]) -> list[Widget]:
    return list(screen.walk_children(Widget, with_self=True))


def _has_messages(screen: Screen[object]) -> bool:
    return any(
        widget.message_queue_size or widget._pending_message or widget._next_callbacks
        for widget in _widgets(screen)
    )


def _is_marked(widget: Widget) -> bool:
    return (
        widget._layout_required
        or widget._repaint_required
        or widget._scroll_required
        or widget._recompose_required
        or widget._refresh_styles_required
    )
