"""`PageError`: why the server does not do what a message of the page requests."""

from __future__ import annotations

from typing import Literal

from gcsplan.errors import InputError

PageCode = Literal[
    "bad_message", "bad_change", "bad_mission", "changed_on_disk", "exists", "not_saved", "taken_over", "internal"
]


class PageError(InputError):
    """A message of the page that is not followed; ``code`` says the kind, as the page knows it."""

    def __init__(self, message: str, *, code: PageCode, where: str = "") -> None:
        super().__init__(message, where=where)
        self.code = code
