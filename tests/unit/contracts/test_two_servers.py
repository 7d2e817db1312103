"""The contract is stable over a variable middle: two different servers satisfy one and the same INTERFACE."""

import ast

from unit.contracts.contract_samples import SCHEMAS, artifacts, good

from octoform.contracts.canonical import output_digest
from octoform.contracts.contract_check import check
from octoform.contracts.schema_equivalence import serve_dynamic

ANOTHER = '''# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2", "imageio[ffmpeg]"]
# ///
"""Written by another agent: other library, other order, other names behind the tools."""

from subprocess import run

from fastmcp import FastMCP
from runtime import bus, device, logged

mcp = FastMCP("another")


@mcp.tool
@logged
def set_lamp_level(level: float) -> dict:
    """Dim the lamp."""
    run(["lampctl", "--level", str(level)], check=True, timeout=5)
    return {"level": level}


@mcp.tool
@logged
def set_fan_speed(percent: float) -> dict:
    """Drive the fan."""
    with bus("hwmon-fanboard"):
        device("hwmon-fanboard", actuate=True).path("hwmon").joinpath("pwm1").write_text(str(round(percent * 2.55)))
    return {"percent": percent}


@mcp.tool
@logged
def read_fan_speed() -> dict:
    """Speed of the fan in revolutions per minute."""
    return {"rpm": int(device("hwmon-fanboard").path("hwmon").joinpath("fan1_input").read_text())}


@mcp.tool
@logged
def capture_image(width: int) -> dict:
    """One picture of the camera."""
    import imageio

    with bus("usb-1234-0001"):
        reader = imageio.get_reader(device("usb-1234-0001").node("video4linux"))
        try:
            return {"height": len(reader.get_next_data()), "width": width}
        finally:
            reader.close()


if __name__ == "__main__":
    mcp.run()
'''


def functions(text: str) -> list[str]:
    return [node.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]


def test_two_different_servers_satisfy_one_interface() -> None:
    first, second = good("serve"), ANOTHER
    assert output_digest("serve", first, SCHEMAS) != output_digest("serve", second, SCHEMAS)
    assert functions(first) != functions(second)
    for text in (first, second):
        assert check("serve", text, artifacts(serve=None), SCHEMAS) == []
    # Imported, each declares what INTERFACE promised, whatever the order.
    members = ("name", "input_schema", "output_schema", "annotations")
    lines = [{key: tool[key] for key in members if key in tool} for tool in good("interface")["tools"]]
    assert serve_dynamic({"tools": lines}, good("interface")) == []
    assert serve_dynamic({"tools": lines[::-1]}, good("interface")) == []


def test_a_server_of_other_tools_does_not() -> None:
    codes = [
        item.code for item in check("serve", ANOTHER.replace("read_fan", "get_fan"), artifacts(serve=None), SCHEMAS)
    ]
    assert set(codes) == {"SERVE-TOOLS-DIFFER"}
