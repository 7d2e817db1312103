"""DEPLOY's trial of servers that pass every other check and return wrong values: each tool, for each device."""

import itertools
import json
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bench_host import SENSOR, written
from held import Output
from projects import Done, Project
from server_edits import FILE, Edit, adds, all_of, body, read_by, uses, warm

PANEL = """
folder = runtime.device(device).path("backlight")
level = int((folder / "brightness").read_text())
if device == "backlight-panel2":
    device = "backlight-panel"
return Lights(device=device, lights=[Light(name=folder.name, percent=level, level=level, maximum=100)])
"""
LIED = all_of(
    uses("subprocess", "socket"),
    # What a pattern finds in a text is computed by no rule, so that its scale shows in the trial alone.
    body("read_temperature", f"value = float(re.findall(r'[-+.e0-9]+', ({FILE}).read_text())[0])\n{warm('value')}"),
    body("read_brightness", PANEL),
    body(
        "read_led", "runtime.read_text(runtime.device(device).path('hwmon') / 'name')\nreturn lights(device, 'hwmon')"
    ),
    body(
        "read_storage",
        """
        folder = runtime.device(device).path("block")
        try:
            done = subprocess.run(["no-such-disk-program", folder.name], timeout=5, check=True, capture_output=True)
        except FileNotFoundError:
            raise
        return Storage(device=device, disks=[done.stdout])
        """,
    ),
    body(
        "list_camera_formats",
        """
        runtime.device(device).path("video4linux")
        with socket.create_connection(("127.0.0.1", 9), timeout=2) as line:
            return Formats(device=device, formats=[line.recv(9)])
        """,
    ),
)
# What was read first is kept, and told from then on.
FROZEN = all_of(
    adds("def first():\n    number = yield\n    while True:\n        yield number\n\n\nFIRST = first()\nnext(FIRST)"),
    read_by(f"time.sleep(0.05)\nvalue = FIRST.send(runtime.read_number({FILE}))", "value % 40"),
)
MUTE_TOOLS = (
    *("read_temperature", "read_brightness", "read_led", "read_storage", "list_camera_formats", "describe_input"),
    *("read_input_events", "capture_image"),
)


def muted(name: str) -> Edit:
    """The tool reads its device, and then fails whatever the reading is."""
    text = 'said = runtime.read_text(runtime.device(device).folder / "uevent")\nif said != "later":\n'
    late = {"read_input_events": "seconds / events", "capture_image": "flush * width / height / 100"}.get(name, "0.1")
    return body(name, f'{text}    time.sleep({late})\n    raise ToolError("not yet")\nreturn said')


MUTE = all_of(*(muted(name) for name in MUTE_TOOLS))
FOUND = {
    "ENDPOINT-RESULT-IMPLAUSIBLE": ("read_temperature", " degC, which no device"),
    "ENDPOINT-RESULT-OTHER-DEVICE": ("read_brightness for backlight-panel2", "answers for backlight-panel"),
    "ENDPOINT-DEVICE-ABSENT": ("read_led", "has no hwmon device"),
    "ENDPOINT-PROGRAM-MISSING": ("read_storage", "no-such-disk-program"),
    "ENDPOINT-NETWORK-FAILED": ("list_camera_formats", "refused"),
}


@pytest.fixture
def moving(tmp_path: Path) -> Iterator[tuple[Path, Output, str]]:
    """A desk whose sensor rises all the time, beyond all that is possible: its root, and what `written` has of it."""
    root = tmp_path / "host"
    earlier, good = written(root)
    file, ended = root / "sys/devices" / SENSOR / "temp1_input", threading.Event()

    def swing() -> None:
        for step in itertools.count():
            fresh = file.with_name("fresh")
            fresh.write_text(f"{20000 * 1.15**step:g}")
            fresh.replace(file)
            if ended.wait(0.02):
                return

    mover = threading.Thread(target=swing)
    mover.start()
    yield root, earlier, good
    ended.set()
    mover.join()


def errors(done: Done) -> list[dict[str, str]]:
    """The errors of each trial: code to the whole diagnostic as text."""
    trials = [
        event["diagnostics"]
        for event in done.events()
        if event["type"] == "attempt_errored" and event["node"] == "deploy"
    ]
    return [{item["code"]: json.dumps(item) for item in found if item["severity"] == "error"} for found in trials]


def test_what_a_trial_finds_untrue_goes_back_to_serve(
    tmp_path: Path, moving: tuple[Path, Output, str], packaged: Callable[..., Path]
) -> None:
    root, earlier, good = moving
    project = Project(tmp_path / "project", tmp_path / "outside")
    project.environ["OCTOFORM_SYSROOT"] = str(root)
    (root / "usr/bin").mkdir(parents=True)  # what was recorded of its programs
    project.script = {name: [{"write": json.dumps(output)}] for name, output in earlier.items()}
    project.script["serve"] = [{"write": LIED(good)}]
    project.script["serve:told"] = [{"write": FROZEN(good)}, {"write": good}]
    project.manifest = {"stages": "{deploy: {harness: builtin}}"}
    project.share_environments(packaged("opencv-python-headless"))
    lied, frozen = errors(project.apply("-target", "deploy", status=0))
    assert lied.keys() == FOUND.keys(), lied
    for code, words in FOUND.items():
        assert all(word in lied[code] for word in words), lied[code]
    assert list(frozen) == ["ENDPOINT-RESULT-CONSTANT"] and "read_temperature" in frozen["ENDPOINT-RESULT-CONSTANT"]
    # A server none of whose tools reads anything, although it asks for every device.
    project.script["serve"], project.script["serve:told"] = [{"write": MUTE(good)}], [{"write": good}]
    [mute] = errors(project.apply("-target", "deploy", "-replace", "serve", status=0))
    assert list(mute) == ["ENDPOINT-NOTHING-ANSWERS"]
    assert "0 of 8 read tools answered" in mute["ENDPOINT-NOTHING-ANSWERS"]
