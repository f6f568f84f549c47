"""How a recording shows itself: in one line, and in a notebook as what `pomona info` says."""

from __future__ import annotations

from pomona.amounts import amount
from pomona.cards import as_card
from pomona.recording.frame import Recording

__all__ = ["RecordingCard"]


class RecordingCard:
    """Whoever derives from it is a `Recording` and is shown by what it holds, not by its arrays."""

    def __repr__(self: Recording) -> str:
        found = self.description()
        pictures = " and ".join(found["pictures"])
        poses = "with poses" if found["poses"] else "no poses"
        size = f"{found['width']}x{found['height']}"
        return f"{type(self).__name__}({str(self.path)!r}: {amount(len(self), 'frame')} of {size}, {pictures}, {poses})"

    def _repr_html_(self: Recording) -> str:
        found = self.description()
        pictures = ", ".join(f"{count} {kind}" for kind, count in found["pictures"].items())
        return as_card(self.name, {**{name: _shown(value) for name, value in found.items()}, "pictures": pictures})


def _shown(value: object) -> object:
    return "-" if value is None else f"{value:g}" if isinstance(value, float) else value
