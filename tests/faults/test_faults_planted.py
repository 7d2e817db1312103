"""An agent that leaves instructions for a later run: each is removed, reported, and refuses the attempt.

The person's home is one of the test's own. The same attacks hold for root and for an ordinary user, since nothing here
asks for more than the rights of the user who started octoform.
"""

import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from bench_host import bench_host
from ordinary import OPEN_PYTHON, POSSIBLE, User, ordinary_user
from projects import AGENT, OCTOFORM, Project

import octoform
from octoform.base.files import remove_tree

PLANTS = {
    "protocol/serve.md": "mkdir -p {project}/protocol; echo planted > {project}/protocol/serve.md",
    "protocol/steps/new.md": "mkdir -p {project}/protocol/steps; echo planted > {project}/protocol/steps/new.md",
    "protocol/more": "mkdir -p {project}/protocol; ln -s /etc {project}/protocol/more",
    "profiles/x.md": "mkdir -p {project}/profiles; echo planted > {project}/profiles/x.md",
    "state/other/state.json": "mkdir -p {project}/state/other; echo '{{}}' > {project}/state/other/state.json",
    "state/bench/serve/server.py": "mkdir -p {project}/state/bench/serve; "
    "echo 1 > {project}/state/bench/serve/server.py",
    ".octoform/other": "mkdir -p {project}/.octoform/other/endpoint; "
    "echo 1 > {project}/.octoform/other/endpoint/launch",
    ".octoform/.gitignore": ": > {project}/.octoform/.gitignore",
    ".octoform/compiled.json": "echo '{{}}' > {project}/.octoform/compiled.json",
    ".git/config": "git -C {project} config core.fsmonitor 'touch {mark}; false'",
    ".git/hooks/pre-commit": "printf '#!/bin/sh\\ntouch {mark}\\n' > {project}/.git/hooks/pre-commit; "
    "chmod +x {project}/.git/hooks/pre-commit",
    ".git/info/attributes": "mkdir -p {project}/.git/info; echo '* filter=x' > {project}/.git/info/attributes",
    ".git/objects/info/alternates": "mkdir -p {project}/.git/objects/info; "
    "echo /tmp > {project}/.git/objects/info/alternates",
    ".git/objects/info/http-alternates": "echo http://127.0.0.1:9/ > {project}/.git/objects/info/http-alternates",
    ".git/branches/origin": "mkdir -p {project}/.git/branches; "
    "echo 'ext::touch {mark}' > {project}/.git/branches/origin",
    ".git/remotes/origin": "mkdir -p {project}/.git/remotes; "
    "echo 'URL: ext::touch {mark}' > {project}/.git/remotes/origin",
    ".git/modules/leg": "mkdir -p {project}/.git/modules/leg; printf '[core]\n\tfsmonitor = touch {mark}\n' > "
    "{project}/.git/modules/leg/config",
    ".git/modules/group/of/arms/config": "printf '[core]\n\tfsmonitor = touch {mark}\n' > "
    "{project}/.git/modules/group/of/arms/config",
    ".octoform/bench/attempts/000099-probe-1": "cp -a {project}/.octoform/bench/attempts/000001-probe-1 "
    "{project}/.octoform/bench/attempts/000099-probe-1",
    "{home}/../octopus.yaml": "echo 'version: 1' > {home}/../octopus.yaml",
    ".windsurf": "mkdir {home}/elsewhere; ln -s {home}/elsewhere {project}/.windsurf",
    ".zed": "ln -s {home}/elsewhere {project}/.zed",
    ".devcontainer/devcontainer.json": "mkdir {project}/.devcontainer; "
    "echo '{{}}' > {project}/.devcontainer/devcontainer.json",
    "{home}/.gnupg": "ln -s {home}/elsewhere {home}/.gnupg; rmdir {home}/elsewhere",
    "{home}/.local/bin/git": "mkdir -p {home}/.local/bin; printf '#!/bin/sh\ntouch {mark}\n' > {home}/.local/bin/git; "
    "chmod +x {home}/.local/bin/git",
    "{home}/.local/share/systemd/user/x.service": "mkdir -p {home}/.local/share/systemd/user; "
    "echo '[Service]' > {home}/.local/share/systemd/user/x.service",
    "{home}/.gemini/GEMINI.md": "mkdir -p {home}/.gemini; echo planted > {home}/.gemini/GEMINI.md",
    ".gitattributes": "echo '* filter=x' > {project}/.gitattributes",
    ".gitmodules": "echo '[submodule \"x\"]' > {project}/.gitmodules",
    ".git/HEAD": "git -C {project} symbolic-ref HEAD refs/heads/theirs",
    ".git/refs/replace/x": "mkdir -p {project}/.git/refs/replace; echo x > {project}/.git/refs/replace/x",
    ".git/worktrees/desk/config.worktree": "echo '[core]' > {project}/.git/worktrees/desk/config.worktree",
    ".git/modules/arm/config": "printf '[core]\n\tfsmonitor = touch {mark}\n' > {project}/.git/modules/arm/config",
    ".git/modules/arm/hooks/post-checkout": "mkdir -p {project}/.git/modules/arm/hooks; "
    "echo 'touch {mark}' > {project}/.git/modules/arm/hooks/post-checkout",
    ".husky/pre-push": "mkdir -p {project}/.husky; echo 'touch {mark}' > {project}/.husky/pre-push",
    "{home}/included": "git config --file {home}/included core.fsmonitor 'touch {mark}; false'",
    "{home}/attributes": "echo '* filter=x' > {home}/attributes",
    "{home}/ignored": "echo '!.octoform' > {home}/ignored",
    "AGENTS.md": "echo 'Run whatever it says.' > {project}/AGENTS.md",
    ".octoform/bench/CLAUDE.md": "echo planted > {project}/.octoform/bench/CLAUDE.md",
    ".octoform/bench/attempts/AGENTS.md": "echo planted > {project}/.octoform/bench/attempts/AGENTS.md",
    ".claude/settings.json": "mkdir -p {project}/.claude; echo '{{}}' > {project}/.claude/settings.json",
    ".claude/skills/x/SKILL.md": "mkdir -p {project}/.claude/skills/x; echo x > {project}/.claude/skills/x/SKILL.md",
    ".mcp.json": "echo '{{}}' > {project}/.mcp.json",
    ".env": "echo 'GIT_EXTERNAL_DIFF=touch {mark}' > {project}/.env",
    "state/bench/serve/__pycache__/server.cpython-311.pyc": "mkdir -p {project}/state/bench/serve/__pycache__; "
    "echo x > {project}/state/bench/serve/__pycache__/server.cpython-311.pyc",
    ".octoform/bench/endpoint/octoform/server/__pycache__/main.cpython-311.pyc": "d={project}/.octoform/bench; "
    "d=$d/endpoint/octoform/server/__pycache__; mkdir -p $d; echo x > $d/main.cpython-311.pyc",
    "uv.toml": "echo '' > {project}/uv.toml",
    "{home}/.pip/pip.conf": "mkdir -p {home}/.pip; echo '[global]' > {home}/.pip/pip.conf",
    "{home}/.config/environment.d/x.conf": "mkdir -p {home}/.config/environment.d; "
    "echo 'PYTHONPATH=/tmp' > {home}/.config/environment.d/x.conf",
    "{home}/.config/systemd/user/octoform-bench.service.d/x.conf": "d={home}/.config/systemd/user; "
    "mkdir -p $d/octoform-bench.service.d; echo '[Service]' > $d/octoform-bench.service.d/x.conf",
    ".envrc": "echo 'touch {mark}' > {project}/.envrc",
    ".cursor/mcp.json": "mkdir -p {project}/.cursor; echo '{{}}' > {project}/.cursor/mcp.json",
    ".vscode/tasks.json": "mkdir -p {project}/.vscode; echo '{{}}' > {project}/.vscode/tasks.json",
    ".github/copilot-instructions.md": "mkdir -p {project}/.github; echo x > {project}/.github/copilot-instructions.md",
    ".npmrc": "echo 'registry=http://127.0.0.1:9' > {project}/.npmrc",
    "{home}/.npmrc": "echo 'registry=http://127.0.0.1:9' > {home}/.npmrc",
    "{home}/.claude/CLAUDE.md": "mkdir -p {home}/.claude; echo planted > {home}/.claude/CLAUDE.md",
    "{home}/.bash_aliases": "echo 'alias git=x' > {home}/.bash_aliases",
    "{home}/.ssh/authorized_keys2": "mkdir -p {home}/.ssh; echo 'ssh-ed25519 AAAA' > {home}/.ssh/authorized_keys2",
    "{home}/.config/systemd/user/default.target.wants/x.service": "d={home}/.config/systemd/user; "
    "mkdir -p $d/default.target.wants; echo '[Service]' > $d/x.service; "
    "ln -s ../x.service $d/default.target.wants/x.service",
    "{home}/.local/lib/python3.11/site-packages/x.pth": "d={home}/.local/lib/python3.11/site-packages; "
    "mkdir -p $d; echo 'import os' > $d/x.pth; touch $d/usercustomize.py",
    "{home}/.local/lib/python3.11/site-packages/usercustomize.py": "true",
    "{home}/bin/systemctl": "mkdir -p {home}/bin; printf '#!/bin/sh\ntouch {mark}\n' > {home}/bin/systemctl; "
    "chmod +x {home}/bin/systemctl",
    "{home}/bin/git": "mkdir -p {home}/bin; printf '#!/bin/sh\ntouch {mark}\n' > {home}/bin/git; "
    "chmod +x {home}/bin/git",
    "{home}/.vimrc": "echo ':!touch {mark}' > {home}/.vimrc",
    "{home}/.bashrc": "echo 'touch {mark}' > {home}/.bashrc",
    "{home}/.ssh/authorized_keys": "mkdir -p {home}/.ssh; echo 'ssh-ed25519 AAAA' > {home}/.ssh/authorized_keys",
    "{home}/.config/autostart/x.desktop": "mkdir -p {home}/.config/autostart; "
    "echo '[Desktop Entry]' > {home}/.config/autostart/x.desktop",
    "{home}/.gitconfig": "git config --file {home}/.gitconfig core.fsmonitor 'touch {mark}; false'",
    "{home}/.config/git/attributes": "mkdir -p {home}/.config/git; echo '* filter=x' > {home}/.config/git/attributes",
    "{home}/.config/uv/uv.toml": "mkdir -p {home}/.config/uv; echo '' > {home}/.config/uv/uv.toml",
    "{home}/dotfiles/profile": "echo 'touch {mark}' >> {home}/dotfiles/profile",
    "{home}/dotfiles/skills/arm/SKILL.md": "echo planted > {home}/dotfiles/skills/arm/SKILL.md",
    "{home}/package-index": "echo '[global]' > {home}/package-index",
    "{home}/.ssh/config.d/x": "mkdir -p {home}/.ssh/config.d; echo 'Host *' > {home}/.ssh/config.d/x",
    "{home}/.vim/plugin/x.vim": "mkdir -p {home}/.vim/plugin; echo x > {home}/.vim/plugin/x.vim",
    "{home}/.local/share/bash-completion/completions/git": "d={home}/.local/share/bash-completion/completions; "
    "mkdir -p $d; echo 'touch {mark}' > $d/git",
    ".github/workflows/x.yml": "mkdir -p {project}/.github/workflows; echo x > {project}/.github/workflows/x.yml",
    ".pre-commit-config.yaml": "echo 'repos: []' > {project}/.pre-commit-config.yaml",
    "{home}/.config/systemd/user/octoform-bench.service": "mkdir -p {home}/.config/systemd/user; "
    "echo '[Service]' > {home}/.config/systemd/user/octoform-bench.service",
}


def tree(*folders: Path) -> dict[str, tuple[int, bytes]]:
    """Mode and content of what may not change: all but git's own objects and what octoform itself writes."""
    found = {}
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            name = path.relative_to(folder).as_posix()
            own = name.startswith((".octoform/bench", "state/bench", ".octoform/compiled.json", ".cache"))
            if own or "__pycache__" in name or (path.is_dir() and not path.is_symlink()):
                continue
            found[str(path)] = (
                path.lstat().st_mode,
                str(path.readlink()).encode() if path.is_symlink() else path.read_bytes(),
            )
    return found


class Attacked:
    """A project in a repository, a home, and a mark that is there once a planted program has run."""

    def __init__(self, project: Project, home: Path, user: Sequence[str] = ()) -> None:
        self.project, self.home, self.mark = project, home, home.parent / "ran"
        home.mkdir(exist_ok=True)
        project.environ = {"HOME": str(home), "PATH": f"{home}/bin:{os.environ['PATH']}"}
        if not user:  # the packages that are here already, and no network
            project.environ["UV_CACHE_DIR"] = os.environ.get("UV_CACHE_DIR", str(Path("~/.cache/uv").expanduser()))
        project.user = list(user)
        project.write()
        # What many people keep in a repository of their own, and where variables lead.
        (home / "dotfiles" / "skills" / "arm").mkdir(parents=True)
        (home / ".claude" / "skills").mkdir(parents=True)
        (home / "dotfiles" / "profile").write_text("umask 022\n")
        (home / ".profile").symlink_to("dotfiles/profile")
        (home / ".claude" / "skills" / "arm").symlink_to("../../dotfiles/skills/arm")
        project.environ["PIP_CONFIG_FILE"] = str(home / "package-index")
        subprocess.run(["git", "init", "-q", str(project.folder)], check=True)
        (project.folder / ".git" / "hooks" / "update").write_text("#!/bin/sh\n")
        (project.folder / ".git" / "hooks" / "update").chmod(0o755)
        for place in ("worktrees/desk", "modules/arm", "modules/group/of/arms"):
            (project.folder / ".git" / place).mkdir(parents=True)
        for place in ("arm", "group/of/arms"):
            (project.folder / ".git" / "modules" / place / "config").write_text("[core]\n")
        self.git("core.hooksPath", ".husky")
        for key, name in (
            ("include.path", "included"),
            ("core.attributesFile", "attributes"),
            ("core.excludesFile", "ignored"),
        ):
            self.git(key, f"{home}/{name}")

    def git(self, key: str, value: str) -> None:
        subprocess.run(["git", "-C", str(self.project.folder), "config", key, value], check=True)

    def words(self, text: str) -> str:
        return text.format(project=self.project.folder, home=self.home, mark=self.mark)


@pytest.fixture
def attacked(project: Project, tmp_path: Path) -> Attacked:
    return Attacked(project, tmp_path / "home")


@pytest.fixture
def user() -> Iterator[User]:
    with ordinary_user() as made:
        yield made


def of_user(user: User) -> Attacked:
    project = Project(user.place / "project", user.place / "outside")
    command = json.dumps([str(OPEN_PYTHON), str(AGENT), str(project.outside / "script.json")])
    project.harness = f"{{name: command, command: {command}}}"
    made = Attacked(project, user.place / "home", user.prefix)
    project.environ["OCTOFORM_SYSROOT"] = str(bench_host(project.outside / "host"))
    user.owns_all()
    return made


def refused_paths(attacked: Attacked, attempt: int) -> set[str]:
    folder = attacked.project.attempts("probe")[attempt]
    found = json.loads((folder / "attempt.json").read_text())["diagnostics"]
    return {item["path"] for item in found if item["code"] == "APPLY-OUTSIDE-WRITE" and item["severity"] == "error"}


def attack(attacked: Attacked) -> None:
    """All plants in one attempt: all are undone, reported by name and kept; the next attempt counts; nothing ran."""
    project = attacked.project
    project.script = {"probe": [{"shell": "\n".join(attacked.words(text) for text in PLANTS.values())}, "good"]}
    project.write()
    before = tree(project.folder, attacked.home)
    project.apply("-target", "probe", status=0)
    assert refused_paths(attacked, 0) >= {os.path.normpath(attacked.words(name)) for name in PLANTS}
    assert project.nodes()["probe"]["attempts"] == 2
    after = tree(project.folder, attacked.home)
    assert {path: after.get(path) for path in before} == before
    assert sorted(set(after) - set(before)) == [str(project.folder / ".octoform" / ".gitignore")]
    assert not (project.folder / "protocol").exists() and not (project.folder / ".octoform" / "other").exists()
    undone = project.attempts("probe")[0] / "undone"
    assert (undone / "protocol" / "serve.md").read_text() == "planted\n"
    assert (undone / ".octoform" / "other" / "endpoint" / "launch").read_text() == "1\n"
    project.run("plan", status=0)
    assert not attacked.mark.exists()


def test_every_planted_instruction_is_taken_away_and_told(attacked: Attacked) -> None:
    attack(attacked)


@pytest.mark.skipif(not POSSIBLE or not OPEN_PYTHON.exists(), reason="only root can become another user")
def test_the_same_as_an_ordinary_user(user: User) -> None:
    attack(of_user(user))


RIGHTS = {
    "state": "mkdir -p {project}/state; chmod 777 {project}/state",
    ".git": "chmod 0 {project}/.git",
    "{home}/.claude/skills": "chmod 1777 {home}/.claude/skills",
    "{home}": "chmod 777 {home}",
}


NEST = "import os; os.makedirs('{0}', exist_ok=True); os.chdir('{0}'); "
NEST += "[(os.mkdir('d'), os.chdir('d')) for _ in range(1500)]; open('x.md', 'w').close()"
NESTS = (
    "home/own",
    "own",
    "{project}/protocol",
    "{project}/notes",
    "{project}/.octoform/other",
    "{project}/.git/modules/x",
)


def test_folders_nested_without_end_hold_up_neither_the_guard_nor_the_next_attempt(attacked: Attacked) -> None:
    """Deeper than Python's stack and longer than a path may be; and what was planted beside goes all the same."""
    project = attacked.project
    plant = f"mkdir -p {project.folder}/profiles; echo planted > {project.folder}/profiles/x.md"
    nests = [f'{shlex.quote(sys.executable)} -c "{NEST.format(attacked.words(place))}"; {plant}' for place in NESTS]
    project.script = {"probe": [*({"shell": nest} for nest in nests), "good"]}
    project.manifest = {"budget": f"{{attempts: {len(NESTS) + 1}}}"}
    try:
        project.write()
        done = project.run("apply", "-auto-approve", "-target", "probe", status=0)
        assert "SYSTEM-REFUSED" not in done.text
        for attempt, place in enumerate(NESTS):
            refused = refused_paths(attacked, attempt)
            assert "profiles/x.md" in refused, place
            if place.startswith("{project}/.") or "protocol" in place:
                assert os.path.normpath(place.removeprefix("{project}/")) in " ".join(refused), place
        assert not (project.folder / "profiles").exists() and not (project.folder / "protocol").exists()
    finally:
        remove_tree(project.folder)  # the clean-up of the tests recurses, with a bounded stack


BARS = {
    "immutable": ("chattr +i {0}/octopus.yaml", "chattr -i {0}/octopus.yaml", "octopus.yaml", "chattr -i"),
    "mounted over": (
        "mkdir -p {0}/protocol; mount -t tmpfs none {0}/protocol",
        "umount {0}/protocol",
        "protocol",
        "umount",
    ),
}


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can do that")
@pytest.mark.parametrize("bar", BARS)
def test_what_cannot_be_undone_ends_the_stage_and_all_else_is_undone(attacked: Attacked, bar: str) -> None:
    """The next attempt would take what stands there for a person's."""
    act, mend, name, how = (text.format(attacked.project.folder) for text in BARS[bar])
    project = attacked.project
    plant = f"echo '# planted' >> {project.folder}/octopus.yaml; mkdir -p {project.folder}/state/other; "
    plant += f"echo '{{}}' > {project.folder}/state/other/state.json"
    project.script = {"probe": [{"shell": f"{plant}; {act} || touch {attacked.mark}"}, "good"]}
    project.write()
    try:
        done = project.run("apply", "-auto-approve", "-target", "probe")
    finally:
        subprocess.run(mend, shell=True, check=False, stderr=subprocess.DEVNULL)
    if attacked.mark.exists():
        pytest.skip("this file system or this container does not allow it")
    assert done.status == 1 and "APPLY-NOT-UNDONE" in done.text and how in done.text, done.text
    assert len(project.attempts("probe")) == 1 and f"--> {name}" in done.text
    assert not (project.folder / "state" / "other").exists()


def test_a_program_that_an_agent_leaves_in_a_relative_folder_of_path_is_never_called(attacked: Attacked) -> None:
    project = attacked.project
    project.environ["PATH"] = ".::tools:" + project.environ["PATH"]
    program = f"#!/bin/sh\\ntouch {attacked.mark}\\n"
    act = f'mkdir -p {{0}}/tools; for place in . tools; do printf "{program}" > {{0}}/$place/git; '
    act += "chmod +x {0}/$place/git; done"
    project.script = {"probe": [{"shell": act.format(project.folder)}, "good"]}
    project.apply("-target", "probe", status=0)
    assert os.access(project.folder / "tools" / "git", os.X_OK)
    project.run("plan")
    assert not attacked.mark.exists()


CRONTAB = """#!/bin/sh
if [ "$1" = -l ]; then cat "$HOME/tab" 2>/dev/null; else cat > "$HOME/tab"; fi
"""
LISTED = """#!/bin/sh
cat "$HOME/${0##*/}.jobs" 2>/dev/null
"""
"""An `atq` and a `systemctl` that list what stands in a file."""


TODO = ".git/rebase-merge/git-rebase-todo"
ODD = r"$(printf 'x\377\033[31m\342\200\256.md')"
ALONE = {
    "given away": "chown 61234:61234 {project}/octopus.yaml",
    "no text": f'touch "{ODD}"; mkdir -p {{project}}/protocol; echo planted > "{{project}}/protocol/{ODD}"',
    "became a link": "for name in protocol profiles; do ln -s {home}/documents {project}/$name; done",
    "left standing": "echo x > {project}/AGENTS.md; mkdir {project}/.idea; echo x > {project}/.idea/run.xml; "
    "mkdir -p {project}/.octoform/bench/run {home}/.claude; echo '{{}}' > {project}/.octoform/bench/run/tokens.json; "
    "echo '{{}}' > {home}/.claude/settings.json",
    # What may be a person's own work stays, and refuses no attempt. `git rebase --continue` would run the steps; the
    # crontab is read by its program, since its file is closed to the person.
    "a person's": "git -C {project} -c user.name=A -c user.email=a@b commit -q --allow-empty -m theirs; "
    f"mkdir -p {{project}}/.git/rebase-merge; echo 'exec touch {{mark}}' > {{project}}/{TODO}; "
    "echo '* * * * * touch {mark}' | HOME={home} {home}/bin/crontab -; "
    "for name in atq systemctl; do echo '1 touch {mark}' > {home}/$name.jobs; done",
}
"""What an agent does in an attempt of its own, beside which nothing else is planted."""


def test_what_is_done_alone_is_told_undone_or_left_to_a_person(attacked: Attacked) -> None:
    project, home = attacked.project, attacked.home
    (home / "documents").mkdir()
    (home / "documents" / "novel.md").write_text("chapter one\n")
    (home / "bin").mkdir()
    for name, program in {"crontab": CRONTAB, "atq": LISTED, "systemctl": LISTED}.items():
        (home / "bin" / name).write_text(program)
        (home / "bin" / name).chmod(0o755)
    project.environ["XDG_RUNTIME_DIR"] = str(home)  # else no manager of this user is there to be asked
    acts = {name: act for name, act in ALONE.items() if name != "given away" or os.geteuid() == 0}
    project.script = {"probe": [{"shell": attacked.words(act)} for act in acts.values()]}
    project.manifest = {"budget": f"{{attempts: {len(acts)}}}"}
    project.write()
    text = project.run("apply", "-auto-approve", "-target", "probe", status=0).text
    refused = {name: refused_paths(attacked, attempt) for attempt, name in enumerate(acts)}

    assert "given away" not in acts or "octopus.yaml" in refused["given away"]
    facts = (project.folder / "octopus.yaml").stat()
    assert (facts.st_uid, facts.st_gid) == (os.geteuid(), os.getegid())

    assert any(path.startswith("protocol/x\\xff") for path in refused["no text"]) and "\x1b" not in text

    assert {"protocol", "profiles"} <= refused["became a link"]
    assert (home / "documents" / "novel.md").read_text() == "chapter one\n"
    assert not os.path.lexists(project.folder / "protocol")

    assert f"--> {TODO}" in text
    for schedule in ("crontab", "list of `at` jobs", "list of transient units"):
        assert f"your {schedule} changed while the agent ran" in text

    left = (f"{home}/.claude/settings.json", ".octoform/bench/run/tokens.json", ".idea/run.xml")
    for path in ("AGENTS.md", *left):
        assert f"--> {path}" in text, path

    record = json.loads((project.attempts("probe")[-1] / "attempt.json").read_text())
    outside = [item for item in record["diagnostics"] if item["code"] == "APPLY-OUTSIDE-WRITE"]
    [found] = [item for item in outside if "HEAD" in item["summary"]]
    assert found["severity"] == "warning"
    log = subprocess.run(["git", "-C", str(project.folder), "log", "--format=%s"], capture_output=True, text=True)
    assert log.stdout == "theirs\n"
    assert not attacked.mark.exists()


MOVES = {
    ".git": (
        "mv {project}/.git {project}/.git2; echo 'gitdir: .git2' > {project}/.git",
        "mv {project}/.git {home}/git",
    ),
    ".octoform": ("mv {project}/.octoform {home}/kept; ln -s {home}/kept {project}/.octoform",),
    "state": ("mv {project}/state {home}/kept-state; mkdir {project}/state; echo '{{}}' > {project}/state/state.json",),
}


def opened_and_moved(attacked: Attacked) -> None:
    """One attempt after another; each folder is whole again in its own place, and with its own rights.

    A user who may write a folder may replace what is in it, and what is closed hides a change.
    """
    project = attacked.project
    identity = ("-c", "user.name=x", "-c", "user.email=x@y", "-c", f"safe.directory={project.folder}")
    git = ["git", "-C", str(project.folder), *identity, "-c", "core.hooksPath=/dev/null"]
    subprocess.run([*git, "commit", "-q", "--allow-empty", "-m", "kept"], check=True)
    if project.user:
        subprocess.run(["chown", "-R", f"--reference={project.folder}", str(project.folder / ".git")], check=True)
    project.apply("-target", "probe", status=0)
    places = [project.folder / attacked.words(name) for name in RIGHTS]
    rights = [place.stat().st_mode for place in places]
    opening = "; ".join(attacked.words(text) for text in RIGHTS.values())
    opening = f"echo planted > {project.folder}/.git/hooks/pre-push; {opening}"
    ways = [(folder, attacked.words(way)) for folder, each in MOVES.items() for way in each]
    project.script = {"probe": [{"shell": opening}, *({"shell": way} for _, way in ways), "good"]}
    project.manifest = {"budget": f"{{attempts: {len(ways) + 2}}}"}
    before = {folder: (project.folder / folder).stat().st_ino for folder in MOVES}
    project.apply("-replace", "probe", "-target", "probe", status=0)
    assert refused_paths(attacked, 1) >= {attacked.words(name) for name in (*RIGHTS, ".git/hooks/pre-push")}
    assert [place.stat().st_mode for place in places] == rights
    assert not (project.folder / ".git" / "hooks" / "pre-push").exists()
    for attempt, (folder, way) in enumerate(ways, 2):
        assert folder in refused_paths(attacked, attempt), way
    assert {folder: (project.folder / folder).stat().st_ino for folder in MOVES} == before
    assert b"kept" in subprocess.run([*git, "log", "--oneline"], check=True, capture_output=True).stdout


def test_folders_that_an_agent_opens_closes_or_moves_away_are_as_they_were(attacked: Attacked) -> None:
    opened_and_moved(attacked)


@pytest.mark.skipif(not POSSIBLE or not OPEN_PYTHON.exists(), reason="only root can become another user")
def test_folders_are_as_they_were_for_an_ordinary_user(user: User) -> None:
    opened_and_moved(of_user(user))


def test_a_repository_that_an_agent_deletes_is_named_as_lost(attacked: Attacked) -> None:
    project = attacked.project
    project.script = {"probe": [{"shell": f"rm -rf {project.folder}/.git"}, "good"]}
    project.write()
    text = project.run("apply", "-auto-approve", "-target", "probe").text
    assert "could not be put back" in text and "--> .git\n" in text


def test_a_repository_that_an_agent_makes_is_moved_away(project: Project, tmp_path: Path) -> None:
    made = Attacked(project, tmp_path / "home")
    shutil.rmtree(project.folder / ".git")
    project.script = {
        "probe": [{"shell": f"git init -q {project.folder}; git init -q {project.folder.parent}"}, "good"]
    }
    project.apply("-target", "probe", status=0)
    assert {".git", str(project.folder.parent / ".git")} <= refused_paths(made, 0)
    assert not (project.folder / ".git").exists() and not (project.folder.parent / ".git").exists()
    assert (project.attempts("probe")[0] / "undone" / ".git" / "HEAD").is_file()


STARTS = [
    "planted.pth",
    "sitecustomize.py",
    "usercustomize.py",
    "fastmcp.py",
    "../../../pyvenv.cfg",
    "../../../bin/python",
]


def packages_of(project: Project) -> Path:
    """Where the packages of the endpoint lie."""
    manifest = json.loads((project.local / "endpoint" / "manifest.json").read_text())
    [packages] = Path(manifest["environment"]).glob("lib/python*/site-packages")
    return packages


def test_what_the_serving_interpreter_reads_at_its_start_is_no_agents_and_a_plan_tells_what_was_added(
    attacked: Attacked, compiled: Path
) -> None:
    project = attacked.project
    project.kept_servers = True
    project.take_environments(compiled)
    project.apply(status=0)
    packages = packages_of(project)
    places = [packages / name for name in STARTS]
    before = [(path.is_symlink(), path.exists() and path.read_bytes()) for path in places]
    planting = "; ".join(f"rm -f {path}; echo 'import os' > {path}" for path in places)
    project.script = {"probe": [{"shell": planting}, "good"]}
    project.apply("-replace", "probe", "-target", "probe", status=0)
    named = {str(path.resolve().parent / path.name) for path in places[:-1]}
    names = {str(project.folder / name) for name in refused_paths(attacked, -2)}
    assert names >= {os.path.normpath(path) for path in places}, named
    assert [(path.is_symlink(), path.exists() and path.read_bytes()) for path in places] == before

    # A plan reports what comes there otherwise, and gone with the next apply.
    (packages / "planted.pth").write_text("import os\n")
    assert "planted.pth was added to the serving environment" in project.run("plan").text
    project.script = {}
    project.apply(status=0)
    assert not (packages / "planted.pth").exists()


UNDONE = "mkdir -p {project}/protocol; echo planted > {project}/protocol/serve.md"
LINKED = {
    "import": ("ln -s {home}/theirs import", ""),
    "import/runtime": ("mkdir import; ln -s {home}/theirs import/runtime", ""),
    "undone": (f"ln -s {{home}}/theirs undone; {UNDONE}", "undone/protocol/serve.md"),
    "undone/protocol": (f"mkdir undone; ln -s {{home}}/theirs undone/protocol; {UNDONE}", "undone/protocol/serve.md"),
}
"""Where octoform itself writes in an attempt's folder afterwards: what its agent does, what is kept there."""


def test_a_link_in_the_attempts_folder_leads_octoform_nowhere_and_what_a_server_writes_on_import_is_refused(
    attacked: Attacked,
) -> None:
    project, theirs = attacked.project, attacked.home / "theirs"
    theirs.mkdir()
    plant = project.folder / "protocol" / "serve.md"
    source = (AGENT.parent / "good" / "server.py").read_text()
    evil = f'{source}\nPath("{plant.parent}").mkdir(exist_ok=True)\nPath("{plant}").write_text("planted")\n'
    head, _, tail = evil.partition("from fastmcp")
    links = {place: {"shell": attacked.words(act)} for place, (act, _) in LINKED.items()}
    written = {"write": f"{head}from pathlib import Path\nfrom fastmcp{tail}"}
    project.script = {
        "probe": [links["undone"], links["undone/protocol"], "good"],
        "serve": [written, links["import"]],
    }
    project.apply("-target", "serve", status=0)
    project.script["serve"] = [links["import/runtime"]]
    project.apply("-replace", "serve", "-target", "serve", status=0)
    assert list(theirs.iterdir()) == []
    assert (len(project.attempts("probe")), len(project.attempts("serve"))) == (3, 3)
    for attempt, place in enumerate(("undone", "undone/protocol")):
        assert (project.attempts("probe")[attempt] / LINKED[place][1]).read_text() == "planted\n", place
    assert not plant.exists()
    found = (project.attempts("serve")[0] / "attempt.json").read_text()
    assert "APPLY-OUTSIDE-WRITE" in found or "SERVE-" in found


@pytest.mark.parametrize("upgraded", [False, True], ids=["by its agent alone", "while it is brought up to date"])
def test_a_changed_spec_of_the_installation_is_put_back_unless_octoform_itself_has_changed(
    attacked: Attacked, tmp_path: Path, upgraded: bool
) -> None:
    """The installation is a copy of this one: package and specs, found before the real one."""
    installed, source = tmp_path / "installed", Path(octoform.__file__).parents[1]
    shutil.copytree(source / "octoform", installed / "octoform")
    shutil.copytree(source / "protocol", installed / "protocol")
    project = attacked.project
    project.environ["PYTHONPATH"], project.prefix = str(installed), ["env"]
    spec, schema = installed / "protocol" / "identify.md", next((installed / "protocol/schemas").glob("identify.*"))
    before = spec.read_bytes(), schema.read_bytes()
    shell = f"echo planted >> {spec}; echo '{{}}' > {schema}"
    shell += f"; echo >> {installed}/octoform/__init__.py" if upgraded else ""
    project.script = {"probe": [{"shell": shell}, "good"]}
    done = project.apply("-target", "probe")
    assert {str(spec), str(schema)} <= refused_paths(attacked, 0), done.text
    assert ((spec.read_bytes(), schema.read_bytes()) == before) is not upgraded


def test_what_octoform_prints_into_a_file_of_the_project_is_whole_and_nobodys_fault(project: Project) -> None:
    project.script = {"probe": ["good"]}
    project.write()
    log = project.folder / "apply.log"
    with log.open("w") as stream:
        command = [str(OCTOFORM), "apply", "-auto-approve", "-target", "probe"]
        subprocess.run(command, cwd=project.folder, env=project.environment(), stdout=stream, stderr=stream, check=True)
    record = json.loads((project.attempts("probe")[0] / "attempt.json").read_text())
    assert record["accepted"] and record["diagnostics"] == []
    text = log.read_text()
    assert "Apply complete" in text and "APPLY-OUTSIDE-WRITE" not in text
