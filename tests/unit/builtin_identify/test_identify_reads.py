"""What IDENTIFY touches (its input, its output and the id files, nothing else), and that its output is constant."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hosts.plant import plant

from octoform.builtin.probe import probe_root

ROOT = Path(__file__).resolve().parents[3]
# Its folder, the host's root, the audit events and the output.
Run = tuple[Path, Path, list[list[str]], dict[str, Any]]
# Everything that a process can do to a device or to the world passes one of these audit events.
WATCH = """
import json, os, sys
done, seen = [], ("open", "os.", "socket.", "subprocess.", "shutil.", "fcntl.", "ctypes.", "glob.")
def hook(event, args):
    if event.startswith(seen):
        place = args[0] if args else ""
        done.append([event, os.fspath(place) if isinstance(place, (str, os.PathLike)) else ""])
sys.addaudithook(hook)
from octoform.builtin.__main__ import main
status = main([sys.argv[1]])
print(json.dumps(done))
sys.exit(status)
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Run]:
    """The bench twice, with another hash seed and with its devices in the reverse order."""
    done = []
    for seed in ("1", "2"):
        folder = tmp_path_factory.mktemp("run")
        root = folder / "host"
        plant("bench", root)
        ids = root / "usr/share/misc/usb.ids"
        ids.parent.mkdir(parents=True)
        ids.write_text("1a86  Chipworks\n\t7523  QX34 serial converter\n", encoding="utf-8")
        probed = probe_root(root)
        if seed == "2":
            probed["devices"].reverse()
        source, output, task = folder / "probe.json", folder / "identify.json", folder / "task.json"
        source.write_text(json.dumps(probed), encoding="utf-8")
        asked = {"format": 1, "stage": "identify", "input": str(source), "output": str(output)}
        task.write_text(json.dumps(asked), encoding="utf-8")
        environment = {**os.environ, "OCTOFORM_SYSROOT": str(root), "PYTHONPATH": str(ROOT), "PYTHONHASHSEED": seed}
        command = [sys.executable, "-c", WATCH, str(task)]
        ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=30, check=False)
        assert ended.returncode == 0, ended.stderr
        events = json.loads(ended.stdout.splitlines()[-1])
        done.append((folder, root, events, json.loads(output.read_text(encoding="utf-8"))))
    return done


def test_only_the_input_the_output_and_the_id_files_are_opened(
    runs: list[Run],
) -> None:
    folder, root, events, _ = runs[0]
    code = (str(ROOT / "octoform"), sys.prefix, sys.base_prefix, "/usr/lib/python", "<")
    opened = {path for event, path in events if event == "open" and path and not path.startswith(code)}
    drafts = {path for path in opened if Path(path).match(".identify.json.*.octoform-tmp")}
    assert len(drafts) == 1
    assert opened - drafts == {
        str(folder),  # so that the new name is on the disk
        str(folder / "task.json"),
        str(folder / "probe.json"),
        str(root / "usr/share/misc/usb.ids"),
    }
    others = {event for event, _ in events if event != "open"}
    assert others <= {"os.listdir", "os.scandir", "os.rename", "os.putenv"}, "only Python's own imports list folders"


def test_neither_hash_seed_nor_order_changes_what_is_said(
    runs: list[Run],
) -> None:
    first, second = (output for _, _, _, output in runs)
    for member in ("devices", "left_out"):
        assert first[member] == list(reversed(second[member]))
    assert len(first["devices"]) > 2
