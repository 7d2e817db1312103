"""The deployment that faults are injected into: a camera, two equal boards and a sensor, and a server for them.

Two tools are there for the faults alone: `weigh` fails in its own code when the sensor orders it, `wait_for_sensor`
does not return. What the agents of WATCH and HEAL say stands in the script, which a case may change at any time.
"""

import json
from typing import Any

import replugged
from replugged import BOARD, CAMERA, SENSOR, TWIN

__all__ = ["BOARD", "CAMERA", "SENSOR", "TWIN", "report", "script"]

_READS = '{"readOnlyHint": True, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}'
_MORE = f'''

HEAVIEST = 400000


@mcp.tool(
    annotations={_READS}
)
@runtime.logged
def weigh() -> Said:
    """Weigh what lies on the sensor."""
    with runtime.device("{SENSOR}").bus() as unit:
        if int(runtime.read_text(unit.path("hwmon") / "temp1_input") or "0") > HEAVIEST:
            raise ValueError("too heavy")
        grams = {{"0": "nothing", "21500": "a cup", "22750": "a full cup", "200000": "a lot"}}
        return Said(text=grams[runtime.read_text(unit.path("hwmon") / "temp1_input") or "0"])


@mcp.tool(
    annotations={_READS}
)
@runtime.logged
def wait_for_sensor() -> Said:
    """Wait until the sensor is below a hundred degrees."""
    with runtime.device("{SENSOR}").bus() as unit:
        path = unit.path("hwmon") / "temp1_input"
        while int(runtime.read_text(path) or "0") > 100000:
            time.sleep(0.05)
        return Said(text="below")


if __name__ == "__main__":
'''
SERVER = replugged.SERVER.replace("from typing import", "import time\nfrom typing import").replace(
    '\n\nif __name__ == "__main__":\n', _MORE
)
_TOOLS = {
    "weigh": ([SENSOR], "Weigh what lies on the sensor.", "read"),
    "wait_for_sensor": ([SENSOR], "Wait until the sensor is below a hundred degrees.", "read"),
}


def script() -> dict[str, list[object]]:
    """What the scripted agent writes behind PROBE; WATCH finds nothing that it knows, HEAL does nothing."""
    made = replugged.script(SERVER, _TOOLS)
    made["watch"] = [{"write": json.dumps(report("healthy"))}]
    made["heal"] = [{"exit": 1}]
    return made


def report(status: str, *errors: dict[str, Any]) -> dict[str, Any]:
    """A report of WATCH as its schema wants it; errors without citations get those of the first failure."""
    return {
        "format": 1,
        "stage": "watch",
        "status": status,
        "summary": "the scripted agent says so",
        "physical_state": {"available": False, "seen": None, "reason": "there is no camera that is looked through"},
        "errors": list(errors),
        "claims": [],
        "declarations": [],
    }
