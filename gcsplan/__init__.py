"""gcsplan: plans, proves, uploads and verifies MAVLink missions over real terrain."""

from __future__ import annotations

__version__ = "0.1.0"
