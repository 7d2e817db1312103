"""What can be typed: Terraform's single dashes and the usual double ones, durations, and errors with status 1."""

from importlib import import_module
from pathlib import Path

import pytest

from octoform.cli import commands
from octoform.cli.dispatch import GROUPS, command_of
from octoform.cli.main import main
from octoform.cli.parser import Unbuilt, UsageError, build, parse, seconds


@pytest.mark.parametrize("dashes", ["-", "--"])
def test_options_work_with_one_dash_and_with_two(dashes: str) -> None:
    found = parse(["apply", f"{dashes}auto-approve", f"{dashes}target", "probe", f"{dashes}target", "serve", "x.plan"])
    assert (found.auto_approve, found.target, found.planfile) == (True, ["probe", "serve"], "x.plan")


def test_a_value_may_be_given_after_an_equals_sign() -> None:
    assert parse(["plan", "-out=x.plan", "--target=probe"]).out == "x.plan"


@pytest.mark.parametrize(
    ("text", "expected"), [("30s", 30.0), ("1h30m", 5400.0), ("250ms", 0.25), ("1.5m", 90.0), ("0s", 0.0)]
)
def test_durations(text: str, expected: float) -> None:
    assert seconds(text) == expected


@pytest.mark.parametrize("text", ["", "30", "soon", "-1s", "1s ", "1d", "1s2"])
def test_what_is_no_duration_is_a_usage_error(text: str) -> None:
    with pytest.raises(UsageError):
        seconds(text)


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
    with pytest.raises(SystemExit) as left:
        main([])
    assert left.value.code == 1
    assert "exit codes:" in capsys.readouterr().out


def test_json_of_call_is_an_object_or_only_the_form_of_the_answer() -> None:
    assert parse(["call", "t"]).json_arguments is None
    assert parse(["call", "t", "-json"]).json_arguments == ""
    assert parse(["call", "t", "-json", '{"a": 1}']).json_arguments == '{"a": 1}'


def test_each_command_has_its_function_and_each_function_is_a_command() -> None:
    modules = {path.stem for path in Path(commands.__file__).parent.glob("*.py") if path.stem != "__init__"}
    assert modules == set(GROUPS)
    known = next(action for action in build()._actions if action.dest == "command").choices or ()
    assert {name.replace("-", "_") for name in known} == {name for names in GROUPS.values() for name in names.split()}
    assert [command_of(name).__name__ for name in known] == [f"run_{name.replace('-', '_')}" for name in known]
    for group, names in GROUPS.items():
        written = vars(import_module(f"octoform.cli.commands.{group}"))
        assert {name for name in written if name.startswith("run_")} == {f"run_{name}" for name in names.split()}


@pytest.mark.parametrize("before", [[], ["-chdir", "plan"], ["-chdir=x", "-no-color"]])
def test_only_the_options_of_the_chosen_command_are_built(before: list[str]) -> None:
    words = [*before, "apply", "-auto-approve"]
    assert parse(words).auto_approve
    names = next(action for action in build("apply")._actions if action.dest == "command").choices
    assert isinstance(names, dict)
    assert [name for name, parser in names.items() if not isinstance(parser, Unbuilt)] == ["apply"]


def test_the_help_of_all_commands_is_the_same_with_none_of_them_built() -> None:
    assert build("").format_help() == build().format_help()
