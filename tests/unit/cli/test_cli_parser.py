"""What can be typed: Terraform's single dashes and the usual double ones, durations, and errors with status 1."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from octoform.cli import commands
from octoform.cli.commands.clients import CallArguments
from octoform.cli.commands.main import ApplyArguments, PlanArguments
from octoform.cli.dispatch import Line, arguments_of, function_of
from octoform.cli.main import main
from octoform.cli.parser import parsed
from octoform.cli.table import (
    COMMANDS,
    FORMER,
    GROUPS,
    HEADING,
    Arguments,
    Command,
    UsageError,
    duration,
    overview,
)

CARRIED_OUT = [command for command in COMMANDS if HEADING not in command.traits]


def apply(*words: str) -> ApplyArguments:
    found = Line(words).arguments()
    assert isinstance(found, ApplyArguments)
    return found


@pytest.mark.parametrize("dashes", ["-", "--"])
def test_options_work_with_one_dash_and_with_two(dashes: str) -> None:
    found = apply("apply", f"{dashes}auto-approve", f"{dashes}target", "probe", f"{dashes}target", "serve", "x.plan")
    assert (found.auto_approve, found.target, found.planfile) == (True, ["probe", "serve"], "x.plan")


def test_a_value_may_be_given_after_an_equals_sign() -> None:
    found = Line(["plan", "-out=x.plan", "--target=probe"]).arguments()
    assert isinstance(found, PlanArguments) and (found.out, found.target) == ("x.plan", ["probe"])


@pytest.mark.parametrize(
    ("text", "expected"), [("30s", 30.0), ("1h30m", 5400.0), ("250ms", 0.25), ("1.5m", 90.0), ("0s", 0.0)]
)
def test_durations(text: str, expected: float) -> None:
    assert duration(text) == expected


@pytest.mark.parametrize("text", ["", "30", "soon", "-1s", "1s ", "1d", "1s2"])
def test_what_is_no_duration_is_a_usage_error_that_names_the_option(text: str) -> None:
    with pytest.raises(UsageError, match=r"^-lock-timeout: .* is no duration") as raised:
        apply("apply", f"-lock-timeout={text}")
    assert raised.value.usage.startswith("usage: octoform apply")


@pytest.mark.parametrize(
    "argv",
    [
        ["paln"],
        ["plan", "-nonsense"],
        ["plan", "-targ", "probe"],
        ["destroy", "-auto"],
        ["state"],
        ["-chdir", "/no/such/folder", "plan"],
        ["apply", "-lock-timeout", "soon"],
    ],
)
def test_usage_errors_leave_with_1_and_say_one_thing(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(argv) == 1
    found = capsys.readouterr()
    assert found.err.startswith("octoform: ")
    assert found.out == ""


def test_no_command_shows_the_help_and_leaves_with_1(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 1
    assert "exit codes:" in capsys.readouterr().out


@pytest.mark.parametrize(("words", "given"), [([], None), (["-json"], ""), (["-json", '{"a": 1}'], '{"a": 1}')])
def test_json_of_call_is_an_object_or_only_the_form_of_the_answer(words: list[str], given: str | None) -> None:
    found = Line(["call", "t", *words]).arguments()
    assert isinstance(found, CallArguments)
    assert (found.json_arguments, found.as_json) == (given, given is not None)


def test_each_row_has_its_function_with_its_arguments_and_each_function_is_a_row() -> None:
    modules = {path.stem for path in Path(commands.__file__).parent.glob("*.py") if path.stem != "__init__"}
    assert modules == set(GROUPS) == {command.group for command in COMMANDS}
    functions = [function_of(command) for command in CARRIED_OUT]
    for group in GROUPS:
        written = {
            value for name, value in vars(import_module(f"octoform.cli.commands.{group}")).items() if "run_" in name
        }
        assert written == {each for each in functions if each.__module__ == f"octoform.cli.commands.{group}"}
    for command in CARRIED_OUT:
        assert issubclass(arguments_of(command), Arguments)
        assert [*function_of(command).__annotations__.values()][1:] == ["Run", "int"], command.name


def test_names_of_commands_are_unique_and_verbs_have_a_heading() -> None:
    names = [command.name for command in COMMANDS]
    assert len({*names, *FORMER}) == len(names) + len(FORMER)
    assert [name for name in names if " " in name and name.split()[0] not in names] == []
    assert all(command.verbs() for command in COMMANDS if HEADING in command.traits)


@pytest.mark.parametrize("command", CARRIED_OUT, ids=lambda command: command.name)
def test_each_argument_is_declared_once_and_has_its_help(command: Command) -> None:
    arguments = arguments_of(command)
    declared = [name for name, _ in arguments.declared()]
    assert len(declared) == len(set(declared))
    typed = {name for each in arguments.__mro__ for name in vars(each).get("__annotations__", {})}
    assert {*declared} <= typed
    assert [name for name, each in arguments.declared() if each.forms is not None and not each.given["help"]] == []


def test_arguments_stay_as_they_were_typed() -> None:
    found = apply("apply")
    with pytest.raises(AttributeError, match="ask"):
        found.ask = True  # type: ignore[misc]


@pytest.mark.parametrize("before", [[], ["-chdir", "plan"], ["-chdir=x", "-no-color"]])
def test_only_the_parser_and_the_module_of_the_chosen_command_are_made(before: list[str]) -> None:
    line = Line([*before, "apply", "-auto-approve"])
    assert line.command is not None and line.command.name == "apply"
    program = f"""
import sys
from octoform.cli import dispatch, parser
made, start = [], parser.Parser.__init__
parser.Parser.__init__ = lambda self, command, declared: made.append(command.name) or start(self, command, declared)
dispatch.Line({[*before, "apply", "-auto-approve"]!r}).arguments()
print(made, sorted(name for name in sys.modules if name.startswith("octoform.cli.commands.")))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "['apply'] ['octoform.cli.commands.main']\n"


def test_the_help_of_all_commands_needs_no_command_and_no_parser() -> None:
    program = "import sys; from octoform.cli.main import main; main(['--help']); print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [*overview()]
    loaded = set(done.stderr.split())
    assert loaded.isdisjoint({"argparse", "octoform.cli.parser", *(f"octoform.cli.commands.{name}" for name in GROUPS)})


def test_the_help_has_every_command_in_its_group_and_every_exit_code() -> None:
    lines = [*overview()]
    for group, title in GROUPS.items():
        below = lines[lines.index(f"{title}:") + 1 :]
        rows = below[: below.index("")]
        assert [row.split()[0] for row in rows] == [
            command.name for command in COMMANDS if command.group == group and " " not in command.name
        ]


@pytest.mark.parametrize("command", [each for each in COMMANDS if each.verbs()], ids=lambda command: command.name)
def test_the_help_of_a_command_lists_its_verbs(command: Command, capsys: pytest.CaptureFixture[str]) -> None:
    name = command.name
    assert main([name, "--help"]) == 0
    printed = capsys.readouterr().out
    assert [verb for verb in command.verbs() if f"\n  {verb} " not in printed] == []


@pytest.mark.parametrize("command", CARRIED_OUT, ids=lambda command: command.name)
def test_where_nothing_is_typed_the_arguments_are_those_that_the_parser_finds(command: Command) -> None:
    declared = arguments_of(command)
    untyped = declared.untyped()
    if untyped is None:
        with pytest.raises(UsageError, match="required"):
            parsed(command, declared, [])
    else:
        assert vars(untyped) == vars(parsed(command, declared, []))
