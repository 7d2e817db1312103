"""One SVG of what commands print on a terminal, such as the one at the head of the README.

    .venv/bin/python bench/terminal_picture.py OUT.svg [--folder DIR] [--columns 100] "octoform plan" ...

Each command runs on a pseudo terminal of its own in DIR, one after the other; the picture shows what stands on the
screen at its end, in its colours. Fonts are the reader's own: the picture names none of another server.
"""

import argparse
import fcntl
import io
import os
import pty
import shlex
import struct
import subprocess
import sys
import termios
from pathlib import Path

import pyte
from rich.color import ColorParseError
from rich.console import Console
from rich.style import Style
from rich.terminal_theme import MONOKAI
from rich.text import Text

LINES = 400
_SVG = """<svg class="rich-terminal" viewBox="0 0 {width} {height}" xmlns="http://www.w3.org/2000/svg">
<style>
.{unique_id}-matrix {{ font: {char_height}px/{line_height}px ui-monospace, Menlo,
Consolas, "DejaVu Sans Mono", monospace }}
{styles}
</style>
<defs><clipPath id="{unique_id}-clip-terminal">
<rect x="0" y="0" width="{terminal_width}" height="{terminal_height}"/>
</clipPath>
{lines}</defs>
{chrome}
<g transform="translate({terminal_x}, {terminal_y})" clip-path="url(#{unique_id}-clip-terminal)">
{backgrounds}
<g class="{unique_id}-matrix">{matrix}</g>
</g>
</svg>
"""
_NAMES = {"brown": "yellow", "brightbrown": "bright_yellow"}
"""Colours that pyte calls otherwise than rich does."""


def main() -> int:
    """Write the picture; 1 where a command ended with an error."""
    given = arguments()
    console = Console(record=True, width=given.columns, file=io.StringIO(), force_terminal=True)
    failed = 0
    for number, command in enumerate(given.commands):
        console.print(Text.assemble("\n" if number else "", ("$ ", "bold green"), (command, "bold")))
        screen, status = shown(command, given.folder, given.columns)
        failed |= status
        for line in lines_of(screen):
            console.print(line, no_wrap=True, overflow="crop")
    svg = console.export_svg(title="octoform", theme=MONOKAI, code_format=_SVG, unique_id="octoform")
    given.out.write_text(svg)
    print(f"{given.out}: {len(given.commands)} commands")
    return 1 if failed else 0


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", metavar="OUT.svg", type=Path)
    parser.add_argument("commands", metavar="COMMAND", nargs="+")
    parser.add_argument("--folder", type=Path, default=Path(), help="where the commands run")
    parser.add_argument("--columns", type=int, default=100)
    return parser.parse_args()


def shown(command: str, folder: Path, columns: int) -> tuple[pyte.Screen, int]:
    """The screen behind a command, and its exit status."""
    screen = pyte.Screen(columns, LINES)
    stream = pyte.ByteStream(screen)
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", LINES, columns, 0, 0))
    bin_ = Path(sys.executable).parent
    environ = {**os.environ, "PATH": f"{bin_}:{os.environ['PATH']}", "TERM": "xterm-256color"}
    with subprocess.Popen(
        shlex.split(command), cwd=folder, env=environ, stdin=slave, stdout=slave, stderr=slave
    ) as process:
        os.close(slave)
        while data := read(master):
            stream.feed(data)
    os.close(master)
    return screen, process.returncode


def read(terminal: int) -> bytes:
    """What comes next; nothing once the command has closed its side, which Linux tells by EIO."""
    try:
        return os.read(terminal, 65536)
    except OSError:
        return b""


def lines_of(screen: pyte.Screen) -> list[Text]:
    """The lines of a screen to the last one that has text, in their colours."""
    last = max((number for number, line in enumerate(screen.display) if line.strip()), default=-1)
    found = []
    for row in range(last + 1):
        text = Text()
        for column in range(screen.columns):
            cell = screen.buffer[row][column]
            text.append(cell.data, style_of(cell))
        text.rstrip()
        found.append(text)
    return found


def style_of(cell: pyte.screens.Char) -> Style:
    """What rich calls the colours of a cell."""
    colour = _NAMES.get(cell.fg, cell.fg.replace("bright", "bright_"))
    try:
        return Style(color=None if colour == "default" else colour, bold=cell.bold, italic=cell.italics)
    except ColorParseError:  # of 256 colours pyte gives six hexadecimal digits
        return Style(color=f"#{cell.fg}", bold=cell.bold)


if __name__ == "__main__":
    sys.exit(main())
