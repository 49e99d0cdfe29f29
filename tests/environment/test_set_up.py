"""What the set-up makes of a home that can't be written, of an odd umask, of a second user of the machine, and of
directories that somebody else made where its own belong.
"""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from environment.interpreter import Interpreter
from environment.progress import Step
from environment.set_up import SetUp, exclusive, is_ours, open_up, readable_as, remove, writable_cache
from environment.target import BUILD_STAMP, ENVIRONMENT_STAMP, UNFINISHED, Target, read_stamp
from setup_checkout import (
    REAL_PYTHON,
    command,
    fresh_environment,
    in_mount_namespace,
    make_checkout,
    run,
    start,
    write_package,
)

SPEAK = ("ros2", "run", "speaker", "speak")
BUILT = ("build", "install", "log")


def mode_of(path: Path) -> int:
    return stat.S_IMODE(path.lstat().st_mode)


@pytest.mark.parametrize(("root_mode", "file_mode"), [(0o755, 0o644), (0o750, 0o640), (0o700, 0o600)])
def test_files_are_made_as_readable_as_the_checkout_whatever_the_umask(
    tmp_path: Path, root_mode: int, file_mode: int
) -> None:
    tmp_path.chmod(root_mode)
    before = os.umask(0o077)
    try:
        with readable_as(tmp_path):
            (tmp_path / "made").touch()
        (tmp_path / "later").touch()
    finally:
        os.umask(before)
    assert (mode_of(tmp_path / "made"), mode_of(tmp_path / "later")) == (file_mode, 0o600)


def test_private_files_of_a_cache_become_as_readable_as_the_checkout(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    folder = tmp_path / "packages" / "inner"
    folder.mkdir(parents=True)
    private, program, link = folder / "private.py", folder / "program", folder / "link"
    private.touch(0o600)
    program.touch()
    program.chmod(0o700)
    link.symlink_to("/nowhere")
    folder.chmod(0o700)
    open_up(tmp_path / "packages", tmp_path)
    assert (mode_of(private), mode_of(program), mode_of(folder)) == (0o644, 0o755, 0o755)
    tmp_path.chmod(0o700)
    private.chmod(0o600)
    open_up(tmp_path / "packages", tmp_path)
    assert mode_of(private) == 0o600


def test_a_cache_that_can_not_be_written_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = {"HOME": str(tmp_path)}
    assert writable_cache(home)
    assert not writable_cache({})
    assert not writable_cache({"HOME": str(tmp_path / "gone")})
    (tmp_path / "file").touch()
    assert not writable_cache({"HOME": str(tmp_path / "file")})
    assert not writable_cache({**home, "XDG_CACHE_HOME": str(tmp_path / "file")})
    assert writable_cache({"HOME": "/nowhere", "XDG_CACHE_HOME": str(tmp_path / "cache")})
    (tmp_path / ".cache").mkdir()
    monkeypatch.setattr(os, "access", lambda path, _mode: path != tmp_path / ".cache")
    assert not writable_cache(home)


def test_a_fresh_set_up_works_with_a_read_only_home(tmp_path: Path) -> None:
    words = " ".join(command(make_checkout(tmp_path / "checkout"), *SPEAK))
    said = in_mount_namespace(
        "unset XDG_CACHE_HOME PIP_CACHE_DIR UV_CACHE_DIR && mount --bind $HOME $HOME && "
        f"mount -o remount,bind,ro $HOME && ! touch $HOME/x 2> /dev/null && {words}"
    )
    assert (said.returncode, said.stdout) == (7, "speaks\n"), said.stderr


@pytest.fixture(scope="module")
def under_strict_umask(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout that everybody can read, set up by an owner with umask 077, and with a home that is none."""
    checkout = make_checkout(tmp_path_factory.mktemp("umask") / "checkout")
    open_to_all(checkout)
    said = subprocess.run(
        command(checkout, *SPEAK),
        env=fresh_environment(HOME="/dev/null"),
        capture_output=True,
        text=True,
        preexec_fn=lambda: os.umask(0o077),
        check=False,
    )
    assert said.stdout == "speaks\n", said.stderr
    return checkout


def open_to_all(directory: Path) -> None:
    """As a clone made under the usual umask is."""
    for path in (directory, *directory.rglob("*")):
        path.chmod(path.stat().st_mode | (0o055 if path.is_dir() else 0o044))


def test_all_that_the_set_up_makes_can_be_read_by_whoever_can_read_the_checkout(under_strict_umask: Path) -> None:
    made = [under_strict_umask / place for place in (".venv", ".setup", *(f"ros2_ws/{name}" for name in BUILT))]
    paths = [path for place in made for path in (place, *place.rglob("*")) if not path.is_symlink()]
    assert len(paths) > 1000
    private = [path for path in paths if is_private(path)]
    assert private == []


def is_private(path: Path) -> bool:
    """Whether others may do less with a file than its owner, but for writing."""
    mode = mode_of(path)
    return mode & 0o055 != (mode & 0o500) >> 3 | (mode & 0o500) >> 6


SEEN_BY_ALL = """
set -e
number=0
keep() {  # the directory $1 stays where it is when what is above it becomes visible to everybody
    number=$((number + 1))
    mkdir /run/kept-$number
    mount --bind "$1" /run/kept-$number
}
mount -t tmpfs -o mode=755 none /run
umask 022
"""


def as_second_user(words: list[str], needed: list[Path]) -> subprocess.CompletedProcess[str]:
    """Run a command as the user 65534 without a home, who can reach the directories `needed` wherever they are."""
    if os.geteuid() != 0 or shutil.which("setpriv") is None or shutil.which("unshare") is None:
        pytest.skip("needs root, to become another user")
    hidden = {next((each for each in reversed(path.parents) if not mode_of(each) & 0o001), None) for path in needed}
    script = SEEN_BY_ALL + "".join(f"keep {path}\n" for path in needed)
    script += "".join(f"mount -t tmpfs -o mode=755 none {place}\n" for place in hidden if place)
    for number, path in enumerate(needed, start=1):
        script += f"mkdir -p {path}; mount --bind /run/kept-{number} {path}\n"
    script += f"exec setpriv --reuid 65534 --regid 65534 --clear-groups env -u HOME {' '.join(words)}"
    return run(["unshare", "--mount", "sh", "-c", script], fresh_environment())


def test_a_second_user_of_the_machine_can_run_a_checkout_that_its_owner_set_up(under_strict_umask: Path) -> None:
    said = as_second_user(command(under_strict_umask, *SPEAK), [Path(sys.base_prefix), under_strict_umask])
    assert (said.returncode, said.stdout, said.stderr) == (7, "speaks\n", "")


def test_a_second_user_who_would_have_to_build_gets_one_line(under_strict_umask: Path) -> None:
    settings = under_strict_umask / "ros2_ws/src/speaker/setup.cfg"
    before = settings.read_text()
    settings.write_text(before + "\n")
    try:
        said = as_second_user(command(under_strict_umask, *SPEAK), [Path(sys.base_prefix), under_strict_umask])
    finally:
        settings.write_text(before)
    assert (said.returncode, said.stdout, said.stderr.count("\n")) == (2, "", 1)
    assert "is not writable; make it so, or clone into a directory of your own" in said.stderr


def contents(directory: Path) -> dict[str, bytes]:
    """Every file below a directory; of a link where it leads."""
    return {
        str(path.relative_to(directory)): bytes(path.readlink()) if path.is_symlink() else path.read_bytes()
        for path in directory.rglob("*")
        if path.is_symlink() or path.is_file()
    }


def test_what_somebody_else_made_is_moved_away_and_kept_whole(tmp_path: Path) -> None:
    checkout = make_checkout(tmp_path / "checkout")
    workspace = checkout / "ros2_ws"
    own = checkout / ".venv"
    assert run([str(REAL_PYTHON), "-m", "venv", "--without-pip", str(own)], fresh_environment()).returncode == 0
    (own / "notes.txt").write_text("of the user's own\n")
    write_package(tmp_path / "elsewhere" / "mine")
    build = [str(Path(sys.prefix, "bin/colcon")), "--log-base", "/dev/null", "build", "--merge-install"]
    build += ["--base-paths", "src", str(tmp_path / "elsewhere")]
    done = subprocess.run(build, cwd=workspace, capture_output=True, text=True, check=False)
    assert (workspace / "install/.colcon_install_layout").read_text().strip() == "merged", done.stderr
    before = [contents(place) for place in (own, workspace / "install", workspace / "build/speaker")]
    mine = contents(workspace / "build/mine")

    said = start(checkout, *SPEAK)

    assert said.stdout == "speaks\n", said.stderr
    kept = checkout / ".setup/set-aside"
    assert [contents(kept / f"{name}-1") for name in (".venv", "install", "speaker")] == before
    assert contents(workspace / "build/mine") == mine
    for name in (".venv", "install", "speaker"):
        assert f"was not made by this set-up: it is now {kept / name}-1" in said.stderr
    assert start(checkout, *SPEAK).stderr == ""


def test_a_package_that_somebody_else_installed_beside_ours_stays(under_strict_umask: Path) -> None:
    workspace = under_strict_umask / "ros2_ws"
    for place in ("install", "build"):
        (workspace / place / "guest").mkdir()
        (workspace / place / "guest/file").write_text("kept\n")
    (workspace / "src/speaker/setup.cfg").open("a").write("\n")
    said = start(under_strict_umask, *SPEAK)
    assert (said.stdout, "building speaker" in said.stderr) == ("speaks\n", True)
    assert all((workspace / place / "guest/file").read_text() == "kept\n" for place in ("install", "build"))
    assert start(under_strict_umask, *SPEAK).stderr == ""


@pytest.mark.parametrize("mark", [ENVIRONMENT_STAMP, UNFINISHED, BUILD_STAMP])
def test_a_removal_that_is_cut_short_leaves_neither_finished_work_nor_what_looks_like_somebody_elses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mark: str
) -> None:
    made, outside = tmp_path / "made", tmp_path / "outside"
    (made / "inner").mkdir(parents=True)
    outside.mkdir()
    (outside / "file").touch()
    (made / "link").symlink_to(outside)
    (made / mark).write_text('{"path": "x"}')

    def end(_path: Path) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as change, pytest.raises(KeyboardInterrupt):
        change.setattr(shutil, "rmtree", end)
        remove(made)
    assert is_ours(made)
    assert read_stamp(made / mark) == {}
    remove(made)
    assert not made.exists()
    assert (outside / "file").exists()


def test_only_what_carries_a_stamp_is_removed(tmp_path: Path) -> None:
    theirs, link = tmp_path / "theirs", tmp_path / "link"
    theirs.mkdir()
    (theirs / "file").touch()
    link.symlink_to(theirs)
    for path in (theirs, link, tmp_path / "none"):
        remove(path)
    assert (theirs / "file").exists()
    (theirs / BUILD_STAMP).touch()
    remove(link)
    assert (theirs / "file").exists()
    remove(theirs)
    assert not theirs.exists()


def test_the_environment_has_pip_for_the_optional_extras_also_where_uv_installs_the_locks(tmp_path: Path) -> None:
    target = Target(tmp_path / "checkout")
    (target.workspace / "src").mkdir(parents=True)
    for lock_file in target.locks("run"):
        lock_file.parent.mkdir(exist_ok=True)
        lock_file.touch()
    uv = tmp_path / "bin" / "uv"
    uv.parent.mkdir()
    uv.touch(0o755)
    environ = {**os.environ, "PATH": f"{uv.parent}{os.pathsep}{os.environ['PATH']}"}
    with exclusive(target.state / "lock") as lock:
        work = SetUp(target, "run", environ, lock)
        assert work.which("uv") == str(uv)
        work.make_venv(Interpreter(sys.executable, "3.12", has_ensurepip=True), Step(1, 1, "making an environment"))
    assert (target.site_packages / "pip").is_dir()
