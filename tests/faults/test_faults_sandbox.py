"""Agents that attack the machine from inside the sandbox, as root and as an ordinary user."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from harness_confined import Host

USERS = [0, 1000] if os.getuid() == 0 else [os.getuid()]
ON: dict[str, bool] = {"network": True}

WRITES = r"""
import glob, os, stat
walks = [os.path.join(top, name) for place in ("/proc/sys", "/proc/irq", "/proc/bus", "/proc/fs", "/sys")
         for top, _, names in os.walk(place) for name in names]
more = ["/proc/sysrq-trigger", "/proc/kmsg", "/proc/mtrr", "/proc/scsi/scsi", "/dev/mem", "/dev/kmsg", "/dev/port"]
opened = []
for path in walks + more:
    try:
        if not stat.S_ISREG(os.stat(path).st_mode) and not path.startswith("/dev/"): continue
        os.close(os.open(path, os.O_WRONLY | os.O_NONBLOCK))
        opened.append(path)
    except OSError:
        pass
print("looked at", len(walks) > 500)
print("opened", opened)
"""

PRIVATE = r"""
import os
for path in PATHS:
    try:
        print("read", path, open(path, "rb").read(1))
    except OSError as problem:
        pass
words = dict(line.split(":\t", 1) for line in open("/proc/self/status").read().splitlines() if ":\t" in line)
print("capabilities", int(words["CapEff"], 16) | int(words["CapPrm"], 16) | int(words["CapAmb"], 16))
print("user", os.getuid(), os.geteuid(), "can be root again", end=" ")
for act in (lambda: os.setuid(0), lambda: os.seteuid(0), lambda: os.setgid(0), lambda: os.setgroups([0])):
    try:
        act()
        print(act, end=" ")
    except OSError:
        pass
"""


@pytest.fixture(params=USERS, ids=lambda uid: f"uid{uid}")
def host(request: pytest.FixtureRequest) -> Iterator[Host]:
    assert shutil.which("bwrap"), "bubblewrap is missing; `make setup` installs it"
    root = Path(tempfile.mkdtemp(prefix="octoform-sandbox-"))
    try:
        yield Host(root, request.param)
    finally:
        shutil.rmtree(root)


def attack(host: Host, code: str) -> list[str]:
    done = host.run(["/usr/bin/python3", "-I", "-S", "-c", code], ON)
    assert done["outcome"]["reason"] == "finished", done
    lines: list[str] = done["log"].splitlines()
    return lines


def test_no_setting_of_the_kernel_can_be_opened_for_writing(host: Host) -> None:
    assert attack(host, WRITES) == ["looked at True", "opened []"]


def test_what_is_roots_alone_stays_closed_and_nobody_becomes_root(host: Host) -> None:
    private = Path("/var/octoform-sandbox-private")
    paths = ["/etc/shadow", "/etc/gshadow", "/proc/kcore"]
    if os.getuid() == 0:
        private.write_text("SECRET")
        private.chmod(0o600)
        paths.append(str(private))
    try:
        lines = attack(host, f"PATHS = {paths!r}\n{PRIVATE}")
    finally:
        private.unlink(missing_ok=True)
    assert lines[0] == "capabilities 0"
    user = lines[1].split()
    assert "0" not in user[1:3]
    assert lines[1].endswith("can be root again ")
    assert len(lines) == 2


def test_the_attempts_folder_is_octoforms_again(host: Host) -> None:
    attack(host, "import os; os.mkdir('made'); open('made/file', 'w').close(); os.symlink('/etc/passwd', 'made/link')")
    owners = {path.lstat().st_uid for path in (host.workdir, *host.workdir.rglob("*"))}
    assert owners == {host.uid}
    assert Path("/etc/passwd").stat().st_uid == 0


def test_a_closed_project_of_root_shows_its_input_and_not_its_secrets(host: Host) -> None:
    host.write(host.project / "state" / "bench" / "probe" / "output.json", "INPUT")
    host.write(host.project / ".env", "SECRET")
    host.write(host.project / "notes", "SECRET").chmod(0o600)
    host.project.chmod(0o700)
    places = [str(host.project / name) for name in ("state/bench/probe/output.json", ".env")]
    code = f"for path in {places!r}:\n try: print(open(path).read())\n except OSError: print('closed')"
    assert attack(host, code)[0] == "INPUT"
    assert "SECRET" not in "".join(attack(host, code))


@pytest.mark.parametrize("required", [True, False])
def test_where_user_namespaces_are_refused_it_is_required_or_reported(host: Host, required: bool) -> None:
    broken = host.write(host.root / "broken" / "bwrap", "#!/bin/sh\necho 'bwrap: No permissions' >&2\nexit 1\n")
    broken.chmod(0o755)
    agent = ["sh", "-c", "echo ran > ran"]
    done = host.run(agent, {"network": True, "required": required}, PATH=f"{broken.parent}:/usr/bin:/bin")
    outcome = done["outcome"]
    assert (host.workdir / "ran").exists() is not required
    assert outcome["reason"] == ("not_installed" if required else "finished")
    assert "No permissions" in outcome["detail"]
    assert bool(outcome["unconfined"]) is not required
