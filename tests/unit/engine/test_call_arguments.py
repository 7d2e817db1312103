"""Arguments of a call as a person types them: what cannot be meant is refused before any server is started."""

from pathlib import Path

import pytest

from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.engine.tools import call


@pytest.mark.parametrize(
    ("pairs", "document", "words"),
    [
        (["channel"], None, "'channel' is not name=value"),
        (["=3"], None, "'=3' is not name=value"),
        (["channel=1", "channel=2"], None, "'channel' is given twice"),
        (["channel=1"], '{"channel": 2}', "'channel' is given twice"),
        ([], "{channel: 2}", "the arguments are not JSON"),
        ([], "[2]", "the arguments must be one JSON object"),
    ],
)
def test_arguments_that_cannot_be_meant(tmp_path: Path, pairs: list[str], document: str | None, words: str) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\n")
    answer, (problem,) = call(tmp_path, {}, ToolCall("read_clock"), pairs=pairs, document=document)
    assert answer is None
    assert problem.code == "CALL-BAD-ARGUMENT"
    assert problem.summary.startswith(words)
