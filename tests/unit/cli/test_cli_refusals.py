"""What a person reads when the operating system refuses: a closed folder, a read-only disk, a full one."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
import warm
from disks import mounts_are_permitted, read_only, small_disk
from launched import Launched, launched, tool, write
from ordinary import POSSIBLE, ordinary_user
from projects import OCTOFORM

from octoform.endpoint.publication import Service
from octoform.state.layout import Layout

SOURCE = '''
from fastmcp import FastMCP
mcp = FastMCP("bench")

@mcp.tool
def move_rail(steps: int) -> int:
    """Moves the rail."""
    return steps
'''
TOOLS = [tool("move_rail", "actuate")]
NOBODY = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
as_root = pytest.mark.skipif(os.getuid() != 0, reason="only root can act as another user")
with_mounts = pytest.mark.skipif(not mounts_are_permitted(), reason="no mounts here")


def octoform(folder: Path, *words: str, prefix: Sequence[str] = ()) -> "subprocess.CompletedProcess[str]":
    environ = {"PATH": os.environ["PATH"], "HOME": str(folder)}
    done = subprocess.CompletedProcess(words, *warm.run(OCTOFORM, words, folder, environ, 60, prefix=prefix))
    assert "Traceback" not in done.stderr, done.stderr
    return done


@pytest.fixture(scope="module")
def bench() -> Iterator[Launched]:
    """A project of this user, as apply leaves it, where others can come; its endpoint runs.

    Not among pytest's own folders, which every run of it closes anew.
    """
    with tempfile.TemporaryDirectory(prefix="octoform-refusals-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        (folder / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
        with launched(folder, SOURCE, TOOLS) as endpoint:
            endpoint.layout.local.chmod(0o700)
            yield endpoint


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Layout:
    """The same with an endpoint that does not run; nothing is written into it."""
    folder = tmp_path_factory.mktemp("stopped")
    (folder / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    policy = {"format": 1, "mode": "enforce", "stop": [], "tools": {}}
    return write(folder, SOURCE, Service(TOOLS, policy, [], "local", None, None))


COMMANDS = [
    "call move_rail", "tools", "audit", "audit -verify", "logs", "start", "stop", "restart", "estop", "estop -clear",
    "limits", "limits -reset all", "token list", "token create x", "revoke", "clients install cursor",
    "connect -print cursor", "plan", "status", "health", "heal", "apply -auto-approve", "destroy -auto-approve",
]  # fmt: skip


Answers = dict[tuple[str, str], tuple[int, str, str]]


@pytest.fixture(scope="module")
def strangers(bench: Launched) -> Answers:
    """What another user reads: (closed folder, command) to exit status and the two streams."""
    folder, found = bench.layout.project, {}
    for closed, mode in ((".octoform", 0o700), (".octoform/bench", 0o755)):
        (folder / ".octoform").chmod(mode)
        for words in COMMANDS:
            done = octoform(folder, *words.split(), prefix=NOBODY)
            found[closed, words] = done.returncode, done.stdout, done.stderr
    return found


@as_root
@pytest.mark.parametrize("words", COMMANDS)
@pytest.mark.parametrize("closed", [".octoform", ".octoform/bench"])
def test_another_user_is_told_whose_it_is(bench: Launched, strangers: Answers, words: str, closed: str) -> None:
    status, out, err = strangers[closed, words]
    assert status == 1
    assert "PROJECT-FOREIGN" in err and f"{closed} belongs to user root" in err
    assert "not running" not in out + err and "STATE-" not in err
    assert bench.process


@as_root
def test_another_user_is_told_so_by_a_pipe_and_inside_the_project(bench: Launched) -> None:
    folder = bench.layout.project
    (folder / ".octoform").chmod(0o755)
    for words in (["connect"], ["connect", "bench"]):
        done = octoform(folder, *words, prefix=NOBODY)
        assert (done.returncode, done.stdout) == (1, "")
        assert done.stderr == f"octoform: {folder}/.octoform/bench belongs to user root, and is closed to others\n"
    inside = folder / "state" / "bench"
    assert "belongs to user root" in octoform(inside, "estop", prefix=NOBODY).stderr


@as_root
def test_what_nobody_foresaw_ends_in_a_problem_too(bench: Launched) -> None:
    folder = bench.layout.project
    (folder / ".octoform").chmod(0o755)
    done = octoform(folder, "attempts", "-json", prefix=NOBODY)
    (found,) = json.loads(done.stdout)["diagnostics"]
    assert (done.returncode, found["code"]) == (1, "SYSTEM-REFUSED")
    assert found["summary"] == "the operating system refused: Permission denied"
    assert found["path"].endswith(".octoform/bench/attempts")
    assert found["hint"] == "it belongs to user root; run it as that user"


def test_an_emergency_stop_works_from_inside_the_project_and_its_clearing_names_the_folder(bench: Launched) -> None:
    folder = bench.layout.project
    inside = folder / "state" / "bench"
    assert octoform(inside, "estop", "-reason", "hot").returncode == 0
    assert bench.ask("status")["estop"]["reason"] == "hot"
    refused = octoform(inside, "estop", "-clear")
    assert refused.returncode == 1 and f"octoform -chdir={folder} estop -clear" in refused.stderr
    assert bench.ask("status")["estop"]["reason"] == "hot"
    assert octoform(folder, "estop", "-clear").returncode == 0
    assert bench.ask("status")["estop"] is None


@pytest.mark.parametrize("words", ["apply", "show"])
@pytest.mark.parametrize("path", ["/dev/zero", "/dev/null", ".", "nowhere", "octopus.yaml"])
def test_what_is_no_saved_plan_is_said_to_be_none_and_nobody_is_told_to_remove_it(
    bench: Launched, words: str, path: str
) -> None:
    done = octoform(bench.layout.project, words, path)
    assert done.returncode == 1 and "error[PLAN-NOT-A-PLAN]" in done.stderr
    assert "octoform plan -out FILE" in done.stderr and "remove" not in done.stderr


def test_a_plan_is_saved_over_no_other_file(tmp_path: Path) -> None:
    assert octoform(tmp_path, "init").returncode == 0
    manifest = (tmp_path / "octopus.yaml").read_bytes()
    (tmp_path / "link").symlink_to("octopus.yaml")
    os.mkfifo(tmp_path / "pipe")
    for path in ("octopus.yaml", "link", "pipe", "."):
        done = octoform(tmp_path, "plan", "-out", path)
        assert done.returncode == 1 and "error[PLAN-NOT-A-PLAN]" in done.stderr, (path, done.stderr)
    assert (tmp_path / "octopus.yaml").read_bytes() == manifest and (tmp_path / "link").is_symlink()
    (tmp_path / "empty").touch()
    (tmp_path / "former").write_text('{"format": 0, "kind": "octoform plan"}')
    for path in ("new", "new", "empty", "former"):
        assert octoform(tmp_path, "plan", "-out", path).returncode == 0
        assert octoform(tmp_path, "show", path).returncode == 0


@pytest.mark.skipif(not POSSIBLE, reason="only root can act as another user")
@pytest.mark.parametrize(
    "words",
    [
        *("clients list", "clients install codex", "connect -print codex"),
        *("service install", "service install -user", "service install -print", "service uninstall -user"),
    ],
)
def test_a_user_without_a_home_and_an_account_reads_a_sentence(words: str) -> None:
    with ordinary_user(61234) as user:
        (user.place / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
        user.owns_all()
        done = subprocess.CompletedProcess(
            words, *warm.run(OCTOFORM, words.split(), user.place, {"PATH": os.environ["PATH"]}, 60, prefix=user.prefix)
        )
        assert "Traceback" not in done.stderr, done.stderr
        assert done.stdout or "error[" in done.stderr


@pytest.mark.skipif(not POSSIBLE, reason="only root can act as another user")
@pytest.mark.parametrize("umask", ["777", "700", "277"])
def test_a_umask_without_the_owners_own_rights_closes_nothing_to_the_owner(umask: str) -> None:
    with ordinary_user() as user:
        user.owns_all()
        prefix = [*user.prefix, "sh", "-c", f'umask {umask}; exec "$@"', "sh"]
        for words in (("init",), ("token", "create", "x"), ("pause",)):
            done = octoform(user.place, *words, prefix=prefix)
            assert "Permission denied" not in done.stderr, done.stderr
        made = [path for path in user.place.rglob("*") if not path.is_symlink()]
        assert len(made) > 4
        closed = [path.name for path in made if path.stat().st_mode & 0o600 != 0o600]
        assert not closed
        assert not [path.name for path in made if path.stat().st_mode & 0o77 & int(umask, 8)]


@with_mounts
@pytest.mark.parametrize("words", ["start", "call move_rail", "tools", "token create x", "connect bench"])
def test_a_read_only_project_is_told_with_the_file(stopped: Layout, words: str) -> None:
    done = octoform(stopped.project, *words.split(), prefix=read_only(stopped.project))
    assert done.returncode == 1
    assert "error[SYSTEM-REFUSED]: the operating system refused: Read-only file system" in done.stderr
    assert ".octoform/bench/run" in done.stderr and "mounted read-only" in done.stderr


@with_mounts
def test_a_restart_in_a_read_only_project_leaves_the_endpoint_as_it_is(stopped: Layout) -> None:
    done = octoform(stopped.project, "restart", prefix=read_only(stopped.project))
    assert done.returncode == 1
    assert "error[STATE-READ-ONLY]" in done.stderr and "the endpoint was left as it is" in done.stderr


@with_mounts
def test_an_emergency_stop_that_nothing_latched_does_not_say_so(stopped: Layout) -> None:
    done = octoform(stopped.project, "estop", "-reason", "hot", prefix=read_only(stopped.project))
    assert done.returncode == 1
    assert "bench: NOT engaged. Actuators can be called" in done.stderr
    assert "so nothing is engaged" in done.stderr and "in this process alone" not in done.stderr
    assert "stopped" not in done.stdout and "engaged by" not in done.stdout
    done = octoform(stopped.project, "estop", "-json", prefix=read_only(stopped.project))
    (found,) = json.loads(done.stdout)["endpoints"]
    assert (found["latched"], found["lasting"], found["ok"], found["by"]) == (False, False, False, None)


@with_mounts
def test_an_emergency_stop_on_a_full_disk_keeps_its_reason(tmp_path: Path) -> None:
    program = Path(__file__).parents[3] / "octoform" / "server" / "offline.py"
    script = (
        "import os, subprocess, sys\n"
        "run = sys.argv[1] + '/run'\n"
        "os.makedirs(sys.argv[1] + '/endpoint'); os.makedirs(run)\n"
        "with open(run + '/filling', 'wb', buffering=0) as file:\n"
        "    try:\n"
        "        while True: file.write(bytes(4096))\n"
        "    except OSError: pass\n"
        f"command = [sys.executable, '-I', '-S', {str(program)!r}, 'stop', sys.argv[1] + '/endpoint', sys.argv[2]]\n"
        "subprocess.run(command)\n"
        "print(os.path.exists(run + '/estop.json'), file=sys.stderr)\n"
    )
    asked = json.dumps({"by": "anna", "reason": "hot"})
    command = [*small_disk(tmp_path / "disk", 64), sys.executable, "-c", script, str(tmp_path / "disk"), asked]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    found = json.loads(done.stdout)
    assert done.stderr == "True\n"
    assert (found["latched"], found["ok"]) == (True, False)
    assert (found["estop"]["by"], found["estop"]["reason"]) == ("anna", "hot")
    assert any("no room for who engaged it and why: No space left on device" in text for text in found["problems"])


def test_a_link_to_itself_is_no_folder_to_work_in(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    for named in ("loop", "loop/below"):
        done = octoform(tmp_path, f"-chdir={named}", "plan")
        assert (done.returncode, f"{named} is not a folder" in done.stderr) == (1, True), done.stderr
