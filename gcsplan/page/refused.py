"""`PageError`: why the server does not do what a message of the page requests; and why there is no server."""

from __future__ import annotations

from typing import Literal

from gcsplan.errors import InputError

PageCode = Literal[
    "bad_message", "bad_change", "bad_mission", "bad_file", "bad_text", "changed_on_disk", "exists", "file_exists",
    "not_saved", "taken_over", "internal", "not_sent"
]  # fmt: skip


class PageError(InputError):
    """A message of the page that is not followed; ``code`` says the kind, as the page knows it."""

    def __init__(self, message: str, *, code: PageCode, where: str = "") -> None:
        super().__init__(message, where=where)
        self.code = code


def not_installed(package: str | None) -> InputError:
    """The error of a package of the extra `map` that is absent, with its cure."""
    return InputError(
        f"the map needs {package}, which is not installed: pip install 'gcsplan[map]'", where="gcsplan map"
    )
