"""Problems as values: severity, stable code, place, hint.

A function that can meet a user's mistake returns ``(result, diagnostics)`` and gathers all of them; only bugs
raise. Rendering is the views' business: nothing here prints.
"""

from octoform.diagnostics.model import (
    Diagnostic,
    Severity,
    Span,
    as_warning,
    did_you_mean,
    error,
    from_json,
    has_errors,
    to_json,
    warning,
)

__all__ = [
    "Diagnostic",
    "Severity",
    "Span",
    "as_warning",
    "did_you_mean",
    "error",
    "from_json",
    "has_errors",
    "to_json",
    "warning",
]
