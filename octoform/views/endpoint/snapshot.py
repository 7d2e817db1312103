"""What a look through a camera showed, for a person and for a program: one line each."""

import json
from pathlib import Path
from typing import Any

from octoform.diagnostics import Diagnostic, to_json
from octoform.engine.snapshot import Look
from octoform.escaping import escaped_json
from octoform.perception.frames import words
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.values import one_line


def one(console: Console, look: Look, saved: Path | None, *, as_json: bool) -> int:
    """One look; exit code 0 for a picture that shows something, 1 for none, 2 for one that shows nothing."""
    if as_json:
        console.raw(escaped_json(json.dumps(_document(look, saved), ensure_ascii=False)))
    elif isinstance(look.outcome, Diagnostic):
        problems.show(console, [look.outcome, *look.found])
        console.line(f"{look.at}  {console.paint('no picture', 'red')}{_since(look)}")
    else:
        problems.show(console, look.found)
        console.line(_line(console, look))
        if saved is not None:
            console.line(f"saved {saved}")
    if isinstance(look.outcome, Diagnostic):
        return 1
    return 2 if look.trouble else 0


def _line(console: Console, look: Look) -> str:
    taken = look.outcome
    frame = look.record.current if look.record else None
    if isinstance(taken, Diagnostic) or look.camera is None:
        raise ValueError("a look without a picture has no such line")
    parts = [
        look.at,
        one_line(look.camera.device, 60),
        f"{taken.width}x{taken.height}",
        f"mean {taken.picture.mean:.1f}",
        f"spread {taken.picture.spread:.1f}",
    ]
    if frame is not None and frame.difference is not None:
        parts.append(f"difference {frame.difference:.1f}")
    if look.trouble:
        parts.append(console.paint(f"shows nothing: {look.trouble}", "yellow"))
    return "  ".join(parts)


def _since(look: Look) -> str:
    """Since when there is none, where it is not the first time."""
    absent = look.record.absent if look.record else None
    return f" since {absent.since}" if absent and absent.since != look.at else ""


def _document(look: Look, saved: Path | None) -> dict[str, Any]:
    frame = look.record.current if look.record else None
    taken = look.outcome
    picture = None
    if not isinstance(taken, Diagnostic):
        picture = {
            "mime": taken.mime,
            "bytes": len(taken.data),
            "width": taken.width,
            "height": taken.height,
            "mean": taken.picture.mean,
            "spread": taken.picture.spread,
            "complaint": look.trouble,
            "difference": frame.difference if frame else None,
        }
    return {
        "format": 1,
        "at": look.at,
        "camera": look.camera.model_dump() if look.camera else None,
        "picture": picture,
        "problem": to_json(taken) if isinstance(taken, Diagnostic) else None,
        "file": str(saved) if saved else None,
        "summary": words(look.record).splitlines() if look.record else None,
        "diagnostics": [to_json(problems.near(item)) for item in look.found],
    }
