"""Endpoint of a bench with one temperature sensor."""

# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2", "pydantic>=2.12,<3"]
# ///

from typing import Annotated

from fastmcp import FastMCP
from fastmcp.exceptions import ToolError
from pydantic import BaseModel, Field
from runtime import bus, device, logged, read_number

mcp = FastMCP("bench")


class Temperature(BaseModel):
    """A reading; celsius is in degrees Celsius."""

    celsius: float


@mcp.tool(
    annotations={
        "readOnlyHint": True,
        "destructiveHint": False,
        "idempotentHint": True,
        "openWorldHint": False,
    }
)
@logged
def read_temperature(digits: Annotated[int, Field(ge=0, le=3)] = 1) -> Temperature:
    """Read the board temperature in degrees Celsius."""
    with bus("hwmon-benchtemp"):
        value = read_number(device("hwmon-benchtemp").path("hwmon") / "temp1_input")
        if value is None:
            raise ToolError("the board's sensor gives no reading now")
        return Temperature(celsius=round(value / 1000, digits))


if __name__ == "__main__":
    mcp.run(show_banner=False)
