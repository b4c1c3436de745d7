"""JSON from metrics and rows."""

from __future__ import annotations

import json
import math
from typing import Any


def json_text(value: Any) -> str:
    """Return a value as JSON; JSON has neither NaN nor infinity, so these become null."""
    return json.dumps(_finite(value), indent=1, default=float)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {n: _finite(v) for n, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
