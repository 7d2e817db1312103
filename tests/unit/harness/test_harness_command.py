"""Harness ``command`` and ``builtin`` with real programs: environment, prompt, outcome, usage, redaction."""

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from octoform.diagnostics import Diagnostic
from octoform.harness import contained_attempt
from octoform.harness.adapters import resolve
from octoform.harness.adapters.builtin import BuiltinHarness
from octoform.harness.adapters.command import CommandHarness, fill
from octoform.harness.containment import agent_environment
from octoform.harness.port import ExitReason, Outcome, Task, TaskLimits, Usage
from octoform.manifest.model import HarnessSpec, Sandbox

SECRET = "sk-not-a-real-key-0123456789"


@pytest.fixture
def task(tmp_path: Path) -> Task:
    prompt = tmp_path / "prompt.md"
    prompt.write_text("Do the thing, caf\u00e9.")
    return Task(
        stage="identify",
        attempt=1,
        workdir=tmp_path,
        prompt=prompt,
        output=tmp_path / "output.json",
        log=tmp_path / "task.log",
        document=tmp_path / "task.json",
        model="some/model",
        environment={
            "PATH": "/usr/bin:/bin",
            "HOME": "/root",
            "AWS_SECRET": SECRET,
            "UNRELATED": "x",
            "OCTOFORM_SYSROOT": "/tree",
        },
        limits=TaskLimits(30),
    )


Agent = Callable[..., Outcome]


@pytest.fixture
def shell(task: Task) -> Agent:
    """Runs a shell script as the agent; keywords are fields of CommandHarness."""

    def start(script: str, **settings: object) -> Outcome:
        harness = CommandHarness(("sh", "-c", script), **settings)  # type: ignore[arg-type]
        return harness.run(task, lambda *told: None)

    return start


def log(task: Task) -> str:
    return task.log.read_text()


def test_a_program_that_ends_well(shell: Agent, task: Task) -> None:
    outcome = shell("cat > output.json")
    assert (outcome.reason, outcome.exit_status, outcome.detail) == (ExitReason.FINISHED, 0, "")
    assert task.output.read_text() == task.prompt.read_text()


def test_what_a_program_leaves_running_is_told_of(shell: Agent) -> None:
    assert shell("sleep 300 & exit 0").detail == "1 process(es) that it had left running were ended"


def test_what_runs_when_octoform_ends_it_was_not_left_behind(shell: Agent, task: Task) -> None:
    harness = CommandHarness(("sh", "-c", "sleep 300 & sleep 300; wait"))
    outcome = harness.run(replace(task, limits=TaskLimits(30, idle_seconds=0.3)), lambda *_: None)
    assert (outcome.reason, outcome.detail) == (ExitReason.IDLE, "stopped after 0.3 s without a sign of progress")
    assert outcome.survivors_killed >= 1


def test_an_interrupt_removes_the_private_folders(task: Task) -> None:
    harness = CommandHarness(("sh", "-c", 'touch "$HOME/login" "$TMPDIR/large"; echo there; sleep 300'))

    def interrupt(*_: object) -> None:
        assert (task.workdir / "home" / "login").exists()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        harness.run(task, interrupt)
    assert not (task.workdir / "home").exists()
    assert not (task.workdir / "tmp").exists()


def test_a_link_in_the_place_of_the_folder_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "others" / "home").mkdir(parents=True)
    (tmp_path / "attempt").symlink_to(tmp_path / "others")
    agent_environment.remove_private(tmp_path / "attempt")
    assert (tmp_path / "others" / "home").exists()


def test_the_environment_holds_nothing_of_the_callers_that_was_not_named(shell: Agent, task: Task) -> None:
    shell("env")
    seen = dict(line.split("=", 1) for line in log(task).splitlines())
    for added_by_the_shell in ("PWD", "OLDPWD", "SHLVL", "_"):
        seen.pop(added_by_the_shell, None)
    assert len(seen.pop("OCTOFORM_ATTEMPT")) == 32
    assert seen == {
        "PATH": "/usr/bin:/bin",
        "HOME": str(task.workdir / "home"),
        "TMPDIR": str(task.workdir / "tmp"),
        "LANG": "C.UTF-8",
        "LC_ALL": "C.UTF-8",
        "TERM": "dumb",
        "OCTOFORM_SYSROOT": "/tree",
        "OCTOFORM_TASK": str(task.document),
        "OCTOFORM_PROMPT": str(task.prompt),
        "OCTOFORM_OUTPUT": str(task.output),
        **agent_environment.certificates({}),
    }


def test_a_named_variable_arrives_and_never_reaches_the_log(shell: Agent, task: Task) -> None:
    outcome = shell(
        'test -n "$AWS_SECRET" && echo "it is $AWS_SECRET." && printf "%.9s" "$AWS_SECRET" && sleep 0.05 '
        '&& printf "%s" "${AWS_SECRET#?????????}" && exit 4',
        env=("AWS_SECRET",),
    )
    assert (outcome.reason, outcome.exit_status) == (ExitReason.CRASHED, 4)
    assert log(task) == "it is [AWS_SECRET redacted].\n[AWS_SECRET redacted]"


def test_what_looks_like_the_beginning_of_a_secret_is_not_lost(shell: Agent, task: Task) -> None:
    shell("printf 'ends in sk-not'", env=("AWS_SECRET",))
    assert log(task) == "ends in sk-not"


def test_a_named_variable_that_is_not_set_is_told_when_the_run_fails(shell: Agent) -> None:
    assert shell("exit 1", env=("MY_KEY",)).detail == "exit status 1; not set in the environment: MY_KEY"
    assert shell("exit 0", env=("MY_KEY",)).detail == ""


def test_a_secret_setting_of_octoform_itself_is_not_passed(shell: Agent, task: Task) -> None:
    task = replace(task, environment={**task.environment, "OCTOFORM_TOKEN": SECRET})
    CommandHarness(("env",)).run(task, lambda *told: None)
    assert "OCTOFORM_TOKEN" not in log(task)


def test_scratch_and_home_go_with_the_run_and_the_rest_stays(shell: Agent, task: Task) -> None:
    shell('touch "$TMPDIR/scratch" "$HOME/session" note')
    assert sorted(path.name for path in task.workdir.iterdir()) == [
        *("note", "process.json", "prompt.md", "task.log", "transcript.jsonl"),
    ]


def test_placeholders_and_the_prompt_as_a_file(task: Task) -> None:
    argv = ("printf", "%s\n", "{stage}", "m={model}", "{task}", "{prompt_file}", "{{stage}}", "{}")
    outcome = CommandHarness(argv, prompt_via="file").run(task, lambda *told: None)
    assert outcome.exit_status == 0
    expected = ["identify", "m=some/model", str(task.document), str(task.prompt), "{stage}", "{}"]
    assert log(task).splitlines() == expected


def test_the_prompt_as_an_argument(task: Task) -> None:
    text = task.prompt.read_text()
    assert CommandHarness(("agent", "-p"), prompt_via="argument").arguments(task) == ("agent", "-p", text)
    assert CommandHarness(("agent", "{prompt}", "-x"), prompt_via="argument").arguments(task) == ("agent", text, "-x")


def test_braces_inside_the_prompt_are_text(task: Task) -> None:
    task.prompt.write_text('{"a": "{task}"}')
    assert CommandHarness(("agent",), prompt_via="argument").arguments(task) == ("agent", '{"a": "{task}"}')


def test_fill_leaves_other_braces_alone() -> None:
    assert fill('{"a": {b}} {{c}} {0}', {"b": "1"}) == '{"a": 1} {c} {0}'


@pytest.mark.parametrize("program", ["no-such-agent-program", "./no-such-file", "{workdir}/prompt.md"])
def test_a_program_that_is_not_installed_is_one_line(task: Task, program: str) -> None:
    outcome = CommandHarness((program,)).run(task, lambda *told: None)
    assert (outcome.reason, outcome.exit_status) == (ExitReason.NOT_INSTALLED, None)
    assert Path(program).name in outcome.detail
    assert "\n" not in outcome.detail
    assert not task.log.exists(), "nothing was started"


def test_a_program_of_the_wrong_format_is_told_too(task: Task) -> None:
    program = task.workdir / "agent"
    program.write_bytes(b"#!/nonexistent/interpreter\n")
    program.chmod(0o755)
    outcome = CommandHarness((str(program),)).run(task, lambda *told: None)
    assert outcome.reason is ExitReason.NOT_INSTALLED
    assert "No such file" in outcome.detail


def test_the_wall_limit(task: Task) -> None:
    outcome = CommandHarness(("sleep", "600")).run(replace(task, limits=TaskLimits(0.2)), lambda *told: None)
    assert outcome.reason is ExitReason.TIMEOUT
    assert outcome.detail == "stopped after its limit of 0.2 s"
    assert 0.2 <= outcome.seconds < 10


def test_death_by_signal(shell: Agent) -> None:
    outcome = shell("kill -SEGV $$")
    assert (outcome.reason, outcome.exit_status, outcome.detail) == (ExitReason.CRASHED, -11, "ended by signal 11")


def test_usage_that_the_program_wrote(shell: Agent) -> None:
    fields = {"input_tokens": 120, "cached_tokens": 100, "output_tokens": 7, "cost_usd": 0.02}
    assert shell(f"echo '{json.dumps(fields)}' > usage.json").usage == Usage(120, 100, 7, 0.02)


@pytest.mark.parametrize(
    "text",
    [
        *("", "[", "[]", "7", "[" * 50_000),
        *('{"input_tokens": -1}', '{"input_tokens": true}', '{"output_tokens": 1e3}'),
        *('{"cost_usd": NaN}', '{"cost_usd": "1"}', '{"cost_usd": 1e400}'),
    ],
)
def test_usage_that_makes_no_sense_is_unknown(tmp_path: Path, text: str) -> None:
    (tmp_path / "usage.json").write_text(text)
    assert contained_attempt.read_usage(tmp_path) == Usage()


def test_usage_behind_a_link_is_unknown(tmp_path: Path) -> None:
    (tmp_path / "other.json").write_text('{"input_tokens": 1}')
    (tmp_path / "usage.json").symlink_to(tmp_path / "other.json")
    assert contained_attempt.read_usage(tmp_path) == Usage()


def test_the_embedded_agent_refuses_a_task_that_is_none_with_one_line(task: Task) -> None:
    task.document.write_text('{"stage": "brew"}')
    outcome = BuiltinHarness().run(task, lambda *told: None)
    assert (outcome.reason, outcome.exit_status) == (ExitReason.CRASHED, 1)
    assert "brew" in log(task)


def test_resolve() -> None:
    assert isinstance(resolve(HarnessSpec("builtin"), {}), BuiltinHarness)
    spec = HarnessSpec("command", ("agent", "{task}", "${WHO}"), ("KEY",), "file")
    assert resolve(spec, {"WHO": "{me}"}) == CommandHarness(
        ("agent", "{task}", "{{me}}"), ("KEY",), "file", sandbox=Sandbox()
    )
    relative = HarnessSpec("command", ("./agent",))
    assert resolve(relative, {}, Path("/project")) == CommandHarness(("/project/agent",), sandbox=Sandbox())


@pytest.mark.parametrize(
    ("spec", "code", "hint"),
    [
        (HarnessSpec("biultin"), "HARNESS-UNKNOWN", "builtin"),
        (HarnessSpec("zzz"), "HARNESS-UNKNOWN", "known harnesses"),
        (HarnessSpec("command"), "HARNESS-NO-COMMAND", "command:"),
        (HarnessSpec("command", (" ",)), "HARNESS-NO-COMMAND", "command:"),
        (HarnessSpec("command", ("a", "{promt_file}")), "HARNESS-PLACEHOLDER", "{prompt_file}"),
        (HarnessSpec("command", ("a",), (), "mail"), "HARNESS-PROMPT-VIA", "stdin"),
        (HarnessSpec("command", ("a", "{prompt}")), "HARNESS-PROMPT-VIA", "argument"),
        (HarnessSpec("builtin", ("a",)), "HARNESS-BUILTIN-SETTINGS", "command"),
    ],
)
def test_settings_that_cannot_work(spec: HarnessSpec, code: str, hint: str) -> None:
    found = resolve(spec, {})
    assert isinstance(found, Diagnostic)
    assert found.code == code
    assert found.hint is not None and hint in found.hint
    page = Path(sys.modules["octoform.diagnostics"].__file__ or "").parent / "pages" / f"{code}.md"
    assert page.read_text().startswith(f"# {code}: ")
