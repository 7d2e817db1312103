"""`init`: a first manifest that is valid, explains everything, and replaces nothing."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.manifest import model_url
from octoform.manifest.loader import load
from octoform.manifest.model import Daemon, Network, Notify, Perception, Tunnel
from octoform.manifest.schema.document import json_schema
from octoform.manifest.starter import SCHEMA_FILE, starter_text, write_starter

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(
    ("host", "machine", "chosen"),
    [
        (None, "Bench_2.lab.example", "bench-2"),
        (None, "localhost", "local"),
        (None, "", "local"),
        (None, "böse", "b-se"),
        (None, "-_-", "local"),
        (None, "1234", "1234"),
        (None, "null", "null"),
        (None, "yes", "yes"),
        (None, "0x1f", "0x1f"),
        (None, "x" * 80, "x" * 63),
        ("rig", "bench", "rig"),
    ],
)
def test_the_written_manifest_loads(tmp_path: Path, host: str | None, machine: str, chosen: str) -> None:
    path = tmp_path / "octopus.yaml"
    assert write_starter(path, host, machine) == (chosen, [])
    manifest, found = load(path, {})
    assert found == []
    assert manifest is not None
    assert manifest.host == chosen


@given(st.text(max_size=100))
def test_every_machine_has_a_legal_name(machine: str) -> None:
    assert model_url.is_legal_host(model_url.host_of_machine(machine))


def test_nothing_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "octopus.yaml"
    path.write_text("mine")
    chosen, found = write_starter(path, None, "bench")
    assert chosen is None
    assert [item.code for item in found] == ["MANIFEST-EXISTS"]
    assert path.read_text() == "mine"
    dangling = tmp_path / "link.yaml"
    dangling.symlink_to(tmp_path / "elsewhere.yaml")
    assert write_starter(dangling, None, "bench")[0] is None
    assert not (tmp_path / "elsewhere.yaml").exists()


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    _, found = write_starter(tmp_path / "none" / "octopus.yaml", None, "bench")
    assert [item.code for item in found] == ["MANIFEST-UNWRITABLE"]


def test_an_illegal_choice_is_refused_with_the_nearest_name(tmp_path: Path) -> None:
    _, found = write_starter(tmp_path / "octopus.yaml", "My Bench", "x")
    assert [(item.code, item.hint) for item in found] == [("MANIFEST-WRONG-VALUE", "did you mean `my-bench`?")]
    assert list(tmp_path.iterdir()) == []


def test_the_schema_is_named_where_it_is(tmp_path: Path) -> None:
    schema = tmp_path / SCHEMA_FILE
    schema.parent.mkdir(parents=True)
    schema.write_text("{}")
    write_starter(tmp_path / "octopus.yaml", None, "bench")
    first = (tmp_path / "octopus.yaml").read_text("utf-8").splitlines()[0]
    assert first == f"# yaml-language-server: $schema={SCHEMA_FILE}"


def test_the_shipped_manifest_is_the_starter_and_names_the_schema() -> None:
    shipped = ROOT / "octopus.yaml"
    assert shipped.read_text("utf-8") == starter_text("local", SCHEMA_FILE)
    assert (ROOT / SCHEMA_FILE).is_file()
    manifest, found = load(shipped, {})
    assert manifest is not None
    assert found == []


def test_the_commented_settings_are_valid_too(tmp_path: Path) -> None:
    def active(line: str) -> str:
        return line[1:] if re.match(r"#([a-z]|  [^ ]|    [^ ])", line) else line

    path = tmp_path / "octopus.yaml"
    text = starter_text("bench").replace("\nharness: builtin\n", "\n").replace("\nscope: local\n", "\n")
    path.write_text("\n".join(active(line) for line in text.splitlines()) + "\n")
    manifest, found = load(path, {"MY_AGENT_API_KEY": "x"})
    assert found == []
    assert manifest is not None
    assert manifest.harness_for("probe").name == "command"
    assert manifest.model_for("probe") == "vendor/model-name"
    assert manifest.budget_for("identify").attempts == 5
    assert manifest.tunnel == Tunnel()
    assert manifest.network == Network(hosts=("bench.example.org",))
    assert [limit.values.get("rate") for limit in manifest.policy.limits] == [None, None, (10, 60)]
    assert manifest.policy.timeout_for("capture_image") == 60
    assert manifest.perception == Perception(enabled=False, camera="usb-0000-0000", interval=300)
    result = Notify(("./notify-me",), "https://alerts.example.org/hook", desktop=True)
    assert manifest.daemon == Daemon(
        usd_per_hour=1.0, notify=result, metrics=Path("/var/lib/node_exporter/octoform.prom")
    )


def test_every_setting_is_in_the_starter_and_in_the_docs() -> None:
    docs = (ROOT / "docs" / "manifest.md").read_text("utf-8")
    starter = starter_text("bench")
    schema = json_schema()
    for key in schema["properties"]:
        assert f"{key}:" in starter
        assert f"`{key}`" in docs
    for table in schema["$defs"].values():
        for key in table["properties"]:
            assert f"`{key}`" in docs or f".{key}`" in docs
