"""Every id that PROBE gives is an id that the runtime resolves: to that very folder, by words alone where it moved."""

import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hosts.plant import NAMES
from hypothesis import example, given
from hypothesis import strategies as st
from sysfs_tree import Tree

from octoform import runtime
from octoform.builtin.probe import probe_root
from octoform.runtime import binding

Planted = Callable[..., Path]
WORDS = st.sampled_from(
    (
        *(
            "AMDI0010",
            "PNP0C0A",
            "INT33A1",
            "gpio-keys",
            "regulator-3v3",
            "bcm2835",
            "snd_soc_dummy",
            "mt7921",
            "ad7606",
        ),
        *("lm75", "24c02", "k10temp", "BAT0", "rtc_cmos", "usb3", "serial8250", "spi0.1", "phy-vendor-9000-2"),
        *("été", "card0-HDMI-A-1", "device:1f", "3-wire"),
        "Fan 2",
        "X" * 90,
    )
)
WHERE = st.sampled_from(
    (
        *("{}:00", "{}:01", "{}.0", "{}.12", "{}.auto", "{}-2", "{}-17", "{}2", "{}"),
        *(
            "3f804000.{}",
            "fe00b880.{}:7",
            "soc:{}",
            "{}@40",
            "7-0050.{}",
            "{}.1.auto",
            "0000:00:{}",
            "{}:0a",
            "platform-{}-2",
        ),
    )
)
BUSES = ("platform", "acpi", "i2c", "spi", "pnp", "serio", "wmi", "hid", "virtio", "w1", "amba", "scsi", "mmc", "vmbus")
CLASSES = ("hwmon", "thermal", "power_supply", "backlight", "leds", "input", "rtc", "gpio", "iio", "watchdog", "sound")
FACTS = st.fixed_dictionaries(
    {},
    optional={
        "name": WORDS,
        "type": WORDS,
        "model": WORDS,
        "vendor": WORDS,
        "label": WORDS,
        "id": WORDS,
        "identity": WORDS,
        "description": WORDS,
        "modalias": st.builds("{}:{}".format, st.sampled_from(["i2c", "spi", "platform", "of:NnameT(null)C"]), WORDS),
    },
)
EVENTS = st.fixed_dictionaries({}, optional={"DRIVER": WORDS, "OF_NAME": WORDS, "MODALIAS": st.just("acpi:AMDI0010:")})
DEVICES = st.tuples(
    st.one_of(
        st.tuples(st.just("bus"), st.sampled_from(BUSES)), st.tuples(st.just("member"), st.sampled_from(CLASSES))
    ),
    st.builds(lambda form, word: form.format(word)[:120].replace("/", "!"), WHERE, WORDS),
    FACTS,
    EVENTS,
)


@contextmanager
def rooted(root: Path, devices: dict[str, Any] | None = None) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        patch.setenv("OCTOFORM_SYSROOT", str(root))
        patch.delenv("OCTOFORM_INSTANCES", raising=False)
        if devices is not None:
            file = Path(folder) / "instances.json"
            file.write_text(json.dumps({"format": 1, "devices": devices}))
            patch.setenv("OCTOFORM_INSTANCES", str(file))
        yield


def unresolved(root: Path) -> list[str]:
    """What PROBE named and the runtime does not find: by the ledger, and by the words of the id alone."""
    artifact: Any = probe_root(root)
    known = {each["id"]: each["instance"] for each in artifact["devices"] if "port" in each["instance"]}
    known = {name: instance for name, instance in known.items() if str(instance.get("sysfs")).startswith("/sys/")}
    wrong = []
    with rooted(root, known):
        for name, instance in known.items():
            folder = root.resolve() / instance["sysfs"].lstrip("/")
            found = runtime.device(name).folder
            if found != folder:
                wrong.append(f"{name} is {folder}, not {found}")
            if folder not in binding.kind_of(name)[1]:
                wrong.append(f"{name}: {folder.name} is not of the kind: {sorted(binding.kinds(folder))}")
            if not binding.matches(folder, name):
                wrong.append(f"{name} does not match {folder.name}")
    return wrong


@pytest.mark.parametrize("name", NAMES)
def test_every_id_of_a_recorded_host_is_found_at_run_time(name: str, planted: Planted) -> None:
    assert unresolved(planted(name)) == []


@given(st.lists(DEVICES, min_size=1, max_size=4, unique_by=lambda each: (each[0], each[1])))
@example([(("bus", "platform"), "AMDI0010:01", {}, {}), (("bus", "platform"), "AMDI0010:02", {}, {})])
def test_every_id_that_probe_can_give_is_found_at_run_time(devices: list[Any]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        tree = Tree(Path(folder) / "root")
        for (form, subsystem), name, facts, events in devices:
            parent = "platform" if form == "bus" else f"virtual/{subsystem}"
            getattr(tree, form)(f"{parent}/{subsystem}/{name}", subsystem, facts, **events)
        assert unresolved(tree.root) == []


@pytest.mark.parametrize(
    "name", ["AMDI0010:00", "AMDI0010:01", "i2c-AMDI0010:01", "amdi0010-2", "3f804000.i2c2", "serial8250", "dummy.12"]
)
def test_one_that_moved_is_known_by_its_words(tree: Tree, name: str) -> None:
    tree.bus(f"platform/{name}", "platform")
    artifact: Any = probe_root(tree.root)
    (each,) = [each["id"] for each in artifact["devices"] if each["instance"].get("port") == name]
    assert runtime.device(each).folder.name == name
