"""Commands that use the endpoint, or add it to other programs: tools, call, look, connect, clients.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

import shlex
import sys
from functools import partial
from itertools import islice
from pathlib import Path

from octoform.cli import table
from octoform.cli.table import Arguments, Json, duration, flag, operand, operands, option, optional, repeated, setting
from octoform.diagnostics import error

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator

    from octoform.cli.dispatch import Run
    from octoform.diagnostics import Diagnostic
    from octoform.endpoint.client.terminal import Person
    from octoform.endpoint.mcp_clients.install import Outcome
    from octoform.engine.look import Eye, Look

_START = "start the endpoint even after `octoform stop`; otherwise only `start` and `apply` do so"
_CLIENT = "an MCP client, such as claude-code, codex or vscode"
_SHORTEST = 1.0


class ToolsArguments(Json):
    """Of ``tools``."""

    tools: list[str] = operands("TOOL", "a tool to show (default: all)")
    start: bool = flag(_START)


def run_tools(arguments: ToolsArguments, run: Run) -> int:
    """Asks the endpoint itself, not a file."""
    from octoform.engine.tools import tools
    from octoform.views.endpoint import tools as view

    wait = partial(view.starting, run.screen)
    return run.answer(tools(*run.here, wait, names=arguments.tools, revive=arguments.start), view.tools)


class CallArguments(Arguments):
    """Of ``call``."""

    tool: str | None = optional("TOOL", "the tool (default: a read-only tool, as an example)")
    arg: list[str] = repeated("NAME=VALUE", "argument; repeatable")
    json_arguments: str | None = option(
        str, "OBJECT", "all arguments as one JSON object; also makes the output JSON", "-json", "--json", empty=""
    )
    timeout: float = setting(duration, "DURATION", "give up after DURATION", default="60s")
    dry_run: bool = flag("report what the call would do, and do nothing")
    auto_approve: bool = flag("confirm calls for which the policy requires consent")
    start: bool = flag(_START)

    @property
    def as_json(self) -> bool:
        """Also where there are no arguments in JSON."""
        return self.json_arguments is not None


def run_call(arguments: CallArguments, run: Run) -> int:
    """Exit code 1 when the tool answered with an error."""
    from octoform.endpoint.client.jsonrpc import ToolCall
    from octoform.engine.tools import answered, call, example, tools
    from octoform.views.endpoint import tools as view

    tool, pairs, document = arguments.tool, arguments.arg, arguments.json_arguments or None
    if tool is None:
        if pairs or document:
            raise table.UsageError("arguments need the name of their tool: octoform call TOOL -arg NAME=VALUE")
        listed, found = tools(*run.here, partial(view.starting, run.screen), revive=arguments.start)
        shown = example(listed or (), answered(*run.here))
        if listed == [] and not run.as_json:
            return view.tools(run.screen, listed, as_json=False)  # a host with nothing to call is no failure
        if listed is None:
            return run.show(*found)
        if shown is None:
            hint = "octoform tools lists them; octoform call TOOL -arg NAME=VALUE calls one"
            text = "no tool here only reads and needs nothing but a choice"
            return run.show(error("ENDPOINT-NO-EXAMPLE", text, hint=hint))
        tool, pairs = shown
        typed = shlex.join([tool, *(word for pair in pairs for word in ("-arg", pair))])
        run.screen.problem(f"octoform: an example: octoform call {typed}")
    approved = arguments.auto_approve
    seconds, dry_run, revive = arguments.timeout, arguments.dry_run, arguments.start
    wanted = ToolCall(tool, seconds=seconds, dry_run=dry_run, approved=approved, revive=revive)
    run.ending = f"the call of {tool} was given up"
    with view.attended(run.screen, approved=approved) as person:
        answer = call(*run.here, wanted, person, pairs=pairs, document=document)
    return run.answer(
        answer, lambda screen, made, as_json: view.answer(screen, tool, made, as_json=as_json), noted=True
    )


def _interval(text: str) -> float:
    """Seconds from one look to the next; 0.0 as the manifest has it."""
    length = duration(text) if text else 0.0
    if text and length < _SHORTEST:
        raise ValueError(f"{text} is too often; a picture takes a second at least")
    return length


def _looks(text: str) -> int:
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise ValueError(f"{text!r} is not a number of looks")
    return int(text)


class LookArguments(Json):
    """Of ``look``."""

    device: str | None = option(
        str, "ID", "look through this camera (default: the one of the step perceive, else the best)"
    )
    save: str | None = option(table.file_name, "FILE", "write the picture to FILE; with -every each name gets a number")
    every: float | None = option(
        _interval,
        "DURATION",
        "take a picture every DURATION until Ctrl-C (default: the interval in octopus.yaml)",
        empty="",
    )
    count: int | None = option(_looks, "N", "end after N pictures; only with -every")


def run_look(arguments: LookArguments, run: Run) -> int:
    """0 for a picture that shows something, 1 for none, 2 for one that shows nothing; with -every that of the last."""
    from octoform.engine.look import open_eye
    from octoform.views.endpoint.tools import attended

    interval = arguments.every
    if arguments.count is not None and interval is None:
        raise table.UsageError("-count limits the pictures of -every; without -every there is one picture")
    eye, found = open_eye(*run.here, arguments.device)
    if eye is None:
        return run.show(*found)
    run.note(*found)
    if interval == 0.0 and not eye.settings.enabled:
        hint = "write perception: {enabled: true} into octopus.yaml, or give the interval: -every 30s"
        return run.show(error("PERCEPTION-OFF", "octoform may not look by itself at this host", hint=hint))
    status = 0
    run.ending = ""
    with attended(run.screen, approved=False) as person:
        for number, seen in enumerate(_pictures(eye, interval, arguments.count, person), 1):
            person.clear()
            path = _path(arguments.save, number if interval is not None else 0)
            status = _print_look(run, seen, path)
    return status


def _pictures(eye: Eye, interval: float | None, count: int | None, person: Person) -> Iterator[Look]:
    from octoform.engine.look import heartbeat, look

    if interval is None:
        return iter((look(eye, person),))
    return islice(heartbeat(eye, interval or eye.settings.interval, person), count)


def _print_look(run: Run, seen: Look, path: Path | None) -> int:
    """The look with its picture saved; a picture that can't be written is an error whatever it shows."""
    from octoform.engine.look import save
    from octoform.perception.capture import Taken
    from octoform.views.endpoint import tools as view

    problem = save(seen.outcome, path.absolute()) if path is not None and isinstance(seen.outcome, Taken) else None
    saved = path if isinstance(seen.outcome, Taken) and problem is None else None
    status = view.one(run.screen, seen, saved, as_json=run.as_json)
    return max(status, run.note(problem)) if problem is not None else status


def _path(text: str | None, number: int) -> Path | None:
    """Where a picture goes: ``shot.jpg``, and of a row of looks ``shot-0001.jpg``."""
    if text is None:
        return None
    path = Path(text)
    return path.with_name(f"{path.stem}-{number:04d}{path.suffix}") if number else path


def _transport(text: str) -> str:
    from octoform.engine.clients import TRANSPORTS

    if text not in TRANSPORTS:
        raise ValueError(f"{text!r} is neither {' nor '.join(TRANSPORTS)}")
    return text


class Transport(Arguments):
    """What the commands that write a client's configuration have in common."""

    transport: str | None = option(_transport, "KIND", "stdio or http (default: what the scope calls for)")


class ConnectArguments(Transport):
    """Of ``connect``."""

    host: str | None = optional("HOST", "the host (default: the only one of this project)")
    print: str | None = option(str, "CLIENT", f"print the configuration for {_CLIENT}; connect to nothing")
    start: bool = flag(_START)


def run_connect(arguments: ConnectArguments, run: Run) -> int:
    """Exit code 0 when the client closed the connection, 1 when the endpoint did or never came up."""
    if arguments.print is not None:
        # The text alone on standard output, what to know on standard error.
        from octoform.engine import clients as engine
        from octoform.views.endpoint import process

        text, found = engine.printed(*run.here, arguments.print, arguments.host, arguments.transport)
        if text is None:
            return run.show(*found)
        run.note(*found)
        return process.printed(run.screen, text)
    from octoform.endpoint.dial import connect

    problem = connect(run.project, arguments.host, revive=arguments.start)
    if problem is None:
        return 0
    # Standard output belongs to the protocol.
    print(f"octoform: {problem}", file=sys.stderr)
    return 1


def run_clients_list(_: Json, run: Run) -> int:
    """The clients, their files, and which of them have the endpoint."""
    from octoform.engine.clients import listed
    from octoform.views.endpoint.process import listing

    clients, found = listed(*run.here)
    return run.answer((clients, found), partial(listing, diagnostics=found))


class ClientArguments(Json, Transport):
    """Of ``clients install`` and ``clients remove``."""

    client: str = operand(str, "CLIENT", _CLIENT)


def run_clients_install(arguments: ClientArguments, run: Run) -> int:
    """Exit code 1 when a file was left alone."""
    from octoform.engine.clients import install

    return _show_outcome(run, *install(*run.here, arguments.client, arguments.transport))


def run_clients_remove(arguments: ClientArguments, run: Run) -> int:
    """Exit code 1 when a file was left alone."""
    from octoform.engine.clients import remove

    return _show_outcome(run, *remove(*run.here, arguments.client))


def _show_outcome(run: Run, done: Outcome | None, found: list[Diagnostic]) -> int:
    from octoform.views.endpoint.process import outcome

    return run.answer((done, found), partial(outcome, diagnostics=found))
