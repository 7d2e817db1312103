"""Commands at random, faults at random: whatever a client asks and whatever breaks, no limit is passed.

Judged by what reached the simulated hardware. Its own bounds are taken off first, so that nothing but octoform keeps
them: the gate and the profiles' limits outside of the server, the calibration and the heat inside.
"""

import asyncio
import json
import os
import random
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fastmcp.exceptions import ToolError
from gated import gated
from virtual_rig import VirtualRig, described, virtual_rig

SEEDS, COMMANDS = range(int(os.environ.get("SEEDS", "2"))), int(os.environ.get("COMMANDS", "250"))
"""`make faults` sets more: four courses of 2500 commands."""
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
SERVO_FAULTS = (None, None, "mute", "stuck", "deaf_torque", "corrupt", "half")
RAIL_FAULTS = (*(None,) * 10, "mute", "mute", "odd", "jammed", "late", "hot")
CALIBRATED = {"elbow_flex": (1000, 3000), "gripper": (2000, 3400)}
HOT = 69
SOUND: dict[str, Callable[[random.Random], dict[str, object]]] = {
    "arm_move_joint": lambda dice: {"joint": dice.choice(JOINTS), "position": dice.randint(700, 3500)},
    "arm_move_joint_calibrated": lambda dice: {"joint": dice.choice(JOINTS), "percent": dice.uniform(-100, 100)},
    "arm_move_joints": lambda dice: {joint: dice.randint(900, 3000) for joint in JOINTS},
    "arm_home": lambda dice: {},
    "arm_rest": lambda dice: {"speed": dice.randint(50, 1500)},
    "arm_set_torque": lambda dice: {"joint": dice.choice(JOINTS), "on": dice.random() < 0.7},
    "arm_stop": lambda dice: {},
    "arm_read_joint": lambda dice: {"joint": dice.choice(JOINTS)},
    "rail_move_x": lambda dice: {"steps": dice.randint(-2000, 2000)},
    "rail_move_y": lambda dice: {"steps": dice.randint(1500, 2000)},
    "rail_home": lambda dice: {},
    "rail_position": lambda dice: {},
    "rail_stop": lambda dice: {},
}
OFTEN = {"rail_move_x": 40, "rail_move_y": 60, "arm_move_joint": 30, "arm_move_joint_calibrated": 9, "rail_stop": 1}
OFTEN |= {"arm_set_torque": 9, "arm_read_joint": 9, "rail_position": 9, "rail_home": 5}
MAD: tuple[object, ...] = (-1, 4096, 10**9, -(10**9), 2**63, 0.5, 4095.5, 1e300, "2048", "-1", None, True, [2048], {})


class Witness:
    """What reached the hardware, checked as it arrives."""

    def __init__(self, bench: VirtualRig) -> None:
        self.bench, self.farthest = bench, 0
        self.broken: list[str] = []
        for number, servo in bench.arm.servos.items():
            servo.write = self._watched(number, servo.write)  # type: ignore[method-assign]

    def _watched(self, number: int, write: Any) -> Any:
        low, high = dict(enumerate(((0, 4095),) * 6, 1))[number]
        name = JOINTS[number - 1]
        low, high = CALIBRATED.get(name, (low, high))
        servo = self.bench.arm.servos[number]

        def checked(address: int, data: bytes) -> int:
            value = int.from_bytes(data, "little")
            if address == 42 and not low <= value <= high and value != round(servo.position):
                self.broken.append(f"{name}: goal {value} outside of {low} to {high}")
            if address == 42 and servo.temperature >= HOT + 0.5 and abs(value - servo.position) > 60:
                self.broken.append(
                    f"{name}: sent from {servo.position:.0f} to {value} at {servo.temperature:.0f} degrees"
                )
            if address == 46 and not 50 <= value <= 1500:
                self.broken.append(f"{name}: speed {value}")
            return int(write(address, data))

        return checked

    def look(self) -> None:
        rail = self.bench.rail
        if rail.longest > 2000:
            self.broken.append(f"the rail was moved by {rail.longest} steps at once")
        # As the firmware counts: after a jam the carriage is elsewhere, and only a picture could show it.
        self.farthest = max(self.farthest, *map(abs, rail.counted.values()))
        if self.farthest > 10_000:
            self.broken.append(f"the rail was {self.farthest} steps from its origin")


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[VirtualRig]:
    plain = {number: {"start": 2048} for number in range(1, 7)}
    rail = {"most": None, "farthest": None, "speedup": 20}
    with virtual_rig(tmp_path, described(arm={"servos": plain, "speedup": 30}, rail=rail), monkeypatch) as found:
        for servo in found.arm.servos.values():  # their own limits would hide a goal too far, and a joint too hot
            for name, value in {"lowest": 0, "highest": 4095, "highest_temperature": 150}.items():
                servo._memory.put(name, value)
        file = tmp_path / ".cache/huggingface/lerobot/calibration/robots/so101_follower/bench.json"
        file.parent.mkdir(parents=True)
        ranges = {
            name: {
                "id": JOINTS.index(name) + 1,
                "drive_mode": 0,
                "homing_offset": 0,
                "range_min": low,
                "range_max": high,
            }
            for name, (low, high) in CALIBRATED.items()
        }
        file.write_text(json.dumps(ranges))
        yield found


@pytest.mark.parametrize("seed", SEEDS)
def test_no_fault_and_no_command_passes_a_limit(bench: VirtualRig, tmp_path: Path, seed: int) -> None:
    dice, witness = random.Random(seed), Witness(bench)
    ended = asyncio.run(_commanded(bench, tmp_path, dice, witness))
    assert witness.broken == []
    assert sum(ended.values()) == COMMANDS
    assert ended["done"] > COMMANDS // 5 and ended["refused"] > COMMANDS // 5, ended
    assert bench.arm.broken == 0, "a packet was sent over another"
    assert witness.farthest > 5000 and bench.rail.longest > 1900, "it never came near the limits"


async def _commanded(bench: VirtualRig, folder: Path, dice: random.Random, witness: Witness) -> Counter[str]:
    ended: Counter[str] = Counter()
    way = 1  # of the Y axis: one end of the rail, then the other, with failures on the way
    guarded = {bench.tools[name]: bench.policy["tools"][name] for name in SOUND}
    # What lies between a client and the gate takes half of the time and decides nothing: every tenth goes there.
    async with gated(folder, guarded) as behind, behind.client() as client:
        for number in range(COMMANDS):
            _break_something(bench, dice)
            tool, arguments = _asked(dice)
            way = -way if dice.random() < 0.02 else way
            if tool == "rail_move_y" and isinstance(steps := arguments["steps"], int):
                arguments["steps"] = way * steps
            try:
                if number % 10:
                    failed = (await behind.server.call_tool(tool, arguments)).is_error
                else:
                    failed = (await client.call_tool(tool, arguments, raise_on_error=False)).is_error
            except ToolError:
                failed = True
            ended["refused" if failed else "done"] += 1
            bench.time.sleep(dice.choice((0.0, 0.1, 2.0)))
            witness.look()
            if witness.broken:
                witness.broken.append(f"by {tool} {arguments}")
                break
    return ended


def _asked(dice: random.Random) -> tuple[str, dict[str, object]]:
    tool = dice.choices(list(SOUND), [OFTEN.get(name, 1) for name in SOUND])[0]
    arguments = SOUND[tool](dice)
    if arguments and dice.random() < 0.4:
        arguments[dice.choice(list(arguments))] = dice.choice(MAD)
    if dice.random() < 0.05:
        arguments["speed"] = dice.choice(MAD)
    return tool, arguments


def _break_something(bench: VirtualRig, dice: random.Random) -> None:
    if dice.random() < 0.1:
        servo = bench.arm.servos[dice.randint(1, 6)]
        servo.fault = dice.choice(SERVO_FAULTS)
    if dice.random() < 0.05:
        for servo in bench.arm.servos.values():
            servo.fault = None
    if dice.random() < 0.3:
        bench.arm.servos[dice.randint(1, 6)].temperature = dice.choice((25.0, 62.0, 69.4, 80.0))
    if dice.random() < 0.03:
        bench.arm.drop(transactions=dice.randint(1, 3))
    if dice.random() < 0.3:
        bench.rail.fault = dice.choice(RAIL_FAULTS)
