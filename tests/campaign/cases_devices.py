"""Faults of the hardware: what is pulled, comes back elsewhere, is swapped with its twin, or is another thing."""

from pathlib import Path

from campaign.bench import Bench
from campaign.model import QUIET, SURFACED, WAITS, Case
from campaign.rig import BOARD, TWIN

from octoform.daemon.model import Kind, Repair

GONE, MOVED = Kind.DEVICE_GONE, frozenset({Kind.DEVICE_MOVED, Kind.DEVICE_BACK})
BOUND = frozenset({Repair.REBIND, Repair.WAIT})
LEDGER = (".octoform/bench/instances.json",)


def _pull_camera(bench: Bench) -> None:
    bench.host.unplug("1-1")


def _camera_back(bench: Bench) -> None:
    bench.host.camera("1-1", 0)


def _camera_elsewhere(bench: Bench) -> None:
    bench.host.camera("1-7", 5)


def _takes_pictures(bench: Bench) -> bool:
    return bench.call("capture_image") == (True, "a frame")


def _camera_moved(bench: Bench) -> None:
    _pull_camera(bench)
    _camera_elsewhere(bench)
    # Before anything is repaired: the next call works.
    assert _takes_pictures(bench), "the call after the move does not work"


def _camera_under_another_name(bench: Bench) -> None:
    _pull_camera(bench)
    bench.host.camera("1-1", 7)


def _board_moved(bench: Bench) -> None:
    bench.host.unplug("1-2")
    bench.host.board("1-8", "ttyUSB4", "left")
    assert bench.call("move_board", device=BOARD) == (True, "left STEP"), "the call after the move does not work"


def _board_back(bench: Bench) -> None:
    bench.host.unplug("1-8")
    bench.host.board("1-2", "ttyUSB0", "left")


def _twins_swapped(bench: Bench) -> None:
    for port in ("1-2", "1-3"):
        bench.host.unplug(port)
    bench.host.board("1-5", "ttyUSB6", "right")
    bench.host.board("1-6", "ttyUSB7", "left")


def _twins_back(bench: Bench) -> None:
    for port in ("1-5", "1-6"):
        bench.host.unplug(port)
    bench.host.board("1-2", "ttyUSB0", "left")
    bench.host.board("1-3", "ttyUSB1", "right")


def _both_answer(bench: Bench) -> bool:
    asked = [bench.call("move_board", device=each) for each in (BOARD, TWIN)]
    return asked == [(True, "left STEP"), (True, "right STEP")]


def _pull_twin(bench: Bench) -> None:
    bench.host.unplug("1-3")


def _twin_back(bench: Bench) -> None:
    bench.host.board("1-3", "ttyUSB1", "right")


def _everything_gone(bench: Bench) -> None:
    bench.host.clear()


def _unknown_board(bench: Bench) -> None:
    """An unknown kind: the scripted agent does not onboard it, so what is there must stay."""
    bench.host._usb("1-6", "00d9", "Unheard Of")
    node = bench.host.tree.root / "sys/devices/pci0000:00/0000:00:14.0/usb1/1-6"

    def undo() -> None:
        if node.exists():
            bench.host.unplug("1-6")

    bench.undo.append(undo)


def _same_nodes(bench: Bench) -> list[str]:
    """The state's file counts one more step of its history; its entry of each node is unchanged."""
    nodes = bench.state()
    names = sorted({*nodes, *bench.nodes})
    return [f"the state of {name} is another one" for name in names if nodes.get(name) != bench.nodes.get(name)]


def _virtual_noise(bench: Bench) -> None:
    """What comes and goes without any hardware."""
    bench.host.tree.member("virtual/net/veth0", "net")
    bench.undo.append(lambda: bench.host.tree.unplug("virtual/net/veth0"))


def _flapping(bench: Bench) -> None:
    """A loose plug: six times out and in within a moment."""
    for _ in range(6):
        _pull_camera(bench)
        _camera_back(bench)


CASES = (
    Case("camera pulled, and back", _pull_camera, frozenset({GONE}), BOUND, WAITS, _takes_pictures, _camera_back),
    Case(
        "camera pulled, back elsewhere",
        _pull_camera,
        frozenset({GONE}),
        BOUND,
        WAITS,
        _takes_pictures,
        _camera_elsewhere,
        may_change=LEDGER,
    ),
    Case(
        "camera moved at once",
        _camera_moved,
        MOVED | {GONE},
        BOUND,
        right=_takes_pictures,
        may_change=LEDGER,
        repair=10.0,
        rows="F34",
    ),
    Case(
        # It is found because its twin is elsewhere, and works; who it is for certain, only a person can say.
        "board without serial number moved",
        _board_moved,
        MOVED,
        frozenset({Repair.REBIND}),
        SURFACED,
        mend=_board_back,
        rows="F34",
    ),
    Case("camera in its place under another name", _camera_under_another_name, ends=QUIET, right=_takes_pictures),
    Case(
        "twins may be swapped",
        _twins_swapped,
        frozenset({Kind.DEVICE_DOUBTFUL}),
        frozenset({Repair.PERSON}),
        SURFACED,
        mend=_twins_back,
        right=_both_answer,
    ),
    Case("one of two twins pulled, and back", _pull_twin, frozenset({GONE}), BOUND, WAITS, _both_answer, _twin_back),
    Case(
        "all devices pulled, and back",
        _everything_gone,
        frozenset({GONE}),
        BOUND,
        WAITS,
        _both_answer,
        lambda bench: bench._plug(bench.host),
    ),
    Case("a loose plug", _flapping, ends=QUIET, right=_takes_pictures, hold=3.0),
    Case("virtual devices come and go", _virtual_noise, ends=QUIET, hold=2.0),
    Case(
        "re-discovery that fails",
        _unknown_board,
        frozenset({Kind.HARDWARE_CHANGED}),
        frozenset({Repair.REDISCOVER}),
        SURFACED,
        mend=lambda bench: bench.undo.pop()(),
        repair=90.0,
        may_change=("state/bench/state.json",),
        after=_same_nodes,
        calls=12,
        rows="F28",
    ),
)


def tree(bench: Bench) -> Path:
    """The folder of devices."""
    return bench.host.tree.root / "sys/devices"
