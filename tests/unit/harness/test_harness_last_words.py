"""The reason for a program that failed by itself: the limit that it met, or what it complained of last."""

from pathlib import Path

import pytest
from unit.harness.program_streams import SECRET, a_task

from octoform.harness.adapters.pi import PiDialect
from octoform.harness.contained_attempt import Invocation, run_contained
from octoform.harness.port import ExitReason

TOO_OLD = (
    "file:///opt/it.js:3\\n    import x with {}\\n\\nSyntaxError: Unexpected token\\n    at it\\n\\nNode.js v16.1.0\\n"
)


def detail(folder: Path, code: str) -> str:
    invocation = Invocation(argv=("sh", "-c", code), named=("LOOP_KEY",), dialect=PiDialect())
    outcome = run_contained(a_task(folder), invocation, lambda *_: None)
    assert outcome.reason is ExitReason.CRASHED
    return outcome.detail


@pytest.mark.parametrize(
    ("code", "told"),
    [
        (
            f"printf '{TOO_OLD}' >&2; exit 1",
            "exit status 1; its last output: SyntaxError: Unexpected token; Node.js v16.1.0",
        ),
        ("printf 'no such option' >&2; exit 2", "exit status 2; its last output: no such option"),
        ("exit 3", "exit status 3"),
        ('echo "wrong: $LOOP_KEY" >&2; exit 1', "exit status 1; its last output: wrong: [LOOP_KEY redacted]"),
        ("exec head -c 300000000 /dev/zero > large", "ended by signal 25: a file of more than 256 MiB was written"),
    ],
)
def test_what_is_told(code: str, told: str, tmp_path: Path) -> None:
    found = detail(tmp_path, code)
    assert found == told
    assert SECRET not in found
