"""What moves when the process gets a signal to end may first make its device stand."""

import asyncio
from pathlib import Path

from launched import launched, tool
from raw_mcp import RawClient, call

from octoform.endpoint.process import start_stop

SOURCE = """
import os, time
from fastmcp import FastMCP
mcp = FastMCP("bench")

def hold() -> None:
    end = time.monotonic() + 0.8
    while time.monotonic() < end:
        try:
            time.sleep(0.05)
        except BaseException:
            pass
    os.rename("PLACE/moves", "PLACE/stands")

@mcp.tool
def move() -> None:
    try:
        open("PLACE/moves", "w").close()
        while True:
            time.sleep(0.05)
    finally:
        hold()
"""


def test_what_moves_is_made_to_stand_before_the_process_ends(tmp_path: Path) -> None:
    async def scenario() -> None:
        with launched(tmp_path, SOURCE.replace("PLACE", str(tmp_path)), [tool("move", "actuate")]) as endpoint:
            async with RawClient(endpoint.layout.socket) as client:
                asking = asyncio.create_task(client.ask(call("move"), 20))
                async with asyncio.timeout(30):
                    while not (tmp_path / "moves").exists():
                        await asyncio.sleep(0.01)
                stopped = await asyncio.to_thread(start_stop.stop, endpoint.layout)
                asking.cancel()
            assert stopped.process is not None and not stopped.firmly
            assert (tmp_path / "stands").exists()

    asyncio.run(scenario())
