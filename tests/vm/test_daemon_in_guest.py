"""The daemon on a real kernel: hardware that is pulled, moved, swapped and replaced is noticed by the kernel's word.

The daemon's fallback interval is longer than this file runs, so all it notices came as an event; and each problem names
that event.
"""

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from vm.bench import BREAKOUT, LIGHT
from vm.daemon import Watch, watching
from vm.devices.breakout import Breakout
from vm.devices.light import LightSensor
from vm.rig import ARM, CAMERA, RAIL, RigBench
from vm.user import APPLY_SECONDS, SMALL, McpClient, Octoform

pytestmark = pytest.mark.vm
See = Callable[[str, str], None]
_MANIFEST = """\
profiles: [profiles/so-arm101.md, profiles/camera-rail.md]
answers: {usb-2341-804f: "the camera rail of the bench"}
daemon: {interval: 24h, calls_per_hour: 100}
"""


@pytest.fixture(scope="module")
def kept(rig_bench: RigBench) -> Octoform:
    """octoform in the rig's guest, applied by the embedded agent."""
    octoform = Octoform(rig_bench.guest)
    octoform.install(_MANIFEST)
    octoform.run("apply", "-auto-approve", seconds=APPLY_SECONDS)
    return octoform


@pytest.fixture(scope="module")
def watch(kept: Octoform) -> Iterator[Watch]:
    """Its daemon."""
    with watching(kept) as watch:
        yield watch


@pytest.fixture(scope="module")
def caller(kept: Octoform, watch: Watch) -> Iterator[McpClient]:
    """A client that is connected all the time."""
    with kept.connected() as client:
        yield client


def about(device: str, *kinds: str) -> Callable[[dict[str, Any]], bool]:
    """A trouble of this device."""
    return lambda episode: episode["target"] == f"device:{device}" and episode["kind"] in kinds


def over(device: str, *kinds: str) -> Callable[[dict[str, Any]], bool]:
    """A trouble of this device that is over."""
    return lambda episode: about(device, *kinds)(episode) and episode["closed"] is not None


def test_a_pulled_camera_is_noticed_by_the_kernels_word(
    rig_bench: RigBench, watch: Watch, caller: McpClient, see: See
) -> None:
    since, attempts = watch.count(), watch.octoform.attempts()
    with rig_bench.pulled("camera", "/dev/video0", "/dev/video2", 11):
        episode = watch.until(about(CAMERA, "device_gone"), since)
        assert "hardware" in episode["causes"], episode
        assert watch.octoform.asked("health")["status"] != "healthy"
    ended = watch.until(over(CAMERA, "device_gone"), since)
    assert caller.picture(CAMERA).width == SMALL["width"]
    assert watch.octoform.attempts() == attempts, "an agent ran"
    see("daemon, camera", f"pulled and at another node: {ended['outcome']}, told by {' '.join(episode['causes'])}")


def test_a_moved_serial_board_works_at_the_next_call(
    rig_bench: RigBench, watch: Watch, caller: McpClient, see: See
) -> None:
    since, attempts = watch.count(), watch.octoform.attempts()
    with rig_bench.pulled("rail", "/dev/ttyACM1", "/dev/ttyACM2", 10):
        watch.until(about(RAIL, "device_gone"), since)
    caller.call("rail_home", device=RAIL)
    assert rig_bench.line.position == {"X": 0, "Y": 0}
    watch.until(over(RAIL, "device_gone"), since)
    assert watch.octoform.attempts() == attempts, "an agent ran"
    see("daemon, board", "moved to another port: the next call worked, no agent ran")


def test_a_board_pulled_in_the_middle_of_a_call(rig_bench: RigBench, watch: Watch, caller: McpClient, see: See) -> None:
    since, found, attempts = watch.count(), list[str](), watch.octoform.attempts()
    servo = rig_bench.servos.servos[6]
    goal = round(servo.position) + (900 if servo.position < 2048 else -900)
    mover = threading.Thread(
        target=lambda: found.append(caller.refused("arm_move_joint", device=ARM, joint="gripper", position=goal))
    )
    mover.start()
    goals = servo.goals.highest, servo.goals.lowest
    while mover.is_alive() and (servo.goals.highest, servo.goals.lowest) == goals:
        mover.join(0.05)
    with rig_bench.pulled("arm", "/dev/ttyACM0", "/dev/ttyACM1", 9):
        mover.join(180.0)
        assert found, "the call never ended"
        watch.until(about(ARM, "device_gone"), since)
    watch.until(over(ARM, "device_gone"), since)
    assert len(caller.call("arm_status", device=ARM)["joints"]) == 6
    assert watch.octoform.attempts() == attempts, "an agent ran"
    see("daemon, in a call", f"{found[0][:70]!r}; back and read again")


def test_two_boards_that_change_places(rig_bench: RigBench, watch: Watch, caller: McpClient, see: See) -> None:
    since, guest, attempts = watch.count(), rig_bench.guest, watch.octoform.attempts()
    for name in ("arm", "rail"):
        guest.unplug(name)
    watch.until(about(ARM, "device_gone"), since)
    watch.until(about(RAIL, "device_gone"), since)
    # Each into the port of the other, and with it under the other's name.
    for name, port in (("rail", 9), ("arm", 10)):
        guest.plug(name, rig_bench.model(name), port)
    guest.run("udevadm settle --timeout=300", 400.0)
    watch.until(over(ARM, "device_gone"), since)
    watch.until(over(RAIL, "device_gone"), since)
    lines = len(rig_bench.line.lines)
    caller.call("rail_home", device=RAIL)
    assert len(rig_bench.line.lines) > lines
    assert rig_bench.servos.broken == 0, "the rail's words went to the arm"
    assert len(caller.call("arm_status", device=ARM)["joints"]) == 6
    assert watch.octoform.attempts() == attempts, "an agent ran"
    see("daemon, swapped", "each call reached its own board")


def test_a_killed_endpoint_is_back_and_the_client_goes_on(watch: Watch, caller: McpClient, see: See) -> None:
    since, guest = watch.count(), watch.octoform.guest
    guest.run("pkill -9 -f '[e]ndpoint/serve.py'")
    episode = watch.until(lambda item: item["kind"] == "process_dead" and item["closed"] is not None, since)
    # The end of the process is told by the kernel. A guest so slow that a check falls before it may have asked first.
    assert {"process", "ping"} & set(episode["causes"]), episode
    assert episode["outcome"] == "repaired", episode
    caller.call("rail_position", device=RAIL)
    seconds = episode["closed_uptime"] - episode["opened_uptime"]
    made = ", ".join(f"{each['repair']} in {each['seconds']:.1f} s" for each in episode["tries"])
    see("daemon, endpoint", f"killed; {made}; over after {seconds:.1f} emulated s; the same client called again")


def test_hardware_of_a_new_kind_is_onboarded_while_the_others_work(
    rig_bench: RigBench, watch: Watch, caller: McpClient, see: See
) -> None:
    since, before = watch.count(), set(caller.tools())
    rig_bench.guest.plug("light", LightSensor(), 12)
    episode = watch.until(lambda item: item["kind"] == "hardware_changed", since)
    assert "hardware" in episode["causes"], episode
    caller.call("rail_position", device=RAIL)
    runs = watch.rediscovered(since, APPLY_SECONDS)
    interface, now = watch.octoform.artifact("interface"), set(caller.tools())
    assert any(tool["devices"] == [LIGHT] and tool["name"] in now for tool in interface["tools"])
    # A generated server is at most 500 lines long: what is worth least makes room for the newcomer, and that is said.
    room = " ".join(item["detail"] for item in interface["left_out"] if item["reason"] == "server_size")
    lost = {tool for tool in before - now if tool not in room}
    assert not lost, f"{lost} are gone without a word"
    assert watch.octoform.status("plan", "-detailed-exitcode") == 0, watch.octoform.run("plan")
    spared = f"made room for it: {', '.join(sorted(before - now))}" if before - now else "none less"
    see("daemon, new kind", f"new: {', '.join(sorted(now - before))}; {spared} ({runs})")


def test_a_device_replaced_by_another_model(rig_bench: RigBench, watch: Watch, caller: McpClient, see: See) -> None:
    since, guest = watch.count(), rig_bench.guest
    guest.unplug("light")
    guest.plug("breakout", Breakout(), 12)
    runs = watch.rediscovered(since, APPLY_SECONDS)
    devices = {device for tool in watch.octoform.artifact("interface")["tools"] for device in tool["devices"]}
    assert BREAKOUT in devices
    assert LIGHT not in devices, "the tools of what is gone are still there"
    caller.call("read_gpio_line", device=BREAKOUT, line=1)
    see("daemon, replaced", f"the other model's tools are there, those of the former one are not ({runs})")


def test_the_endpoint_goes_on_when_the_daemon_is_told_to_end(watch: Watch, caller: McpClient, see: See) -> None:
    assert watch.octoform.asked("health")["watched"] is not None
    watch.end()
    assert watch.octoform.asked("health")["watched"] is None
    caller.call("rail_position", device=RAIL)
    see("daemon, ended", "told by SIGTERM: no process of it is left, the endpoint goes on")
