"""Small bounded reads, and what the kernel's texts mean."""

import os
import subprocess
import sys
from pathlib import Path

from sysfs_tree import Tree

from octoform import runtime


def test_numbers_are_scaled_and_what_is_no_number_is_none(tmp_path: Path) -> None:
    for name, text in (("temp", "48123\n"), ("bad", "n/a\n"), ("hex", "0x1f\n"), ("empty", "")):
        (tmp_path / name).write_text(text)
    assert runtime.read_number(tmp_path / "temp", 0.001) == 48.123
    assert runtime.read_number(tmp_path / "bad") is None
    assert runtime.read_number(tmp_path / "absent") is None
    assert runtime.read_integer(tmp_path / "hex") == 31
    assert runtime.read_integer(tmp_path / "empty") is None
    assert runtime.read_first(tmp_path / "absent", tmp_path / "bad", tmp_path / "temp") == 48123


def test_reads_are_bounded_and_never_wait(tmp_path: Path) -> None:
    (tmp_path / "big").write_bytes(b"x" * 100_000)
    assert len(runtime.read_bytes(tmp_path / "big") or b"") == 4096
    os.mkfifo(tmp_path / "pipe")
    assert runtime.read_text(tmp_path / "pipe") == ""
    assert runtime.read_text(tmp_path) is None


def test_bytes_that_are_no_text_are_replaced(tmp_path: Path) -> None:
    (tmp_path / "name").write_bytes(b"Caf\xe9\x00\n")
    assert runtime.read_text(tmp_path / "name") == "Caf\ufffd"


def test_entries_are_in_natural_order(tmp_path: Path) -> None:
    for number in (10, 2, 1):
        (tmp_path / f"temp{number}_input").touch()
    found = runtime.files(tmp_path, "temp*_input")
    assert [path.name for path in found] == ["temp1_input", "temp2_input", "temp10_input"]


def test_bits_of_a_capability_map(tmp_path: Path) -> None:
    (tmp_path / "key").write_text("1 0 40000000000000\n")
    assert runtime.read_bits(tmp_path / "key") == [54, 128]
    assert runtime.read_bits(tmp_path / "absent") == []


def test_mounts_with_spaces_and_repeated_devices(tree: Tree) -> None:
    (tree.root / "proc/self/mountinfo").write_text(
        "22 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw\n"
        "23 22 8:2 / /mnt/my\\040disk rw - vfat /dev/sda2 rw\n"
        "24 22 8:1 /var /srv rw - ext4 /dev/sda1 rw\n"
        "garbage\n"
    )
    assert runtime.mounts() == {"8:1": ("/", "ext4"), "8:2": ("/mnt/my disk", "vfat")}


def test_free_space_is_asked_below_the_system_root(tree: Tree) -> None:
    assert runtime.free_bytes("/dev") is not None
    assert runtime.free_bytes("/nowhere") is None
    assert runtime.free_bytes(None) is None


def test_the_package_runs_alone_and_needs_only_the_standard_library(tmp_path: Path) -> None:
    import shutil

    shutil.copytree(Path(runtime.__file__).parent, tmp_path / "runtime")
    code = (
        "import runtime, sys; print(runtime.__file__);"
        "print({'octoform', 'fastmcp', 'asyncio'} & set(sys.modules))"  # the last takes as long as all the rest
    )
    done = subprocess.run([sys.executable, "-S", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [str(tmp_path / "runtime/__init__.py"), "set()"]
