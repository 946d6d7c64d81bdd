"""`MissionStore`: the mission file on the disk, and the unsaved edits that are kept beside it.

A file that another program changed is never overwritten without the user's choice. Unsaved edits lie in a file of
their own, so that the end of the server, however it comes, loses none that is older than a second.
"""

from __future__ import annotations

import hashlib
import json
import re
from contextlib import suppress
from pathlib import Path
from typing import Literal

from gcsplan.errors import GcsplanError, InputError
from gcsplan.export.durable import write_whole
from gcsplan.mission_file.changes import saved_text
from gcsplan.mission_file.source import read_content
from gcsplan.mission_file.values.yaml import MAX_YAML_BYTES
from gcsplan.page.history import EditedDocument, plain_date
from gcsplan.page.refused import PageError

Disk = Literal["same", "changed", "gone"]

UNNAMED_FILE = "mission.yaml"
"""The name of a mission that has no file yet."""

EDITS, UNNAMED_EDITS = ".{}.edits", ".unnamed.edits"
"""The files of unsaved edits: by the name of the mission's file, and of a mission that has no file yet."""

MOST_EDITS_BYTES = 4 * MAX_YAML_BYTES
"""Most bytes of a file of edits that is read: JSON of the largest mission."""

_FILE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_. -]{0,95}\.ya?ml")


class MissionStore:
    """One mission of ``folder``: its ``file``, or None as long as it has none.

    ``text`` is the text that edits are written into, with its comments.
    """

    def __init__(self, folder: Path, file: Path | None, text: str | None) -> None:
        self.folder, self.file, self.text = folder, file, text
        self._stat: tuple[int, int] | None = None
        self._sha256 = ""
        self._changed: Disk = "same"
        self._kept = False
        if file is not None:
            self._look()

    @property
    def place(self) -> Path:
        """The file that the mission has, or would have."""
        return self.file or self.folder / UNNAMED_FILE

    @property
    def edits(self) -> Path:
        """The file of unsaved edits."""
        return self.folder / UNNAMED_EDITS if self.file is None else self.file.with_name(EDITS.format(self.file.name))

    def disk(self) -> Disk | None:
        """Whether the file is still what was read or written here; None without a file."""
        if self.file is None:
            return None
        try:
            found = self.file.stat()
        except OSError:
            return "gone"
        if (found.st_mtime_ns, found.st_size) != self._stat:
            self._stat = found.st_mtime_ns, found.st_size
            self._changed = "same" if _sha256(self.file) == self._sha256 else "changed"
        return self._changed

    def reread(self) -> tuple[EditedDocument, str | None]:
        """The document and the text that the file holds now; `take` makes them the mission's. Raises InputError."""
        if self.file is None:
            raise PageError("this mission has no file yet: save it first", code="bad_message")
        _, _, document, text, _ = read_content(self.file, None)
        return document, text

    def take(self, text: str | None) -> None:
        """Take the text that was read again: the file is the mission's own."""
        self.text = text
        self._look()

    def save(self, document: EditedDocument, name: str | None, *, over: bool) -> Path:
        """Write the document into its file, or into the one called ``name``; all comments of its text stay.

        Raises PageError where the file is another one by now or exists already, unless ``over``, and InputError where
        it cannot be written.
        """
        target = self.place if name is None and self.file is not None else self._named(name)
        if self.text is None:
            raise PageError("there is nothing to save yet: give a start and a goal", code="not_saved")
        new = target != self.file
        if new and target.exists() and not over:
            words = f"{target.name} is there already: give another name, or replace it"
            raise PageError(words, code="exists", where="name")
        if not new and self.disk() != "same" and not over:
            words = f"{target.name} was changed on the disk: read it again, or replace it"
            raise PageError(words, code="changed_on_disk")
        try:
            text = saved_text(self.text, document, str(target))
            write_whole(target if new else target.resolve(), text)
        except (InputError, OSError) as why:
            raise PageError(str(why), code="not_saved") from why
        self.forget()
        self.file, self.text = target, text
        self._look()
        return target

    def keep(self, document: EditedDocument) -> None:
        """Keep unsaved edits beside the mission. Raises InputError."""
        self._kept = True
        kept = {"of_sha256": self._sha256, "mission": document, "text": self.text}
        write_whole(self.edits, json.dumps(kept, default=plain_date))

    def forget(self) -> None:
        """Remove the file of edits that was kept."""
        if self._kept:
            with suppress(OSError):
                self.edits.unlink(missing_ok=True)
        self._kept = False

    def kept(self) -> EditedDocument | None:
        """The unsaved edits of an earlier run; None if there are none that can be read.

        If they belong to another state of the file, the file counts as changed on the disk. Otherwise ``text`` is then
        that of the earlier run.
        """
        try:
            with self.edits.open("rb") as opened:
                data = opened.read(MOST_EDITS_BYTES + 1)
            found = json.loads(data) if len(data) <= MOST_EDITS_BYTES else None
            _, _, document, _, _ = read_content(found["mission"], None)  # type: ignore[index]
        except (OSError, ValueError, KeyError, TypeError, RecursionError, GcsplanError):
            return None
        self._kept = True
        text, same = found.get("text"), found["of_sha256"] == self._sha256  # type: ignore[union-attr,index]
        if self.file is None:
            self.text = text if isinstance(text, str) else None
        elif not same:
            self._changed = "changed"
        elif isinstance(text, str):
            self.text = text
        return document

    def _named(self, name: str | None) -> Path:
        """The file of the folder with this name. Raises PageError."""
        if name is None or not _FILE_NAME.fullmatch(name):
            words = "give a name such as field.yaml: letters, digits, _ - . and blanks, without a folder"
            raise PageError(words, code="not_saved", where="name")
        return self.folder / name

    def _look(self) -> None:
        """Note the state of the file, which is ours."""
        assert self.file is not None
        found = self.file.stat()
        self._stat, self._sha256, self._changed = (found.st_mtime_ns, found.st_size), _sha256(self.file), "same"


def _sha256(file: Path) -> str:
    try:
        with file.open("rb") as opened:
            return hashlib.sha256(opened.read(MAX_YAML_BYTES + 1)).hexdigest()
    except OSError:
        return ""
