"""What is installed and built, from what, and whether it is to be done again."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from environment.target import BUILD_STAMP, UNFINISHED, Target, lock_entries, read_stamp, write_stamp
from places import ROOT
from setup_target import made_target, stamp_environment

LOCKS = sorted((ROOT / "requirements").glob("*.txt"))


@pytest.fixture
def made(tmp_path: Path) -> Target:
    """A checkout whose environment looks made."""
    return made_target(tmp_path / "checkout")


def test_a_stamp_that_is_torn_missing_or_no_object_reads_as_none(tmp_path: Path) -> None:
    for content in (b"", b'{"path": "/x', b"[1]", b"\xff\xfe"):
        (tmp_path / "stamp").write_bytes(content)
        assert read_stamp(tmp_path / "stamp") == {}
    assert read_stamp(tmp_path / "none") == {}


def test_writing_a_stamp_replaces_it_whole_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    write_stamp(tmp_path / "stamp", {"a": 1})
    write_stamp(tmp_path / "stamp", {"b": 2})
    assert read_stamp(tmp_path / "stamp") == {"b": 2}
    assert [path.name for path in tmp_path.iterdir()] == ["stamp"]


@pytest.mark.parametrize("path", LOCKS, ids=lambda path: path.stem)
def test_every_lock_is_complete_hashed_and_names_no_host(path: Path) -> None:
    text = path.read_text()
    entries = lock_entries(text)
    assert entries
    assert sum(block.count("\n") + 1 for block in entries.values()) == len(text.splitlines())
    assert all("--hash=sha256:" in block for block in entries.values())
    assert "://" not in text
    assert "index-url" not in text


def test_no_two_locks_name_different_versions() -> None:
    pins = {
        (name, block.split()[0].lower()) for path in LOCKS for name, block in lock_entries(path.read_text()).items()
    }
    assert len(pins) == len({name for name, _ in pins})


def test_a_system_ros_brings_its_own_part_of_the_locks() -> None:
    wheels, system = (
        Target(ROOT, underlay).requirements(["run", "study"]) for underlay in ((), (Path("/opt/ros/jazzy"),))
    )
    assert system.items() < wheels.items()
    assert {"mcap", "pymunk", "matplotlib"} < system.keys()
    assert system.keys().isdisjoint({"numpy", "pyyaml", "ros-jazzy-rclpy", "colcon-core"})


def test_an_environment_holds_what_its_stamp_says(made: Target) -> None:
    assert made.has_installed("run")
    assert not made.has_installed("test")
    assert made.is_ready("run", [])


def test_a_changed_run_lock_asks_for_everything_again_in_the_same_environment(made: Target) -> None:
    stamp_environment(made, "run", "test")
    assert made.has_installed("test")
    (made.root / "requirements/run.txt").write_text("a==2 \\\n    --hash=sha256:22\n")
    assert not made.has_installed("run") and not made.has_installed("test")
    assert made.installed()


def test_the_extras_are_apart_and_each_is_asked_for_by_itself(made: Target) -> None:
    stamp_environment(made, "run", "study")
    assert made.has_installed("study") and not made.has_installed("test")
    (made.root / "requirements/study.txt").write_text("a==1 \\\n    --hash=sha256:00\n")
    assert made.has_installed("run") and not made.has_installed("study")


def test_an_environment_that_is_half_made_moved_or_without_its_python_is_not_usable(made: Target) -> None:
    (made.venv / UNFINISHED).touch()
    assert not made.installed()
    (made.venv / UNFINISHED).unlink()
    assert not Target(made.root.rename(made.root.with_name("moved"))).installed()
    made.root.with_name("moved").rename(made.root)
    assert made.installed()
    made.python.unlink()
    made.python.symlink_to("/nowhere/python3.12")
    assert not made.installed()


def add_package(source: Path, name: str, build_type: str = "ament_python") -> Path:
    (source / name / name).mkdir(parents=True)
    manifest = f"<package><name>{name}</name><export><build_type>{build_type}</build_type></export></package>"
    (source / name / "package.xml").write_text(manifest)
    (source / name / "setup.py").write_text("setup()\n")
    (source / name / name / "code.py").write_text("x = 1\n")
    return source / name


@pytest.fixture
def source(made: Target) -> Path:
    """Sources: two packages of messages, and one in Python."""
    place = made.workspace / "src"
    add_package(place, "messages", "ament_cmake")
    add_package(place, "others", "ament_cmake")
    add_package(place, "node")
    return place


def wanted(target: Target) -> dict[str, str]:
    return target.fingerprints(target.packages())


def changed(before: dict[str, str], after: dict[str, str]) -> set[str]:
    return {name for name in before if before[name] != after[name]}


def test_packages_are_found_anywhere_but_in_hidden_and_ignored_places(made: Target, source: Path) -> None:
    add_package(source / "group", "nested")
    add_package(source / ".hidden", "hidden")
    (add_package(source, "ignored") / "COLCON_IGNORE").touch()
    found = {package.name: package.is_compiled for package in made.packages()}
    assert found == {"messages": True, "nested": False, "node": False, "others": True}


def test_an_edited_new_or_removed_module_of_a_python_package_needs_no_build(made: Target, source: Path) -> None:
    before = wanted(made)
    (source / "node/node/code.py").write_text("x = 2\n")
    (source / "node/node/new.py").touch()
    assert changed(before, wanted(made)) == set()
    (source / "node/node/code.py").unlink()
    assert changed(before, wanted(made)) == set()


@pytest.mark.parametrize(
    "name", ["package.xml", "setup.py", "setup.cfg", "resource/node", "node/data.json", "second/x.py"]
)
def test_what_describes_a_python_package_and_its_data_files_are_built_in(made: Target, source: Path, name: str) -> None:
    before = wanted(made)
    path = source / "node" / name
    path.parent.mkdir(exist_ok=True)
    with path.open("a") as file:
        file.write(" \n")
    assert changed(before, wanted(made)) == {"node"}


def test_any_file_of_a_compiled_package_is_built_into_all_compiled_ones(made: Target, source: Path) -> None:
    for name in ("A.msg", "messages/code.py"):
        before = wanted(made)
        (source / "messages" / name).write_text("float64 x\n")
        assert changed(before, wanted(made)) == {"messages", "others"}


@pytest.mark.parametrize(
    "name", ["node/__pycache__/code.pyc", "node.egg-info/PKG-INFO", "build/lib/x.txt", ".pytest_cache/x", "node/.x.swp"]
)
def test_what_running_and_installing_leaves_in_the_source_is_no_change(made: Target, source: Path, name: str) -> None:
    before = wanted(made)
    for package in ("node", "messages"):
        path = source / package / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    assert changed(before, wanted(made)) == set()


def test_cmake_options_concern_compiled_packages_and_the_lock_and_the_place_concern_all(
    made: Target, source: Path
) -> None:
    before = wanted(made)
    (made.workspace / "colcon.meta").write_text("names: {}\n")
    assert changed(before, wanted(made)) == {"messages", "others"}
    assert changed(before, wanted(Target(made.root.rename(made.root.with_name("moved"))))) == set(before)
    made.root.with_name("moved").rename(made.root)
    (made.root / "requirements/ros.txt").write_text("a==3\n")
    assert changed(before, wanted(made)) == set(before)


def install(target: Target, name: str) -> Path:
    """As if colcon had built a package and we had stamped it."""
    script = target.install / name / "share" / name / "package.sh"
    script.parent.mkdir(parents=True)
    script.touch()
    write_stamp(target.install / name / BUILD_STAMP, target.stamp(name, wanted(target)[name]))
    return script


def test_a_package_is_stale_until_stamped_when_not_whole_and_when_somebody_else_built_over_it(
    made: Target, source: Path
) -> None:
    script = install(made, "node")
    assert made.stale(made.packages()) == ["messages", "others"]
    os.utime(script, ns=(1, 1))
    assert "node" in made.stale(made.packages())
    script.unlink()
    assert "node" in made.stale(made.packages())


def test_what_is_built_without_a_source_is_left_over(made: Target, source: Path) -> None:
    install(made, "node")
    assert made.leftovers(made.packages()) == []
    assert made.leftovers([]) == [made.install / "node"]
