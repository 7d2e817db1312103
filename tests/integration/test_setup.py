"""Setting up on machines that are not like ours: an inspecting proxy, an old Python, few programs."""

import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAMS = ("bash", "cat", "chmod", "dirname", "env", "id", "ln", "mkdir", "touch")
OLD = """#!/bin/sh
case "$*" in
    --version) echo "Python 3.10.12" ;;
    "-m venv"*) exit {venv} ;;
    *) exit 1 ;;
esac
"""
NEW = """#!/bin/sh
case "$*" in
    *hashlib*) exec '{real}' "$@" ;;
    "-m venv"*) mkdir -p .venv/bin; ln -sf "$0" .venv/bin/python ;;
    "-m uv --version") ;;
    "-m uv pip install"*)
        echo "uv UV_SYSTEM_CERTS=$UV_SYSTEM_CERTS $*" >> said
        [ {uv} = 0 ] || echo "error: invalid peer certificate: UnknownIssuer" >&2; exit {uv} ;;
    "-m pip config get"*) [ ! -e pip-cert ] || cat pip-cert ;;
    "-m pip install"*)
        echo "pip PIP_CERT=$PIP_CERT $*" >> said
        [ ! -e pip-errors ] || cat pip-errors >&2; exit {pip} ;;
esac
"""


@dataclass
class Machine:
    """A checkout and the only programs that there are."""

    folder: Path

    def program(self, name: str, text: str) -> None:
        path = self.folder / "bin" / name
        path.write_text(text)
        path.chmod(0o755)

    def python(self, uv: int = 0, pip: int = 0) -> None:
        self.program("python3.11", NEW.format(real=sys.executable, uv=uv, pip=pip))

    def run(self, **more: str) -> subprocess.CompletedProcess[str]:
        environ = {"PATH": str(self.folder / "bin"), "HOME": str(self.folder), **more}
        command = [str(self.folder / "bin" / "bash"), str(self.folder / ".ci" / "setup")]
        return subprocess.run(command, capture_output=True, text=True, env=environ, timeout=60, check=False)

    @property
    def said(self) -> str:
        path = self.folder / "said"
        return path.read_text() if path.exists() else ""


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    (tmp_path / "bin").mkdir()
    (tmp_path / ".ci").mkdir()
    shutil.copy(ROOT / ".ci" / "setup", tmp_path / ".ci" / "setup")
    for name in ("requirements.lock", "requirements-dev.lock"):
        (tmp_path / ".ci" / name).write_text("")
    (tmp_path / "pyproject.toml").write_text("")
    for name in PROGRAMS:
        (tmp_path / "bin" / name).symlink_to(shutil.which(name) or f"/bin/{name}")
    return Machine(tmp_path)


def test_uv_is_told_to_trust_the_systems_certificates_and_nothing_but_python_makes_the_digest(machine: Machine) -> None:
    machine.python()
    done = machine.run()
    assert done.returncode == 0, done.stderr
    assert machine.said.count("uv UV_SYSTEM_CERTS=true") == 2 and "pip " not in machine.said.replace("uv pip", "")
    (stamp,) = (machine.folder / ".venv").glob(".complete-*")
    before = machine.said
    assert machine.run().returncode == 0 and machine.said == before, "what is complete is not made again"
    (machine.folder / "pyproject.toml").write_text("# another one\n")
    assert machine.run().returncode == 0 and machine.said != before and stamp.exists()


def test_where_uv_is_not_let_through_pip_is_tried(machine: Machine) -> None:
    machine.python(uv=2)
    done = machine.run()
    assert done.returncode == 0, done.stderr
    assert "uv could not install the packages; pip tries" in done.stderr
    assert "-m pip install --quiet --require-hashes -r .ci/requirements.lock" in machine.said


def test_where_neither_gets_through_it_says_what_to_do(machine: Machine) -> None:
    machine.python(uv=2, pip=1)
    done = machine.run()
    assert done.returncode == 1 and not list((machine.folder / ".venv").glob(".complete-*"))
    last = done.stderr.partition("UnknownIssuer")[2]
    for word in ("update-ca-certificates", "SSL_CERT_FILE=", "HTTPS_PROXY=", "UV_DEFAULT_INDEX=", "PIP_INDEX_URL="):
        assert word in last


STORES = (
    "/etc/ssl/certs/ca-certificates.crt",
    "/etc/pki/tls/certs/ca-bundle.crt",
    "/etc/ssl/ca-bundle.pem",
    "/etc/ssl/cert.pem",
)


def test_pip_trusts_what_the_person_or_the_system_trusts(machine: Machine) -> None:
    machine.python(uv=2)
    store = next((name for name in STORES if Path(name).is_file()), "")
    assert machine.run().returncode == 0
    assert f"pip PIP_CERT={store} -m" in machine.said
    for file in (own := machine.folder / "own.pem", machine.folder / "said"):
        file.write_text("certificates\n")
    (machine.folder / "pyproject.toml").write_text("# another one\n")
    assert machine.run(SSL_CERT_FILE=str(own)).returncode == 0
    assert f"pip PIP_CERT={own} -m" in machine.said


def test_what_pip_is_told_to_trust_stays(machine: Machine) -> None:
    machine.python(uv=2)
    assert machine.run(PIP_CERT="/given.pem").returncode == 0 and "pip PIP_CERT=/given.pem -m" in machine.said
    (machine.folder / "pip-cert").write_text("/of-pip.conf.pem\n")
    (machine.folder / "said").unlink()
    (machine.folder / "pyproject.toml").write_text("# another one\n")
    assert machine.run().returncode == 0 and "pip PIP_CERT= -m" in machine.said


RETRY = "WARNING: Retrying (Retry(total={}, connect=None)) after connection broken by '{}': /simple/uv/\n"
REASONS = {
    "SSLError(SSLCertVerificationError(1, '[SSL: CERTIFICATE_VERIFY_FAILED] certificate verify failed": "not trusted",
    "OSError('Tunnel connection failed: 407 Proxy Authentication Required')": "asks for a name and a password",
    "OSError('Tunnel connection failed: 502 Bad Gateway')": "does not let the connection through",
    "ProxyError('Cannot connect to proxy.', NewConnectionError('refused": "does not let the connection through",
    "NewConnectionError('<C>: [Errno -3] Temporary failure in name resolution')": "cannot be reached",
}


@pytest.mark.parametrize("failure", REASONS)
def test_the_reason_stands_in_one_sentence_below_errors_that_are_not_repeated(machine: Machine, failure: str) -> None:
    machine.python(uv=2, pip=1)
    (machine.folder / "pip-errors").write_text("".join(RETRY.format(left, failure) for left in (4, 3, 2, 1, 0)))
    done = machine.run()
    assert done.returncode == 1 and done.stderr.count("WARNING: Retrying") == 1
    assert done.stderr.count(REASONS[failure]) == 1
    assert sum(done.stderr.count(sentence) for sentence in set(REASONS.values())) == 1, done.stderr


def test_a_download_that_was_cut_is_called_one(machine: Machine) -> None:
    machine.python(uv=2, pip=1)
    expected = "".join(f"        Expected     or {number:064x}\n" for number in range(20))
    mismatch = "ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.\n"
    (machine.folder / "pip-errors").write_text(f"{mismatch}{expected}             Got        {1:064x}\n")
    done = machine.run()
    assert done.returncode == 1 and "a download arrived cut off or changed" in done.stderr
    assert "Expected     or" not in done.stderr and "Got  " in done.stderr


def test_on_an_old_python_alone_uv_brings_a_new_one(machine: Machine) -> None:
    machine.program("python3", OLD.format(venv=1))
    new = NEW.format(real=sys.executable, uv=0, pip=0)
    made = f"mkdir -p .venv/bin\ncat > .venv/bin/python <<'END'\n{new}END\nchmod +x .venv/bin/python\n"
    machine.program("uv", f"#!/bin/sh\necho uv $* >> said\n{made}")
    done = machine.run()
    assert done.returncode == 0, done.stderr
    assert "this machine has Python 3.10.12: uv fetches one" in done.stderr
    assert "uv venv --quiet --allow-existing --seed --python 3.11 .venv" in machine.said


def test_where_uv_cannot_bring_one_each_system_is_told_what_to_type(machine: Machine) -> None:
    machine.program("python3", OLD.format(venv=1))
    machine.program("uv", "#!/bin/sh\necho 'error: Failed to download' >&2\nexit 1\n")
    done = machine.run()
    assert done.returncode == 1
    for word in (
        "apt-get install python3.11 python3.11-venv",
        "uv python install 3.11",
        "HTTPS_PROXY",
        "SSL_CERT_FILE",
    ):
        assert word in done.stderr
    (machine.folder / "bin" / "uv").unlink()
    assert "uv could not bring a Python 3.11" in machine.run().stderr
