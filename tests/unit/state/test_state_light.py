"""What a plan with nothing to do reads comes without any heavy import."""

import json
import subprocess
import sys
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

from octoform.state.layout import Layout
from octoform.state.store.quick_read import peek
from octoform.state.store.snapshot import read_snapshot

ROOT = Path(__file__).parents[3]
HEAVY = ("pydantic", "git", "jsonschema", "ruamel", "jinja2", "rich", "tempfile", "subprocess")
LIGHT = (
    *("layout", "files", "store.quick_read", "store.journal", "store.lock"),
    *("accepted", "artifact_cache", "git_access"),
)


@pytest.mark.parametrize("module", LIGHT)
def test_a_light_module_imports_nothing_heavy(module: str) -> None:
    program = f"import sys; import octoform.state.{module}; print([name for name in {HEAVY!r} if name in sys.modules])"
    run = subprocess.run(
        [sys.executable, "-S", "-c", program], cwd=ROOT, env={"PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert (run.stdout.strip(), run.stderr) == ("[]", "")


def places(value: object, at: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The way to every value of a document; what `detail` holds is free."""
    if at:
        yield at
    if isinstance(value, dict) and at[-1:] != ("detail",):
        for name, item in value.items():
            yield from places(item, (*at, name))


def changed(document: dict[str, Any], at: tuple[str, ...], value: object) -> dict[str, Any]:
    new = deepcopy(document)
    place = new
    for name in at[:-1]:
        place = place[name]
    place[at[-1]] = value
    return new


WHOLE: dict[str, Any] = {
    "format": 1,
    "octoform": "1.0",
    "host": "bench",
    "lineage": "l",
    "serial": 3,
    "manifest_digest": None,
    "git": {"revision": "r", "dirty": ["a"]},
    "tier1": True,
    "nodes": {
        "probe": {
            "key": "k",
            "key_parts": {"a": "b"},
            "output_digest": "d",
            "file_digest": "f",
            "harness": "builtin",
            "model": None,
            "program": "p",
            "specs": "s",
            "platform": {"os": "linux"},
            "attempts": 1,
            "usage": {
                "input_tokens": 1,
                "cached_tokens": None,
                "output_tokens": 2,
                "cost_usd": 0.5,
                "cost_source": "x",
            },
            "seconds": 1.5,
            "accepted_at": "2026-11-27T18:04:25Z",
            "tainted": False,
            "status": "accepted",
            "detail": {"any": [1, None]},
        },
        "step.perceive": {},
    },
    "unknown": [1],
}


def test_what_the_heavy_reader_refuses_is_no_settled_state_for_the_light_one_either(tmp_path: Path) -> None:
    """Else `health` would call healthy what `status` and `plan` call damaged."""
    layout = Layout(tmp_path, "bench")

    def both(document: dict[str, Any]) -> tuple[bool, bool]:
        layout.snapshot.parent.mkdir(parents=True, exist_ok=True)
        layout.snapshot.write_text(json.dumps(document))
        return peek(layout) is not None, read_snapshot(layout)[0] is not None

    assert both(WHOLE) == (True, True)
    values: tuple[object, ...] = (None, "x", "\ud800", -1, True, 1.5, [], [1], {}, {"a": 1}, "-999-11-27T18:04:25Z")
    settled = {
        (at, repr(value))
        for at in places(WHOLE)
        for value in values
        if (seen := both(changed(WHOLE, at, value)))[0] and not seen[1]
    }
    assert settled == set()
