"""What is installed and built, from what, and whether it is to be done again."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from environment import stamps, virtual, workspace
from environment.enter import is_ready
from environment.errors import SetUpError
from environment.target import Target
from places import ROOT
from setup_target import made_target, wheels_target


@pytest.fixture
def made(tmp_path: Path) -> Target:
    """A checkout whose environment looks made."""
    return made_target(tmp_path / "checkout")


def test_a_stamp_that_is_torn_missing_or_no_object_reads_as_none(tmp_path: Path) -> None:
    for content in (b"", b'{"path": "/x', b"[1]", b"\xff\xfe"):
        (tmp_path / "stamp").write_bytes(content)
        assert stamps.read(tmp_path / "stamp") == {}
    assert stamps.read(tmp_path / "none") == {}


def test_writing_a_stamp_replaces_it_whole_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    stamps.write(tmp_path / "stamp", {"a": 1})
    stamps.write(tmp_path / "stamp", {"b": 2})
    assert stamps.read(tmp_path / "stamp") == {"b": 2}
    assert [path.name for path in tmp_path.iterdir()] == ["stamp"]


def test_every_lock_is_complete_hashed_and_names_no_host() -> None:
    for name in sorted(path.stem for path in ROOT.glob("requirements*.txt")):
        text = (ROOT / f"{name}.txt").read_text()
        entries = virtual.requirements(text)
        assert entries
        assert sum(block.count("\n") + 1 for block in entries.values()) == len(text.splitlines())
        assert all("--hash=sha256:" in block for block in entries.values()), name
        assert "://" not in text
        assert "index-url" not in text


def test_the_locks_agree_and_each_test_lock_holds_its_run_lock() -> None:
    def pins(name: str) -> set[str]:
        return {block.split()[0] for block in virtual.requirements((ROOT / name).read_text()).values()}

    assert pins("requirements.txt") < pins("requirements-test.txt")
    assert pins("requirements-system.txt") < pins("requirements-system-test.txt")
    assert pins("requirements-system-test.txt") < pins("requirements-test.txt")
    assert pins("requirements.txt") < pins("requirements-study.txt")
    assert pins("requirements-system.txt") < pins("requirements-system-study.txt") < pins("requirements-study.txt")


def test_an_environment_is_installed_for_what_its_stamp_says(made: Target) -> None:
    assert virtual.is_installed(made, "run")
    assert not virtual.is_installed(made, "test")
    assert is_ready(made, "run")


def test_a_changed_lock_is_noticed_and_the_environment_can_still_be_installed_into(made: Target) -> None:
    made.run_lock.write_text("a==2 \\\n    --hash=sha256:22\n")
    assert not virtual.is_installed(made, "run")
    assert virtual.is_usable(made)


def test_a_changed_run_lock_asks_for_the_test_tools_again(made: Target) -> None:
    stamps.write(made.venv / virtual.STAMP, {"path": str(made.venv), **virtual.lock_hashes(made)})
    assert virtual.is_installed(made, "test")
    made.run_lock.write_text("a==2 \\\n    --hash=sha256:22\n")
    assert not virtual.is_installed(made, "test")


def test_the_extras_are_apart_and_each_is_asked_for_by_itself(made: Target) -> None:
    hashes = virtual.lock_hashes(made)
    stamps.write(made.venv / virtual.STAMP, {"path": str(made.venv), "run": hashes["run"], "study": hashes["study"]})
    assert virtual.is_installed(made, "study")
    assert not virtual.is_installed(made, "test")
    made.study_lock.write_text("a==1 \\\n    --hash=sha256:00\n")
    assert not virtual.is_installed(made, "study")
    assert virtual.is_installed(made, "run")


def test_a_half_made_environment_is_not_usable(made: Target) -> None:
    virtual.mark_unfinished(made)
    assert not virtual.is_usable(made)


def test_a_moved_checkout_has_no_usable_environment(made: Target, tmp_path: Path) -> None:
    moved = made.root.rename(tmp_path / "moved")
    assert not virtual.is_usable(wheels_target(moved))


def test_an_environment_whose_python_is_gone_is_not_usable(made: Target) -> None:
    made.python.unlink()
    made.python.symlink_to("/nowhere/python3.12")
    assert not virtual.is_usable(made)


def add_package(source: Path, name: str, build_type: str = "ament_python", depends: str = "") -> Path:
    place = source / name
    (place / name).mkdir(parents=True)
    depend = f"<exec_depend>{depends}</exec_depend>" if depends else ""
    (place / "package.xml").write_text(
        f"<package><name>{name}</name>{depend}<export><build_type>{build_type}</build_type></export></package>"
    )
    (place / name / "code.py").write_text("x = 1\n")
    return place


@pytest.fixture
def source(made: Target) -> Path:
    result = made.workspace / "src"
    add_package(result, "messages", "ament_cmake")
    add_package(result, "common", depends="messages")
    add_package(result, "node", depends="common")
    return result


def wanted(target: Target) -> dict[str, str]:
    return workspace.fingerprints(target, workspace.find_packages(target.workspace / "src"))


def changed(before: dict[str, str], after: dict[str, str]) -> set[str]:
    return {name for name in after if before.get(name) != after[name]}


def test_packages_are_found_at_any_depth_but_not_where_they_are_ignored(source: Path) -> None:
    add_package(source / "deeper" / "still", "far")
    hidden = add_package(source, "hidden")
    (hidden / "COLCON_IGNORE").touch()
    assert [package.name for package in workspace.find_packages(source)] == ["common", "far", "messages", "node"]


def test_a_manifest_that_is_no_xml_is_named(source: Path) -> None:
    (source / "node" / "package.xml").write_text("<package>")
    with pytest.raises(SetUpError, match=r"node/package\.xml is no XML"):
        workspace.find_packages(source)


@pytest.mark.parametrize("change", ["edit", "add", "remove", "rename", "mode"])
def test_any_change_of_a_packages_files_changes_its_fingerprint_alone(made: Target, source: Path, change: str) -> None:
    before = wanted(made)
    code = source / "node" / "node" / "code.py"
    if change == "edit":
        code.write_text("x = 2\n")
    elif change == "add":
        (code.parent / "more.py").touch()
    elif change == "remove":
        code.unlink()
    elif change == "rename":
        code.rename(code.parent / "other.py")
    else:
        code.chmod(0o755)
    assert changed(before, wanted(made)) == {"node"}


def test_a_change_of_a_compiled_package_reaches_what_depends_on_it(made: Target, source: Path) -> None:
    before = wanted(made)
    (source / "messages" / "A.msg").write_text("float64 x\n")
    assert changed(before, wanted(made)) == {"messages", "common"}


def test_what_running_and_installing_leaves_in_the_source_is_no_change(made: Target, source: Path) -> None:
    before = wanted(made)
    for name in (
        "node/__pycache__/code.pyc",
        "node.egg-info/PKG-INFO",
        "build/lib/x.py",
        ".pytest_cache/x",
        "n/.x.swp",
    ):
        path = source / "node" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    assert changed(before, wanted(made)) == set()


def test_the_cmake_options_concern_compiled_packages_and_the_lock_concerns_all(made: Target, source: Path) -> None:
    before = wanted(made)
    (made.workspace / "colcon.meta").write_text("names: {}\n")
    assert changed(before, wanted(made)) == {"messages", "common"}
    made.run_lock.write_text("a==3\n")
    assert changed(before, wanted(made)) == {"messages", "common", "node"}


def test_the_place_of_the_checkout_is_part_of_every_fingerprint(made: Target, source: Path, tmp_path: Path) -> None:
    before = wanted(made)
    made.root.rename(tmp_path / "moved")
    assert changed(before, wanted(wheels_target(tmp_path / "moved"))) == set(before)


def test_packages_that_need_each_other_in_a_circle_are_an_error(made: Target) -> None:
    add_package(made.workspace / "src", "egg", "ament_cmake", depends="hen")
    add_package(made.workspace / "src", "hen", "ament_cmake", depends="egg")
    with pytest.raises(SetUpError, match="circle"):
        wanted(made)


def install(target: Target, name: str) -> Path:
    """As if colcon had built a package and we had stamped it."""
    script = target.install / name / "share" / name / "package.sh"
    script.parent.mkdir(parents=True)
    script.touch()
    stamp = workspace.build_stamp(target, name, wanted(target)[name])
    stamps.write(target.install / name / workspace.STAMP, stamp)
    return script


def test_a_package_is_stale_until_stamped_and_when_somebody_else_built_over_it(made: Target, source: Path) -> None:
    script = install(made, "node")
    assert set(workspace.stale_packages(made, wanted(made))) == {"common", "messages"}
    os.utime(script, ns=(1, 1))
    assert "node" in workspace.stale_packages(made, wanted(made))


def test_a_package_that_is_not_whole_is_stale_whatever_its_stamp_says(made: Target, source: Path) -> None:
    install(made, "node")
    (made.install / "node/share/node/package.sh").unlink()
    stamps.write(made.install / "node" / workspace.STAMP, workspace.build_stamp(made, "node", wanted(made)["node"]))
    assert "node" in workspace.stale_packages(made, wanted(made))


def test_what_is_installed_without_a_source_is_left_over(made: Target, source: Path) -> None:
    install(made, "node")
    before = wanted(made)
    del before["node"]
    assert workspace.leftover_packages(made, before) == [made.install / "node"]
