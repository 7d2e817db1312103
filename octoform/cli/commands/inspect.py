"""Commands that look: status, health, incidents, logs, devices, coverage, the state; and on octoform itself.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

from contextlib import closing
from functools import partial
from pathlib import Path

from octoform.cli import table
from octoform.cli.table import Arguments, Json, flag, number_of, operand, operands, option, optional, setting

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator

    from octoform.cli.dispatch import Run


class StatusArguments(Json):
    """Of ``status``."""

    more = "octoform health"


def run_status(_: StatusArguments, run: Run) -> int:
    """0 only in sync and healthy; 3 to 6 as ``health`` leaves; 1 out of sync, or where it cannot be determined."""
    from octoform.daemon.status import survey
    from octoform.engine.project_status import status
    from octoform.views.daemon import status as view

    found = status(*run.here)
    surveyed, problems = survey(*run.here)
    if surveyed is None:
        return run.show(*(found.diagnostics if found.sync is None else problems))
    show = view.uncompared if found.sync is None else view.status
    return show(run.screen, found, surveyed, as_json=run.as_json)


class HealthArguments(Json):
    """Of ``health``."""

    epilog = table.HEALTH_CODES.format("")


def run_health(_: HealthArguments, run: Run) -> int:
    """0 healthy, 3 degraded, 4 error, 5 down, 6 unknown; 1 where it cannot be determined at all."""
    from octoform.daemon.status import survey
    from octoform.views.daemon.health import health

    return run.answer(survey(*run.here), health)


class IncidentsArguments(Json):
    """Of ``incidents``."""

    n: int = setting(number_of("incidents"), "COUNT", "show the latest COUNT incidents", default="20")


def run_incidents(arguments: IncidentsArguments, run: Run) -> int:
    """Exit code 0, whatever went wrong."""
    from octoform.daemon.store.incidents import read
    from octoform.daemon.store.json_store import Shelf
    from octoform.views.daemon import event_log as view

    shelf = Shelf(run.layout)
    incidents = read(shelf) if run.layout.daemon.is_dir() else []
    return view.listed(run.screen, incidents, shelf.said, arguments.n, as_json=run.as_json)


class IncidentArguments(Json):
    """Of ``incidents show``."""

    incident: str = operand(str, "N", "its id or its number, as `octoform incidents` lists it")


def run_incidents_show(arguments: IncidentArguments, run: Run) -> int:
    """Exit code 1 where it is not kept."""
    from octoform.daemon.status import incident
    from octoform.views.daemon import health as view

    found, noted = incident(*run.here, arguments.incident)
    return run.answer((found, noted), partial(view.incident, diagnostics=noted))


class LogsArguments(Json):
    """Of ``logs``."""

    follow: bool = flag("keep printing new lines", "-f", "--follow")
    n: int = setting(number_of("lines"), "LINES", "show the latest LINES lines", default="50")


def run_logs(arguments: LogsArguments, run: Run) -> int:
    """Exit code 0; with ``-f`` that of the signal which ended it, since nothing else does."""
    from octoform.engine.inspect import state as engine
    from octoform.views.endpoint import logs as view

    logs, found = engine.open_logs(*run.here)
    if logs is None:
        return run.show(*found)
    run.ending = ""
    with closing(logs):
        if run.as_json:
            lines = logs.read()
            view.machine(run.screen, lines[max(0, len(lines) - arguments.n) :])
            for more in engine.lines(logs, view.Reader(run.screen).waits) if arguments.follow else ():
                view.machine(run.screen, more)
            return 0
        entries, pairing = engine.entries(logs)
        view.human(run.screen, entries[max(0, len(entries) - arguments.n) :])
        if not entries and not arguments.follow:
            view.nothing(run.screen)
        for new in engine.following(logs, pairing, view.Reader(run.screen).waits) if arguments.follow else ():
            view.human(run.screen, new)
    return 0


class DevicesArguments(Json):
    """Of ``devices``."""

    v: bool = flag("also serial numbers, evidence, doubts, and skipped devices with the reason")


def run_devices(arguments: DevicesArguments, run: Run) -> int:
    """Works without an endpoint; exit code 1 where no IDENTIFY artifact was accepted yet."""
    from octoform.engine.inspect.devices import listing
    from octoform.views import devices

    return run.answer(listing(*run.here), partial(devices.show, verbose=arguments.v), noted=not run.as_json)


class CoverageArguments(Json):
    """Of ``coverage``."""

    html: str | None = option(table.file_name, "FILE", "write the report as an HTML page instead")
    all: bool = flag("also every skipped device, every disagreement, every run")


def run_coverage(arguments: CoverageArguments, run: Run) -> int:
    """The report, on the terminal or as a page; reads only, but for the page."""
    from octoform.engine import coverage as engine
    from octoform.views import coverage as view

    report, found = engine.report(*run.here)
    if report is None or arguments.html is None:
        show = partial(view.show, everything=arguments.all)
        return run.answer((report, found), show, noted=not run.as_json)
    if not run.as_json:
        run.note(*found)
    path = Path(arguments.html)
    problem = engine.save(path.absolute(), view.page(report))
    return run.show(problem) if problem is not None else view.written(run.screen, path, as_json=run.as_json)


class ShowArguments(Json):
    """Of ``show``."""

    planfile: str | None = optional("PLANFILE", "a plan saved with `plan -out`")


def run_show(arguments: ShowArguments, run: Run) -> int:
    """Show it; nothing is compared and nothing is changed."""
    from octoform.engine.inspect.state import open_project, saved_plan
    from octoform.views import state
    from octoform.views.format.output import JsonStream
    from octoform.views.plan import PlanHuman, PlanJson

    if arguments.planfile:
        plan, found = saved_plan(Path(arguments.planfile).absolute())
        if plan is not None:
            (PlanJson(JsonStream(run.screen)) if run.as_json else PlanHuman(run.screen)).show(plan)
        return run.note(*found)
    opened, found = open_project(*run.here)
    return run.answer((None if opened is None else opened.snapshot, found), state.show, noted=True)


def run_state_list(_: Json, run: Run) -> int:
    """The nodes of the state."""
    from octoform.engine.inspect.state import open_project
    from octoform.views import state

    opened, found = open_project(*run.here)
    return run.answer((None if opened is None else opened.snapshot, found), state.listing)


class NodeArguments(Json):
    """Of the verbs on one node."""

    node: str = operand(str, "NODE")


def run_state_show(arguments: NodeArguments, run: Run) -> int:
    """One node of the state."""
    from octoform.engine.inspect.state import node_of, open_project
    from octoform.views import state

    opened, found = open_project(*run.here)
    if opened is None:
        return run.show(*found)
    node, found = node_of(opened.snapshot, arguments.node)
    return run.show(*found) if node is None else state.node(run.screen, arguments.node, node, as_json=run.as_json)


def run_state_rm(arguments: NodeArguments, run: Run) -> int:
    """Its artifact file stays."""
    from octoform.engine.inspect.state import forget
    from octoform.views import state

    status = run.show(*forget(*run.here, arguments.node))
    return status or state.forgotten(run.screen, arguments.node, as_json=run.as_json)


def run_state_adopt(arguments: NodeArguments, run: Run) -> int:
    """Verifies the artifact first."""
    from octoform.engine.inspect.state import accept
    from octoform.views import state

    status = run.show(*accept(*run.here, arguments.node))
    return status or state.adopted(run.screen, arguments.node, as_json=run.as_json)


class GraphArguments(Arguments):
    """Of ``graph``."""

    type: str = setting(str, "KIND", "the drawing language: dot or mermaid", default="dot", choices=("dot", "mermaid"))


def run_graph(arguments: GraphArguments, run: Run) -> int:
    """DOT or mermaid on standard output."""
    from octoform.engine.plan.configuration import compile_project
    from octoform.graph.model import to_dot, to_mermaid
    from octoform.views.format import output

    compiled, found = compile_project(*run.here)
    if compiled is None:
        return run.show(*found)
    return output.plain(run.screen, (to_dot if arguments.type == "dot" else to_mermaid)(compiled.graph))


class ExplainArguments(Json):
    """Of ``explain``."""

    code: str | None = optional("CODE", "a code such as IDENTIFY-INVENTED-DEVICE (default: list all codes)")


def run_explain(arguments: ExplainArguments, run: Run) -> int:
    """The page of a code, or the list of all codes."""
    from octoform.diagnostics import codes, page_of, unknown_code
    from octoform.views.format import output

    if arguments.code is None:
        return output.codes(run.screen, codes(), as_json=run.as_json)
    code = arguments.code.upper()
    text = page_of(code)
    return run.show(unknown_code(code)) if text is None else output.page(run.screen, code, text, as_json=run.as_json)


def run_schema(_: Arguments, run: Run) -> int:
    """The schema that editors use."""
    from octoform.manifest.schema.document import json_schema
    from octoform.views.format import output

    return output.document(run.screen, json_schema())


class HelpArguments(Arguments):
    """Of ``help``."""

    words: list[str] = operands("COMMAND")


def run_help(arguments: HelpArguments, run: Run) -> int:
    """Prints what ``octoform COMMAND --help`` prints."""
    from octoform.cli.dispatch import show_help

    return show_help(arguments.words, run)


def run_version(_: Json, run: Run) -> int:
    """Exit code 0."""
    from octoform.views.format import problems

    return problems.version(run.screen, as_json=run.as_json)


# Scripts by which a shell completes octoform's commands, verbs and options.
#
# They hold all words by themselves: pressing a key must not start Python. They are made from the table and what the
# commands declare, so that they cannot differ from ``--help``.

_BASH = """\
# octoform: source <(octoform completion bash)
_octoform() {{
    local word place="" skip="" words=""
    for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
        if [ -n "$skip" ]; then skip=""; continue; fi
        case "$word" in
            -chdir|--chdir) skip=1 ;;
            -*) ;;
            *) case " {places} " in *" ${{place:+$place/}}$word "*) place="${{place:+$place/}}$word" ;; esac ;;
        esac
    done
    case "$place" in
{cases}
    esac
    COMPREPLY=($(compgen -W "$words" -- "${{COMP_WORDS[COMP_CWORD]}}"))
    [ ${{#COMPREPLY[@]}} -gt 0 ] || COMPREPLY=($(compgen -f -- "${{COMP_WORDS[COMP_CWORD]}}"))
}}
complete -o filenames -F _octoform octoform"""
_ZSH = """\
# octoform: source <(octoform completion zsh)
autoload -U +X compinit && compinit -u
autoload -U +X bashcompinit && bashcompinit
"""


class CompletionArguments(Arguments):
    """Of ``completion``."""

    shell: str = operand(str, "SHELL", "bash, zsh or fish", choices=("bash", "zsh", "fish"))


def run_completion(arguments: CompletionArguments, run: Run) -> int:
    """Prints the script; exit code 0."""
    run.screen.line(script(arguments.shell))
    return 0


def script(shell: str) -> str:
    """The script for ``bash``, ``zsh`` or ``fish``."""
    if shell == "fish":
        return "\n".join(_fish())
    places = dict(_places())
    cases = "\n".join(f'        "{place}") words="{" ".join(words)}" ;;' for place, words in places.items())
    bash = _BASH.format(places=" ".join(filter(None, places)), cases=cases)
    return _ZSH + bash if shell == "zsh" else bash


def _places() -> Iterator[tuple[str, list[str]]]:
    """Each command, a verb behind a slash, with the words that may follow."""
    yield "", [*(each.name for each in table.COMMANDS if " " not in each.name), *(f"-{name}" for name in table.OPTIONS)]
    for each in table.COMMANDS:
        choices = [word for _, argument in _arguments(each) for word in argument.given.get("choices") or ()]
        yield each.name.replace(" ", "/"), [*each.verbs(), *choices, *(name for name, _ in _options(each))]


def _arguments(command: table.Command) -> Iterator[tuple[str, table.Argument]]:
    from octoform.cli.dispatch import arguments_of

    return iter(()) if table.HEADING in command.traits else arguments_of(command).declared()


def _options(command: table.Command) -> Iterator[tuple[str, str]]:
    """The options in their first form, each with its help."""
    yield "-h", table.OPTIONS["h"][1]
    yield from (
        (each.names(name)[0], each.given["help"]) for name, each in _arguments(command) if each.forms is not None
    )


def _fish() -> Iterator[str]:
    yield "# octoform: octoform completion fish | source"
    top = "-n __fish_use_subcommand"
    for each in table.COMMANDS:
        first, _, verb = each.name.partition(" ")
        place = f"-n '__fish_seen_subcommand_from {first}'" if verb else top
        yield f"complete -c octoform {place} -a {verb or first} -d {_quoted(each.help)}"
    yield from (f"complete -c octoform {top} -o {name} -d {_quoted(text)}" for name, (_, text) in table.OPTIONS.items())
    for each in table.COMMANDS:
        seen = f"-n '__fish_seen_subcommand_from {each.name.split()[-1]}'"
        for option_name, text in _options(each):
            yield f"complete -c octoform {seen} -o {option_name.lstrip('-')} -d {_quoted(text)}"


def _quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"
