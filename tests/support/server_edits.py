"""Changes of the server that the embedded agent writes for a desk: other bodies, more definitions, more imports."""

import ast
import re
import textwrap
from collections.abc import Callable
from functools import lru_cache

Edit = Callable[[str], str]
MAIN = '\n\nif __name__ == "__main__":'
ASKED = 'runtime.device("hwmon-benchtemp")'
FILE = f'{ASKED}.path("hwmon") / "temp1_input"'


class Absent(LookupError):
    """The server has not what an edit is about."""


@lru_cache(maxsize=4)
def functions(source: str) -> dict[str, ast.FunctionDef]:
    """The functions of a server that are no methods, by name."""
    return {item.name: item for item in ast.parse(source).body if isinstance(item, ast.FunctionDef)}


def complete(source: str) -> str:
    """The server, unless it uses what a larger one imports: of an unknown name nothing is known to be wrong."""
    for name in ("re", "time", "Path"):
        used = re.search(rf"\b{name}[.(]", source)
        if used and not re.search(rf"^\s*(?:import|from \S+ import)\b.*\b{name}\b", source, re.MULTILINE):
            raise Absent(name)
    if "opencv" not in source and re.search(r"\bimport (?:cv2|numpy)\b", source):
        raise Absent("opencv")
    return source


def body(name: str, text: str) -> Edit:
    """The function of this name with other statements below its docstring."""

    def edit(source: str) -> str:
        function = functions(source).get(name)
        if function is None:
            raise Absent(name)
        kept = source.splitlines()
        first = function.body[1] if ast.get_docstring(function) else function.body[0]
        lines = textwrap.indent(textwrap.dedent(text).strip("\n"), "    ").splitlines()
        return "\n".join([*kept[: first.lineno - 1], *lines, *kept[function.end_lineno :]]) + "\n"

    return edit


def swap(old: str, new: str) -> Edit:
    def edit(source: str) -> str:
        if old not in source:
            raise Absent(old)
        assert source.count(old) == 1, (old, source.count(old))
        return source.replace(old, new)

    return edit


def all_of(*edits: Edit) -> Edit:
    def edit(source: str) -> str:
        for each in edits:
            source = each(source)
        return source

    return edit


def alongside(name: str, edit: Edit) -> Edit:
    """The edit, of a server that has this function as well."""

    def both(source: str) -> str:
        if name not in functions(source):
            raise Absent(name)
        return edit(source)

    return both


def adds(text: str) -> Edit:
    """More definitions before the file's end."""
    return swap(MAIN, f"\n\n{textwrap.dedent(text).strip()}{MAIN}")


def requires(*packages: str) -> Edit:
    """More packages in the header."""
    return swap("# dependencies = [", "# dependencies = [" + "".join(f'"{name}", ' for name in packages))


def uses(*names: str) -> Edit:
    """More imports, and their packages in the header."""
    packages = {"serial": "pyserial"}
    wanted = [packages[name] for name in names if name in packages]
    lines = "".join(f"import {name}\n" for name in names)

    def edit(source: str) -> str:
        above, end, below = source.partition('"""\n\n')
        return f"{above}{end}{lines}{below}"

    return all_of(requires(*wanted), edit)


def warm(expression: str) -> str:
    """The end of `read_temperature`: its result from the expression for degrees Celsius."""
    made = f"Reading(sensor='benchtemp', channel='temp1', label='board', value={expression}, unit='degC')"
    return f"return Readings(device=device, readings=[{made}], unreadable=[])"


def read_by(text: str, expression: str = "value / 1000") -> Edit:
    """`read_temperature` with a way of its own to the value."""
    return body("read_temperature", f"{textwrap.dedent(text).strip()}\n{warm(expression)}")


def line(opened: str, talk: str) -> Edit:
    """`read_temperature` over a serial line."""
    text = f"node = {ASKED}.node('tty')\nwith runtime.bus(device), serial.{opened} as port:\n"
    return all_of(uses("serial", "struct"), read_by(text + textwrap.indent(textwrap.dedent(talk).strip(), "    ")))


ASK = "port.write(b'T?\\n')\nvalue = float(port.readline())"
WHOLE = "Serial(node, 9600, timeout=1)"
CAMERA = """
import cv2
if flush > 60:
    raise ToolError("no more than 60 pictures are thrown away")
with runtime.bus(device):
    camera = cv2.VideoCapture(runtime.device(device).node("video4linux"))
    camera.set(3, width)
    camera.set(4, height)
    {}
    try:
        {}
    finally:
        camera.release()
data = cv2.imencode(".png", frame)[1].tobytes()
facts = {{"width": 1, "height": 1, "format": "png", "size_bytes": len(data)}}
facts |= {{"mean": float(frame.mean()), "variance": float(frame.var())}}
return ToolResult(content=[Image(data=data, format="png")], structured_content=facts)
"""
FLUSHED = "frame = [camera.read()[1] for _ in range(5)][-1]"
