"""How long a test waits for what a busy machine delays. It ends a hang, and measures nothing."""

from __future__ import annotations

PATIENCE_S = 120.0
