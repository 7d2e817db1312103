"""The stage: the INTERFACE artifact in, ``server.py`` out.

The same artifact always gives the same bytes. Types and parameters are written from the artifact's own schemas, so the
server's schemas are equal to them by construction; the templates hold only what a tool does.
"""

import ast
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from octoform.base.source_lines import counted
from octoform.builtin.classes.outputs import BREAKOUT_DRIVERS, HEADER_NAME
from octoform.builtin.serve import lines, registers
from octoform.builtin.serve.functions import Shapes, annotation_names, heading, registration
from octoform.builtin.task import Profiles, Task, TaskRefused

# Puts the server together: header, imports, types, and the sections of the classes that are needed.
#
# What is imported follows from what the sections use, so no section has to know of another. Heavy: imports jinja2.

TEMPLATES = Path(__file__).parent / "templates"
SECTIONS: Mapping[str, tuple[str, ...]] = {
    "camera": ("capture_image", "list_camera_formats", "list_video_codecs", "read_focus", "set_focus"),
    "audio": ("record_audio", "play_audio"),
    "sensors": (
        *("read_temperature", "read_fan_speed", "read_voltage", "read_current", "read_power", "read_energy"),
        *("read_humidity", "read_acceleration", "read_angular_velocity", "read_magnetic_field", "read_illuminance"),
        *("read_pressure", "read_proximity", "read_angle", "read_orientation", "read_inclination", "read_gravity"),
        *("read_distance", "read_velocity", "read_steps", "read_light_intensity", "read_uv_index", "read_ph"),
        *("read_gas", "read_mass_concentration", "read_conductivity", "read_resistance"),
        *("read_capacitance", "read_sensor_channels"),
    ),
    "counters": ("read_counters",),
    "position": ("read_position",),
    "power": ("read_battery", "read_power_supply"),
    "light": ("read_brightness", "set_brightness", "read_led", "set_led"),
    "gpio": ("read_gpio_lines", "read_gpio_line", "set_gpio_line"),
    "outputs": ("read_output_channels", "set_output_channel"),
    "inputs": ("describe_input", "read_input_events", "play_rumble"),
    "printer": ("read_printer_status",),
    "storage": ("read_storage",),
    "display": ("read_display",),
    "network": ("read_network_interfaces", "read_bluetooth"),
    "clock": ("read_clock",),
}
"""Template name to the capabilities that it implements, in the order of the server."""

_MODULES = (
    "array",
    "ctypes",
    "errno",
    "fcntl",
    "io",
    "math",
    "os",
    "re",
    "select",
    "struct",
    "sys",
    "time",
    "wave",
)
_FROM: Mapping[str, tuple[str, ...]] = {
    "collections.abc": ("Callable", "Iterable", "Iterator"),
    "contextlib": ("contextmanager",),
    "pathlib": ("Path",),
    "typing": ("Annotated", "Any", "Literal"),
    "fastmcp": ("FastMCP",),
    "fastmcp.exceptions": ("ToolError",),
    "fastmcp.tools": ("ToolResult",),
    "fastmcp.utilities.types": ("Audio", "Image"),
    "pydantic": ("Field", "TypeAdapter"),
    "typing_extensions": ("TypedDict",),
}
_STANDARD = ("collections.abc", "contextlib", "pathlib", "typing")
_REQUIREMENTS: Mapping[str, str] = {
    "fastmcp": "fastmcp>=4.1,<4.2",
    "pydantic": "pydantic>=2.12,<3",
    "typing_extensions": "typing-extensions>=4.12",
    "cv2": "opencv-python-headless>=4.10",
    "serial": "pyserial>=3.5,<4",
}


def assemble(tools: Sequence[Mapping[str, Any]], profiles: Profiles = ()) -> str:
    """The file for these tools; TaskRefused for a capability without a template or a protocol definition."""
    by_capability = {tool["capability"]: tool for tool in tools}
    known = {name for names in SECTIONS.values() for name in names}
    spoken = lines.commands(by_capability, profiles)
    if strange := sorted(by_capability.keys() - known - spoken.keys()):
        raise TaskRefused(f"no template implements {', '.join(strange)}")
    shapes, hints = Shapes(tools), annotation_names(tools)
    base = _rendered("base", hints=hints)
    if shapes.lines:
        base += "\n\n# fmt: off\n" + "\n".join(shapes.lines) + "\n# fmt: on"
    names = [*(name for names in SECTIONS.values() for name in names), *spoken]
    ordered = [by_capability[name] for name in names if name in by_capability]
    end = _rendered("main", lines=[registration(tool, shapes, hints) for tool in ordered])
    sections = _sections(by_capability, shapes)
    on_bus = {name: pair for name, pair in spoken.items() if "registers" in pair[0]["grammar"]}
    on_line = {name: pair for name, pair in spoken.items() if name not in on_bus}
    if on_line:
        sections.append(_rendered("lines", **lines.section(by_capability, on_line, shapes)))
    if on_bus:
        sections.append(_rendered("registers", **registers.section(by_capability, on_bus, shapes)))
    text = "\n\n\n".join([base, *sections, end]) + "\n"
    used = _used(text)
    known_as = {**_REQUIREMENTS, **registers.libraries(on_bus)}
    requirements = [requirement for name, requirement in known_as.items() if name in used]
    return f"{_rendered('header', requirements=requirements, count=len(tools))}\n\n{_imports(used)}\n\n{text}"


def _sections(by_capability: Mapping[str, Mapping[str, Any]], shapes: Shapes) -> list[str]:
    """The code of each class of device that has a tool."""

    def head(capability: str) -> str:
        return heading(by_capability[capability], shapes)

    return [
        _rendered(name, tools=by_capability, head=head, sources=sources, breakouts=BREAKOUT_DRIVERS, header=HEADER_NAME)
        for name, capabilities in SECTIONS.items()
        if by_capability.keys() & set(capabilities)
    ]


def _rendered(template: str, **names: Any) -> str:
    return _environment().get_template(f"{template}.py.j2").render(**names).strip()


@cache
def _environment() -> Environment:
    """The templates, compiled once per process."""
    return Environment(
        loader=FileSystemLoader(TEMPLATES),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def sources(tool: Mapping[str, Any]) -> set[str]:
    """The kernel interfaces that a measurement comes from, as INTERFACE noted them; all when it did not."""
    note = str(tool["output_schema"].get("$comment", ""))
    text = note.removeprefix("sources: ") if note.startswith("sources: ") else "hwmon, thermal, iio"
    return set(text.split(", "))


def _used(text: str) -> set[str]:
    """Every name in the code, and every module that it imports itself."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Name):
            names.add(node.id)
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    names.update(module for module, members in _FROM.items() if names & set(members))
    return names


def _imports(used: set[str]) -> str:
    standard = [f"import {name}" for name in _MODULES if name in used]
    standard += [_from(module, used) for module in _FROM if module in _STANDARD and module in used]
    third = [_from(module, used) for module in _FROM if module not in _STANDARD and module in used]
    return "\n\n".join("\n".join(group) for group in (standard, third, ["import runtime"]) if group)


def _from(module: str, used: set[str]) -> str:
    return f"from {module} import {', '.join(name for name in _FROM[module] if name in used)}"


MAX_LINES = 500


def run(task: Task) -> str:
    """Write server.py; the summary line (``server.py: 9 tools, 213 lines``).

    TaskRefused states why there can be none.
    """
    interface = task.read_input()
    text = render(interface, task.profiles)
    task.write(text)
    tools = len(interface["tools"])
    return f"server.py: {tools} tool{'s' * (tools != 1)}, {text.count(chr(10))} lines"


def render(interface: Mapping[str, Any], profiles: Profiles = ()) -> str:
    """The server's source; TaskRefused for a tool without a template, and for a server that is too long."""
    try:
        text = assemble(interface["tools"], profiles)
        ast.parse(text)
    except (KeyError, TypeError, AttributeError, SyntaxError) as problem:
        raise TaskRefused(
            f"the INTERFACE artifact cannot be rendered: {type(problem).__name__}: {problem}"
        ) from problem
    if (count := len(counted(text))) > MAX_LINES:
        raise TaskRefused(
            f"the server would have {count} lines, more than {MAX_LINES}; lower budget.tools in the manifest"
        )
    return text


def line_count(tools: Sequence[Mapping[str, Any]], profiles: Profiles = ()) -> int:
    """How many lines a person has to read of a server of these tools."""
    return len(counted(assemble(tools, profiles)))
