"""What a committed state gives away is looked for in the whole of it, however large a host's artifact is."""

import json
from pathlib import Path

from recordings.leaking import leaks


def test_an_artifact_above_a_mebibyte_is_read_to_its_end(tmp_path: Path) -> None:
    devices = [{"id": f"platform-part-{number}", "raw_descriptor": "x" * 400} for number in range(3000)]
    text = json.dumps({"devices": [*devices, {"id": "usb", "raw_descriptor": "Otter 8k1172aa"}]})
    assert len(text) > 1 << 20
    (tmp_path / "output.json").write_text(text)
    assert leaks(tmp_path, ["8k1172aa"]) == ["output.json: 8k1172aa"]
    assert leaks(tmp_path, ["9z9999zz"]) == []
