"""A process in MetaEvoBox's own environment, and the requests to it.

MetaEvoBox pins versions that clash with those of gcsplan's other extras, so it runs in an environment of its own.
`worker` runs there.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError

SCRIPT = Path(__file__).with_name("worker.py")
WORKER_START_S, WORKER_ANSWER_S = 600.0, 3600.0
"""Longest wait for the start of a process, and for an answer."""
TAIL = 400
"""Characters of MetaEvoBox's own complaint that a message repeats."""

METABOX_CURE = (
    "MetaEvoBox wants an environment of its own: python3.11 -m venv metabox-env, "
    "metabox-env/bin/pip install 'gcsplan[metabox]', then gcsplan bench metabox --python metabox-env/bin/python"
)


class Worker:
    """One process of ``python``, an interpreter that has MetaEvoBox. Raises InputError if it does not."""

    def __init__(self, python: Path) -> None:
        self._python = python
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        try:
            # -I: neither gcsplan's sources nor the user's site packages are seen there.
            self._process = subprocess.Popen(
                [str(python), "-I", str(SCRIPT)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log
            )
        except OSError as error:
            self._log.close()
            raise InputError(f"cannot be run: {error.strerror or error}. {METABOX_CURE}", where=str(python)) from error
        try:
            ready = self._answer(WORKER_START_S)
            if "error" in ready:
                raise InputError(
                    f"MetaEvoBox cannot be imported there: {ready['error']}. {METABOX_CURE}", where=str(python)
                )
        except BaseException:
            self.close()
            raise
        self.versions: dict[str, str] = ready["versions"]
        self.dims: list[int] = []
        self.threats: list[int] = []

    def __enter__(self) -> Worker:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._log):
            if stream is not None:
                stream.close()

    def ask(self, what: str, points: Floats | None = None, **request: Any) -> dict[str, Any]:
        """The answer to a request of `worker`. Raises InputError if there is none, or if it is an error."""
        shape = {} if points is None else {"shape": points.shape}
        data = b"" if points is None else np.ascontiguousarray(points, dtype=np.float64).tobytes()
        stream = self._process.stdin
        assert stream is not None
        try:
            stream.write(json.dumps({"what": what, **request, **shape}).encode() + b"\n" + data)
            stream.flush()
        except OSError:
            raise self._ended("ended") from None
        answer = self._answer(WORKER_ANSWER_S)
        if "error" in answer:
            raise InputError(f"MetaEvoBox failed at {what} {request}: {answer['error']}", where=str(self._python))
        return answer

    def load(self, files: Sequence[Path]) -> None:
        """Load the instances in ``files``; ``dims`` and ``threats`` say how many variables and threats each has."""
        answer = self.ask("load", files=[str(file) for file in files])
        self.dims, self.threats = answer["dims"], answer["threats"]

    def cost(self, instance: int) -> Callable[[Floats], Floats]:
        """The cost of an instance, as a batch objective over the unit box."""
        return lambda points: np.array(self.ask("cost", points, instance=instance)["costs"])

    def _answer(self, wait_s: float) -> dict[str, Any]:
        stream = self._process.stdout
        assert stream is not None
        limit = threading.Timer(wait_s, self._process.kill)
        limit.start()
        try:
            line = stream.readline()
        finally:
            limit.cancel()
        if not line:
            raise self._ended(f"ended, or gave no answer within {wait_s:g} s")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def _ended(self, how: str) -> InputError:
        self._log.seek(0)
        said = self._log.read().decode(errors="replace").strip()
        return InputError(
            f"MetaEvoBox's process {how}. Its last words: {said[-TAIL:] or 'none'}", where=str(self._python)
        )
