"""A tool for each way in which a tool can be wrong, all of one server, so that one check sees them all."""

from unit.endpoint.endpoint_servers import CLOCK, HEADER, VOLTAGE, tool

PLAIN = {**VOLTAGE, "input_schema": {"type": "object", "properties": {}}}
NEEDS_WORD = {"type": "object", "properties": {"word": {"type": "string"}}, "required": ["word"]}
OF_TWO = {
    "type": "object",
    "properties": {"device": {"type": "string", "enum": ["first", "second"]}},
    "required": ["device"],
}

PICTURE = """import struct, zlib
def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
rows = b"".join(bytes([0, *{row}]) for y in range(16))
head = struct.pack(">IIBBBBB", 16, 16, 8, 0, 0, 0, 0)
start = bytes([137, 80, 78, 71, 13, 10, 26, 10])
png = start + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
return Image(data=png, format="png")"""

LIE = tool('return ToolResult(content="x", structured_content={"volts": "many"})', name="lie", returns="ToolResult")
SLEEPER = "import subprocess\nsubprocess.Popen(['sleep', '77'], start_new_session=True)\nreturn 1.0"

ANIMALS = {
    "missing_library": tool("import no_such_library\nreturn 1.0", name="missing_library"),
    "missing_attribute": tool("import json\nreturn json.VideoCapture(0)", name="missing_attribute"),
    "missing_name": tool("return undefined_name", name="missing_name"),
    "missing_key": tool("return {}['volts']", name="missing_key"),
    "not_permitted": tool("raise PermissionError(13, 'not permitted', 'ttyS0')", name="not_permitted"),
    "absent": tool("raise runtime.DeviceAbsent('usb-0000-0000', 'it is not connected')", name="absent"),
    "busy": tool("raise runtime.BusBusy('i2c-1', 'in use')", name="busy"),
    "lie": LIE.replace(
        "annotations=READ",
        "annotations=READ, output_schema={'type': 'object', 'properties': {'volts': {'type': 'number'}}}",
    ),
    "silent": tool("return 1.0", name="silent", logged=False),
    "dark": tool(PICTURE.replace("{row}", "[16] * 16"), name="dark", returns="Image"),
    "bright": tool(PICTURE.replace("{row}", "range(0, 160, 10)"), name="bright", returns="Image"),
    "needy": tool("return 1.0", name="needy", head="word: str"),
    "leaves_a_process": tool(SLEEPER, name="leaves_a_process"),
    "no_program": tool("import subprocess\nsubprocess.run(['lampctl'], timeout=5)\nreturn 1.0", name="no_program"),
    "no_answer": tool(
        "import socket\nsocket.create_connection(('127.0.0.1', 9), timeout=2)\nreturn 1.0", name="no_answer"
    ),
    "scorching": tool(
        "return ToolResult(content='x', structured_content={'temperature_degc': 53125})",
        name="scorching",
        returns="ToolResult",
    ),
    "mistaken": tool(
        "return ToolResult(content='x', structured_content={'device': 'other', 'value': 1.0})",
        name="mistaken",
        returns="ToolResult",
    ),
    "frozen": tool(
        "import itertools\n"
        "counter = globals().setdefault('counter', itertools.count(1))\n"
        "file = __import__('pathlib').Path(__import__('os').environ['HOME'], 'frozen')\n"
        "file.write_text(str(1000 * next(counter)))\nruntime.read_number(file)\nreturn 21.5",
        name="frozen",
    ),
    "of_two": tool(
        "if device == 'second':\n    raise ValueError('only the first')\nreturn 1.0",
        name="of_two",
        head="device: str",
    ),
    "noisy": tool("import os\nos.write(1, b'noise')\nprint('more')\nreturn 1.0", name="noisy"),
}

SOURCE = "".join(
    [
        HEADER,
        "\nprint('loading')\n",
        *ANIMALS.values(),
        tool("raise KeyError('moved')", name="mover"),
        tool("return 1.0", name="extra"),
    ]
)
TOOLS = (
    CLOCK,
    *({**PLAIN, "name": name, "devices": ["one"]} for name in ANIMALS if name not in ("needy", "of_two")),
    {**PLAIN, "name": "of_two", "devices": ["first", "second"], "input_schema": OF_TWO},
    {**PLAIN, "name": "needy", "input_schema": NEEDS_WORD},
    {**PLAIN, "name": "mover", "effect": "actuate"},
    {**PLAIN, "name": "promised", "devices": ["other"]},
)
"""The interface: it knows no ``extra``, and promises one tool that the server lacks."""
