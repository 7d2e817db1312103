"""Locks and environments, built from tiny packages without any index."""

import json
import os
import shutil
from importlib.util import cache_from_source
from pathlib import Path
from threading import Thread

import pytest
from unit.endpoint.endpoint_servers import Wheelhouse

from octoform.diagnostics import UNTRUSTED_CERTIFICATE, Diagnostic
from octoform.endpoint.bounded_program import Finished, ForkServer, run
from octoform.endpoint.environment import lockfile
from octoform.endpoint.environment.build import COMPILED_BESIDE, GUESS, await_bytecode, build, prepare, prewarmed, prune
from octoform.endpoint.environment.lockfile import OFFLINE, network_hint, normalise, resolve
from octoform.endpoint.environment.model import (
    MARKER,
    Environment,
    at,
    installed,
    intact,
    locate,
    packages_of,
    pins,
    requirements,
)
from octoform.endpoint.published_files import MANIFEST
from octoform.state.layout import Layout


def codes(problems: tuple[Diagnostic, ...]) -> list[str]:
    return [item.code for item in problems]


def locked(layout: Layout, *requirements: str) -> str:
    lock, problems = resolve(requirements, layout.project)
    assert lock is not None, problems
    return lock


def built(layout: Layout, lock: str) -> Environment:
    environment, problems = build(layout, lock)
    assert environment is not None, problems
    return environment


def test_a_lock_holds_the_closure_with_hashes_and_nothing_of_the_machine(
    layout: Layout, wheelhouse: Wheelhouse
) -> None:
    wheelhouse.add("alpha", "1.0", "beta>=1")
    wheelhouse.add("beta", "1.2")
    lock = locked(layout, "alpha==1.0")
    assert pins(lock) == {"alpha": "1.0", "beta": "1.2"}
    assert lock.count("--hash=sha256:") == 2
    assert str(wheelhouse.folder) not in lock
    assert "#" not in lock


def test_equal_sets_give_equal_bytes(layout: Layout, wheelhouse: Wheelhouse) -> None:
    for name in ("alpha", "beta"):
        wheelhouse.add(name, "1.0")
    assert locked(layout, "alpha==1.0", "beta==1.0") == locked(layout, "beta==1.0", "alpha==1.0")


def test_normal_form_does_not_depend_on_order_spelling_or_comments() -> None:
    one = "B_b==1 \\\n    --hash=sha256:22 \\\n    --hash=sha256:11\n    # via x\na==2 \\\n    --hash=sha256:33\n"
    other = "# made for you\na==2 \\\n    --hash=sha256:33\nb.b==1 \\\n    --hash=sha256:11 \\\n    --hash=sha256:22\n"
    assert normalise(one) == normalise(other) == normalise(normalise(other))
    assert list(pins(normalise(one))) == ["a", "b-b"]


def test_a_former_lock_keeps_the_versions_that_still_fit(layout: Layout, wheelhouse: Wheelhouse) -> None:
    wheelhouse.add("alpha", "1.0", "beta>=1")
    wheelhouse.add("beta", "1.2")
    former = locked(layout, "alpha==1.0")
    wheelhouse.add("beta", "1.3")
    again, _ = resolve(["alpha==1.0"], layout.project, former)
    assert again == former
    assert pins(locked(layout, "alpha==1.0"))["beta"] == "1.3"


@pytest.mark.parametrize(
    "requirement",
    [
        "alpha @ https://example.org/alpha.whl",
        "-e .",
        "--index-url=https://example.org",
        "git+https://example.org/a",
        "./alpha.whl",
        "alpha==1.0\n--extra-index-url x",
    ],
)
def test_a_requirement_that_leaves_the_index_is_refused(layout: Layout, requirement: str) -> None:
    lock, problems = resolve(["alpha==1.0", requirement], layout.project)
    assert lock is None
    assert codes(problems) == ["ENDPOINT-REQUIREMENT-REFUSED"]


def test_what_cannot_be_resolved_is_told_in_the_tools_own_words(layout: Layout, wheelhouse: Wheelhouse) -> None:
    wheelhouse.add("alpha", "1.0")
    lock, problems = resolve(["alpha==9.9"], layout.project)
    assert lock is None
    assert codes(problems) == ["ENDPOINT-RESOLVE-FAILED"]
    assert "alpha==9.9" in str(problems[0].detail)


def test_without_a_network_a_warm_cache_is_enough(
    serving: Environment, layout: Layout, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HTTPS_PROXY", "HTTP_PROXY", "ALL_PROXY"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")
    lock = locked(layout, "fastmcp>=4.1,<4.2")
    assert locate(layout, lock).lock == serving.lock


def test_without_a_network_and_a_cache_the_reason_is_the_network(
    layout: Layout, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UV_CACHE_DIR", str(tmp_path / "empty"))
    monkeypatch.setenv("UV_DEFAULT_INDEX", "http://someone:secret@127.0.0.1:9/simple")
    monkeypatch.setenv("UV_HTTP_RETRIES", "0")
    lock, problems = resolve(["alpha==1.0"], layout.project)
    assert lock is None
    assert "connect the host" in str(problems[0].hint)
    assert "secret" not in str(problems[0])


def test_a_certificate_that_is_not_trusted_is_no_missing_network() -> None:
    words = "error: Failed to fetch\n  cause: error sending request\n  cause: invalid peer certificate: UnknownIssuer"
    assert network_hint(Finished(2, "", words, 1.0)) == UNTRUSTED_CERTIFICATE
    assert network_hint(Finished(2, "", words.partition("  cause: invalid")[0], 1.0)) == OFFLINE
    assert network_hint(Finished(2, "", "no solution", 1.0)) is None


def test_the_tool_sees_the_index_configuration_and_no_secrets(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIP_INDEX_URL", "https://mirror.example/simple")
    monkeypatch.setenv("PIP_FIND_LINKS", "/one /two")
    monkeypatch.setenv("MODEL_API_KEY", "not for uv")
    monkeypatch.setenv("UV_SYSTEM_PYTHON", "1")
    seen = lockfile.tool_environment()
    assert seen["UV_SYSTEM_CERTS"] == "true", "an inspecting proxy's certificate is in the system's store alone"
    assert seen["UV_DEFAULT_INDEX"] == "https://mirror.example/simple"
    assert seen["UV_FIND_LINKS"] == "/one,/two"
    assert "MODEL_API_KEY" not in seen
    assert "UV_SYSTEM_PYTHON" not in seen
    monkeypatch.setenv("UV_INDEX_URL", "https://own.example/simple")
    assert "UV_DEFAULT_INDEX" not in lockfile.tool_environment()


def test_an_environment_is_built_once_and_found_again(layout: Layout, wheelhouse: Wheelhouse) -> None:
    wheelhouse.add("alpha", "1.0")
    lock = locked(layout, "alpha==1.0")
    environment = built(layout, lock)
    assert installed(environment.path) == ["alpha-1.0"]
    assert intact(environment) == []
    made = (environment.path / MARKER).stat().st_mtime_ns
    assert built(layout, lock) == environment == at(environment.path)
    assert (environment.path / MARKER).stat().st_mtime_ns == made


def test_an_upgrade_behind_our_back_is_seen_and_repaired(layout: Layout, wheelhouse: Wheelhouse) -> None:
    wheelhouse.add("alpha", "1.0")
    lock = locked(layout, "alpha==1.0")
    environment = built(layout, lock)
    wheelhouse.add("alpha", "1.1")
    wheelhouse.add("gamma", "3.0")
    install = ["pip", "install", "-q", "--python", str(environment.python), "alpha==1.1", "gamma"]
    assert lockfile.packages(install, layout.project, 60.0).status == 0
    assert intact(environment) == [
        "alpha 1.0 -> 1.1 in the serving environment",
        "gamma 3.0 was added to the serving environment",
    ]
    assert intact(built(layout, lock)) == []


def test_an_environment_that_is_not_trusted_is_made_anew(layout: Layout, wheelhouse: Wheelhouse) -> None:
    wheelhouse.add("alpha", "1.0")
    lock = locked(layout, "alpha==1.0")
    environment = built(layout, lock)
    (environment.path / "rubbish").touch()
    assert built(layout, lock) == environment and (environment.path / "rubbish").exists()
    again, problems = build(layout, lock, again=True)
    assert (again, problems) == (environment, ())
    assert not (environment.path / "rubbish").exists()


def test_bytecode_that_a_running_endpoint_writes_meanwhile_is_no_obstacle(
    layout: Layout, wheelhouse: Wheelhouse, monkeypatch: pytest.MonkeyPatch
) -> None:
    wheelhouse.add("alpha", "1.0")
    lock = locked(layout, "alpha==1.0")
    place = built(layout, lock).path
    remove = shutil.rmtree

    def removed(path: Path, ignore_errors: bool = False) -> None:
        remove(path, ignore_errors=ignore_errors)
        if path == place:
            (place / "bytecode").mkdir(parents=True)

    monkeypatch.setattr(shutil, "rmtree", removed)
    environment, problems = build(layout, lock, again=True)
    assert environment is not None and at(place) is not None, problems


def test_a_build_that_was_cut_off_is_made_anew(layout: Layout, wheelhouse: Wheelhouse) -> None:
    wheelhouse.add("alpha", "1.0")
    lock = locked(layout, "alpha==1.0")
    environment = built(layout, lock)
    (environment.path / MARKER).unlink()
    (environment.path / "rubbish").touch()
    assert intact(environment)
    assert intact(built(layout, lock)) == []
    assert not (environment.path / "rubbish").exists()


def test_only_the_locks_hashes_are_installed(
    layout: Layout, wheelhouse: Wheelhouse, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wheelhouse.add("alpha", "1.0")
    lock = locked(layout, "alpha==1.0")
    wheelhouse.add("alpha", "1.0", "beta")
    monkeypatch.setenv("UV_CACHE_DIR", str(tmp_path / "another cache"))
    environment, problems = build(layout, lock)
    assert environment is None
    assert codes(problems) == ["ENDPOINT-BUILD-FAILED"]
    assert not locate(layout, lock).path.exists()


def test_pruning_keeps_what_is_named_and_drops_the_rest(layout: Layout, wheelhouse: Wheelhouse) -> None:
    environments = []
    for version in ("1.0", "1.1", "1.2"):
        wheelhouse.add("alpha", version)
        environments.append(built(layout, locked(layout, f"alpha=={version}")))
    (environments[1].path / MARKER).unlink()
    foreign = layout.environments / "notes.txt"
    foreign.touch()
    prune(layout, {environments[2].path})
    assert environments[2].path.is_dir()
    assert not environments[0].path.exists()
    assert not environments[1].path.exists()
    assert foreign.exists()


IMPORT = "import alpha; print(alpha.__cached__)"


def loaded(environment: Environment, layout: Layout) -> tuple[Path, int]:
    """Where the bytecode of a package lies once it was imported, and the file's number."""
    done = run([str(environment.python), "-I", "-c", IMPORT], cwd=layout.project, environment={}, timeout=30)
    path = Path(done.stdout.strip())
    return path, path.stat().st_ino


@pytest.mark.parametrize("mode", ["hardlink", "copy"])
@pytest.mark.parametrize("serves", [None, "environment", "previous_environment"])
def test_bytecode_of_equal_packages_is_shared(
    serves: str | None, mode: str, layout: Layout, wheelhouse: Wheelhouse, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UV_LINK_MODE", mode)
    for name in ("alpha", "beta", "gamma"):
        wheelhouse.add(name, "1.0")
    first = built(layout, locked(layout, "alpha==1.0"))
    if mode == "copy":  # some time ago
        os.utime(packages_of(first.path) / "alpha.py", (1, 1))
    compiled, number = loaded(first, layout)
    if serves is not None:
        named = {"environment": "", "previous_environment": None, serves: str(first.path)}
        manifest = {"format": 1, "files": {}, "lock": "", "tools": [], "server": "", "runtime": None, "launcher": None}
        layout.endpoint.mkdir()
        (layout.endpoint / MANIFEST).write_text(json.dumps(manifest | named))
    second = built(layout, locked(layout, "alpha==1.0", "beta==1.0"))
    # One that serves keeps what it has; of another one, which is dropped soon, it is taken.
    assert compiled.exists() == (serves is not None)
    cached, shared = loaded(second, layout)
    assert second.path in cached.parents and shared == number
    third = built(layout, locked(layout, "alpha==1.0", "gamma==1.0"))
    assert loaded(third, layout)[1] == number and not cached.exists()


def test_bytecode_of_a_source_that_was_edited_is_not_shared(
    layout: Layout, wheelhouse: Wheelhouse, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UV_LINK_MODE", "copy")
    for name in ("alpha", "beta"):
        wheelhouse.add(name, "1.0")
    first = built(layout, locked(layout, "alpha==1.0"))
    module = packages_of(first.path) / "alpha.py"
    module.write_text(module.read_text().replace("1.0", "9.9"))  # of the same size
    complete = (first.path / MARKER).stat().st_mtime
    os.utime(module, (complete + 1, complete + 1))  # the clock of the file system may not have gone on since then
    compiled, _ = loaded(first, layout)
    second = built(layout, locked(layout, "alpha==1.0", "beta==1.0"))
    # The copy may have been written in the same second, which is all that bytecode names.
    assert not compiled.exists() and not (packages_of(second.path) / "__pycache__" / compiled.name).exists()
    shown = [str(second.python), "-I", "-c", "import alpha; print(alpha.VERSION)"]
    assert run(shown, cwd=layout.project, environment={}, timeout=30).stdout == "1.0\n"


def test_prewarming_builds_beside_other_work_and_only_once(
    layout: Layout, wheelhouse: Wheelhouse, monkeypatch: pytest.MonkeyPatch
) -> None:
    wheelhouse.add("alpha", "1.0")
    lock = locked(layout, "alpha==1.0")
    with prewarmed(layout, ["alpha==1.0"]):
        pass
    assert intact(locate(layout, lock)) == []
    monkeypatch.setattr("octoform.endpoint.environment.build.prepare", None)
    with prewarmed(layout, ["alpha==1.0"]):
        pass


def test_a_guess_that_fails_is_no_problem(layout: Layout, wheelhouse: Wheelhouse) -> None:
    with prewarmed(layout, ["alpha==1.0"]):
        pass
    assert list(layout.environments.glob("[0-9a-f]*")) == []


def test_prewarming_leaves_bytecode_for_every_server(layout: Layout) -> None:
    assert prepare(layout, GUESS)
    (environment,) = layout.environments.glob("[0-9a-f]*")
    assert list(environment.glob("lib/python*/site-packages/fastmcp/server/__pycache__/server.*.pyc"))
    # These are compiled by another process, which compiles all of each: none has left FastMCP's needs.
    for folder in (packages_of(environment) / name for name in COMPILED_BESIDE):
        sources = list(folder.rglob("*.py"))
        assert sources and all(Path(cache_from_source(path)).is_file() for path in sources)


def test_who_would_compile_the_same_waits_for_it(
    layout: Layout, wheelhouse: Wheelhouse, monkeypatch: pytest.MonkeyPatch
) -> None:
    await_bytecode(layout)  # nothing is under way
    wheelhouse.add("alpha", "1.0")
    waits = Thread(target=await_bytecode, args=(layout,))
    early: list[bool] = []

    def compiling(*_: object) -> bool:
        waits.start()
        waits.join(0.05)
        early.append(not waits.is_alive())
        return True

    # The package is so small that its import is over before anyone can wait for it.
    monkeypatch.setattr(ForkServer, "loaded", compiling)
    assert prepare(layout, ["alpha==1.0"])
    waits.join(10)
    assert (early, waits.is_alive()) == ([False], False)


def test_what_a_package_asks_for_under_an_extra_counts_where_the_extra_is_asked_for(tmp_path: Path) -> None:
    texts = {
        "server_kit-4.1": "Requires-Dist: kit-slim[client]==4.1\nRequires-Dist: tzdata; sys_platform == 'win32'\n",
        "kit_slim-4.1": "Requires-Dist: httpx>=0.28; extra == 'client'\nRequires-Dist: redis; extra == \"tasks\"\n",
        "bear_type-0.2": "Requires-Dist: numpy; (python_version < '3.15') and extra == 'test-tox'\n",
        "httpx-0.28": "Requires-Dist: idna\nProvides-Extra: cli\n",
    }
    for name, lines in texts.items():
        (tmp_path / f"{name}.dist-info").mkdir()
        (tmp_path / f"{name}.dist-info/METADATA").write_text(f"Name: {name}\n{lines}\nRequires-Dist: of-the-readme\n")
    assert requirements(tmp_path) == {
        "server-kit": {"kit-slim", "tzdata"},
        "kit-slim": {"httpx"},
        "bear-type": frozenset(),
        "httpx": {"idna"},
    }
