"""What a newcomer types: slips, help, another folder, a terminal that is narrow, a pipe that wants everything."""

import io
import json
import os
import subprocess
from pathlib import Path

import pytest

import octoform
from octoform.cli.commands.inspect import script
from octoform.cli.main import main
from octoform.engine.tools import example
from octoform.views.endpoint import logs, tools
from octoform.views.format.console import Console

LONG = "Moves the joint to a place, by counts of its encoder, and waits until it is there or 5 seconds are over. " * 4
TOOL = {
    "name": "move_joint",
    "effect": "actuate",
    "description": LONG,
    "input_schema": {
        "properties": {
            "joint": {"enum": [f"the-joint-number-{number}" for number in range(20)]},
            "steps": {"type": "integer"},
        },
        "required": ["joint", "steps"],
    },
}


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def console(out: io.StringIO) -> Console:
    return Console(out, io.StringIO(), colour=False, colour_err=False, interactive=False)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["pln"], "there is no command 'pln'; did you mean plan?"),
        (["aply", "-auto-approve"], "did you mean apply?"),
        (["xyzzy"], "octoform help lists the commands"),
        (["state", "lst"], "there is no verb 'lst'; did you mean list?"),
        (["attempts", "shw", "1"], "there is no verb 'shw'; did you mean show?"),
        (["call", "move", "x=1"], "octoform call knows no word 'x=1'; an argument of a tool is written -arg x=1"),
        (["status", "-v"], "octoform status knows no option '-v'; octoform health shows more"),
        (["plan", "-jsn"], "octoform plan knows no option '-jsn'; did you mean -json?"),
        (["apply", "--auto-aprove=1"], "did you mean -auto-approve?"),
    ],
)
def test_a_slip_is_told_with_what_was_meant_and_not_with_every_command(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 1
    printed = capsys.readouterr().err
    assert said in printed and "force-unlock" not in printed and len(printed.splitlines()) <= 6


@pytest.mark.parametrize("form", ["-h", "-help", "--help"])
def test_help_has_the_form_of_every_option(form: str, capsys: pytest.CaptureFixture[str]) -> None:
    for words in ([form], ["plan", form], ["state", "show", form]):
        assert main(words) == 0
        assert capsys.readouterr().out.startswith(" ".join(["usage: octoform", *words[:-1]]))


def test_help_and_version_are_commands_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["help"]) == 0
    assert "exit codes:" in capsys.readouterr().out
    assert main(["help", "state", "show"]) == 0
    assert capsys.readouterr().out.startswith("usage: octoform state show")
    assert main(["help", "pln"]) == 1
    assert "did you mean plan?" in capsys.readouterr().err
    assert main(["version"]) == 0 and capsys.readouterr().out == f"octoform {octoform.__version__}\n"
    assert main(["version", "-json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"format": 1, "version": octoform.__version__}


def test_the_nearest_folder_above_with_a_manifest_is_the_project(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    below = tmp_path / "a" / "b"
    below.mkdir(parents=True)
    monkeypatch.chdir(below)
    assert main(["validate"]) == 0
    assert f"octoform: working in {tmp_path}, the nearest folder with octopus.yaml" in capsys.readouterr().err
    assert main(["-chdir=.", "validate"]) == 1, "who names a folder means that one"
    assert main(["init", "-host", "other"]) == 0 and (below / "octopus.yaml").is_file()
    capsys.readouterr()
    assert main(["validate"]) == 0 and "working in" not in capsys.readouterr().err


@pytest.mark.skipif(os.geteuid() != 0, reason="gives a file to another user")
@pytest.mark.parametrize("name", [".", "octopus.yaml"])
def test_another_users_manifest_above_is_not_taken(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    os.chown(tmp_path / name, 65534, 65534)
    (tmp_path / "below").mkdir()
    monkeypatch.chdir(tmp_path / "below")
    assert main(["validate"]) == 1 and "working in" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "painted"),
    [
        (["plan"], True),
        (["-no-color", "plan"], False),
        (["plan", "-no-color"], False),
        (["plan", "--no-color"], False),
    ],
)
def test_colour_can_be_switched_off_before_and_behind_the_command(
    words: list[str], painted: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = Terminal()
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stderr", shown)
    assert main(words) == 1, "there is no octopus.yaml"
    assert ("\x1b[" in shown.getvalue()) is painted, shown.getvalue()


def test_bash_completes_commands_verbs_options_and_choices() -> None:
    ask = 'COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _octoform; echo "${COMPREPLY[@]}"'

    def completed(*words: str) -> list[str]:
        typed = " ".join(f"'{word}'" for word in ("octoform", *words))
        program = f"{script('bash')}\nCOMP_WORDS=({typed})\n{ask}"
        done = subprocess.run(["bash", "-c", program], capture_output=True, text=True, check=True, cwd="/")
        assert done.stderr == ""
        return done.stdout.split()

    assert completed("pla") == ["plan"]
    assert completed("-chdir", "plan", "sta") == ["status", "state", "start"]
    assert completed("state", "s") == ["show"]
    assert completed("-no-color", "plan", "-det") == ["-detailed-exitcode"]
    assert completed("completion", "z") == ["zsh"]


def test_zsh_and_fish_have_every_command() -> None:
    assert "bashcompinit" in script("zsh") and "complete -o filenames -F _octoform octoform" in script("zsh")
    fish = script("fish")
    for words in ("-a plan -d", "__fish_seen_subcommand_from state' -a show", "-o detailed-exitcode"):
        assert words in fish


def test_a_pipe_gets_every_word_of_a_tool_on_one_line() -> None:
    out = io.StringIO()
    assert tools.tools(console(out), [TOOL], as_json=False) == 0
    lines = out.getvalue().splitlines()
    assert lines[1].strip() == LONG.strip()
    assert lines[2].startswith("      joint: required, the-joint-number-0 |") and lines[2].endswith(
        "the-joint-number-19"
    )
    assert lines[3] == "      steps: required, integer"


@pytest.mark.parametrize("columns", [80, 120])
def test_a_terminal_breaks_between_words_and_loses_none(columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    out = Terminal()
    record = {
        "seq": 7,
        "time": "2026-05-04T12:00:00.123Z",
        "event": "decision",
        "tool": "move_joint",
        "decision": "refuse",
        "caller": "local",
        "arguments": {},
        "text": LONG,
    }
    tools.tools(console(out), [TOOL], as_json=False)
    logs.records(console(out), [record], 50, as_json=False)
    lines = out.getvalue().splitlines()
    assert max(map(len, lines)) <= columns
    assert " ".join(out.getvalue().split()).count(" ".join(LONG.split())) == 2, "each word whole, in its order"


def test_an_example_is_a_reading_tool_whose_choices_can_be_made() -> None:
    reads = {"name": "read", "effect": "read", "input_schema": {"properties": {"device": {"enum": ["a", "b"]}}}}
    need = {**reads["input_schema"], "required": ["device"]}  # type: ignore[dict-item]
    free = {"properties": {"path": {"type": "string"}}, "required": ["path"]}
    assert example([TOOL, {**reads, "input_schema": free}], frozenset()) is None
    assert example([TOOL, {**reads, "input_schema": need}], frozenset()) == ("read", ["device=a"])
    assert example([reads, {**reads, "name": "good"}], frozenset({"good"})) == ("good", [])
