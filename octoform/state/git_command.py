"""The one way in which octoform calls git: no program that the repository names is ever run.

A repository's configuration may name programs for almost anything (hooks, a file monitor, filters, signing, a pager),
and whoever can write below `.git` chooses them: an agent, or whoever gave the folder away. So each is switched off, or
set to what the person's own configuration says. Nothing is fetched either. Light: a plan after a commit asks git.
"""

import os
import re
import subprocess
from collections.abc import Mapping

SECONDS = 300
_OFF = (
    *("core.fsmonitor=false", f"core.hooksPath={os.devnull}", "core.pager=cat", "core.editor=:", "core.askPass="),
    *("core.sshCommand=false", "core.gitProxy=", "core.alternateRefsCommand=false", "credential.helper="),
    *("diff.external=", "diff.ignoreSubmodules=all", "sequence.editor=:", "protocol.allow=never"),
    *("submodule.recurse=false", "log.showSignature=false", "gc.auto=0", "maintenance.auto=false"),
)
_PROGRAM = re.compile(
    r"(filter\..*\.(clean|smudge|process|required)|diff\..*\.(command|textconv)|merge\..*\.driver|gpg\.(.*\.)?program"
    r"|gpg\.ssh\.defaultkeycommand|trailer\..*\.(cmd|command)|credential\..*\.helper)",
    re.DOTALL,
)
"""Keys with a name in their middle, or whose value is the person's own where it is not the repository's (git-config)."""
_PLAIN = {"gpg.program": "gpg", "gpg.openpgp.program": "gpg", "gpg.x509.program": "gpgsm", "gpg.ssh.program": "ssh-keygen"}


class RepositoryRefused(Exception):
    """Git cannot be called on the repository without running what it names; the text is one line for a person."""


def command(root: str, environment: Mapping[str, str]) -> list[str]:
    """The words that every call of git begins with, for the repository whose working tree is ``root``.

    ``environment`` is that of the call. OSError where there is no git, RepositoryRefused where a program cannot be
    switched off.
    """
    words = ["git", "--no-pager", "--no-optional-locks"]
    for setting in _OFF:
        words += ["-c", setting]
    named = [key for key in _listed(words, root, environment) if _PROGRAM.fullmatch(key)]
    if not named:
        return words
    own = {**_listed(words, root, environment, "--system"), **_listed(words, root, environment, "--global")}
    for key in named:
        if "=" in key:
            raise RepositoryRefused(f"its configuration has the key {key!r}, which cannot be switched off")
        neutral = "false" if key.endswith(".required") else _PLAIN.get(key, "")
        words += ["-c", f"{key}={own.get(key, neutral)}"]
    return words


def inherited(environment: Mapping[str, str]) -> dict[str, str]:
    """Our variables and those of a call, with which git asks nobody, fetches nothing and starts no editor."""
    fixed = {"GIT_TERMINAL_PROMPT": "0", "GIT_ALLOW_PROTOCOL": "none", "GIT_NO_LAZY_FETCH": "1", "GIT_EDITOR": ":"}
    return {**os.environ, **fixed, **environment}


def call(root: str, arguments: list[str], environment: Mapping[str, str] | None = None) -> "subprocess.CompletedProcess[bytes]":
    """Run ``git ARGUMENTS`` in ``root`` to its end; OSError or RepositoryRefused.

    Status 124 stands for one that did not end in time."""
    variables = environment or {}
    return _run([*command(root, variables), *arguments], root, variables)


def _listed(words: list[str], root: str, environment: Mapping[str, str], *scope: str) -> dict[str, str]:
    """Key to value of a scope, or of all; what is included counts. Empty where git cannot read it, as it says later."""
    done = _run([*words, "config", *scope, "--includes", "--list", "-z"], root, environment)
    entries = done.stdout.decode(errors="surrogateescape").split("\0") if done.returncode == 0 else []
    return {key: value for key, _, value in (entry.partition("\n") for entry in entries) if key}


def _run(words: list[str], root: str, environment: Mapping[str, str]) -> "subprocess.CompletedProcess[bytes]":
    variables = inherited(environment)
    try:
        return subprocess.run(
            words, cwd=root, env=variables, stdin=subprocess.DEVNULL, capture_output=True, timeout=SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(words, 124, b"", f"git did not end within {SECONDS} s".encode())
