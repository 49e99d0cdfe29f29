"""JSON from outside: every error in one line, however deep it is nested and however long its numbers are."""

from __future__ import annotations

import json
from math import isfinite
from typing import Any, NoReturn

from fbql_common.core.errors import BadInput


def json_from(data: bytes) -> Any:
    """The value in a JSON text. Raises BadInput with the reason, for numbers that are not finite too."""
    try:
        return json.loads(data, parse_constant=_not_a_number, parse_float=_finite)
    except BadInput:
        raise
    except UnicodeDecodeError:
        raise BadInput("not JSON: it is not text") from None
    except json.JSONDecodeError as error:
        raise BadInput(f"not JSON, or truncated: {error.msg} in line {error.lineno}") from None
    except ValueError:  # Python reads no integer of more than 4300 digits
        raise BadInput("a number has too many digits") from None
    except RecursionError:
        raise BadInput("nested too deeply") from None


def _not_a_number(text: str) -> NoReturn:
    raise BadInput(f"{text} is not a number; every number must be finite")


def _finite(text: str) -> float:
    value = float(text)
    if not isfinite(value):
        raise BadInput(f"{text} is too large; every number must be finite")
    return value
