"""Runs one command of ours on real file systems that are too small for what it writes.

Run in user and mount namespaces of its own, as root there: argv[1] is an empty directory, on which tmpfs are mounted, stdin
a JSON object {"command": NAME, "words": [...], "before": {file: text}, "fills": null or [[pages, inodes], ...]}. `words`
and the files of `before` may contain {disk}. Prints a JSON list with a report of each run; the first is with ample room,
and, unless fills are given, what it used sets how much room the others have.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import traceback
from importlib import import_module
from pathlib import Path
from typing import Any

PAGE_BYTES = 4096
AMPLE = (16384, 1000)
"""Pages and inodes."""


def main(disk: Path) -> None:
    asked = json.load(sys.stdin)
    words = [word.replace("{disk}", str(disk)) for word in asked["words"]]
    reports = [run_on(disk, AMPLE, asked["before"], asked["command"], words)]
    pages, inodes = reports[0]["used"]
    fills = asked["fills"] or points(pages, inodes)
    reports += [run_on(disk, fill, asked["before"], asked["command"], words) for fill in fills]
    print(json.dumps(reports))


def points(pages: int, inodes: int) -> list[tuple[int, int]]:
    """How much room there is, of what is needed: none at all, a few KB, half, most of it; the same for files."""
    by_size = sorted({0, max(0, min(1, pages - 1)), max(0, pages // 2), max(0, pages - 1)})
    by_count = sorted({0, max(0, inodes // 2), max(0, inodes - 1)})
    return [(each, AMPLE[1]) for each in by_size] + [(AMPLE[0], each) for each in by_count]


def run_on(disk: Path, free: tuple[int, int], before: dict[str, str], command: str, words: list[str]) -> dict[str, Any]:
    """A report about one run on a new file system with so many free pages and inodes."""
    pages = 1 + sum(-(-len(text.encode()) // PAGE_BYTES) for text in before.values())
    size, inodes = (pages + free[0]) * PAGE_BYTES, 2 + len(before) + free[1]
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size},nr_inodes={inodes}", "tmpfs", str(disk)], check=True)
    try:
        (disk / "filler").write_bytes(bytes(PAGE_BYTES))
        for name, text in before.items():
            (disk / name).write_text(text)
        state = os.statvfs(disk)
        code, said = run(command, words)
        after = os.statvfs(disk)
        files = {str(path.relative_to(disk)): path for path in disk.rglob("*")}
        del files["filler"]
        return {
            "free": free,
            "code": code,
            "stderr": said,
            "files": {name: text_of(path) for name, path in sorted(files.items())},
            "used": (state.f_bfree - after.f_bfree, state.f_ffree - after.f_ffree),
        }
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)


def text_of(path: Path) -> str:
    """The start of a file's text; of a directory nothing."""
    return "" if path.is_dir() else path.read_bytes()[:100_000].decode(errors="replace")


def run(command: str, words: list[str]) -> tuple[int, str]:
    """The exit code of a command in this process, and what it printed on stderr."""
    kept = [os.dup(descriptor) for descriptor in (1, 2)]
    said = os.memfd_create("stderr")
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(said, 2)
    try:
        code = call(command, words)
    except BaseException:  # a traceback is what the test looks for
        traceback.print_exc()
        code = -1
    sys.stdout.flush()
    sys.stderr.flush()
    for descriptor, before in zip((1, 2), kept, strict=True):
        os.dup2(before, descriptor)
        os.close(before)
    os.close(null)
    os.lseek(said, 0, os.SEEK_SET)
    with os.fdopen(said, "rb") as file:
        return code, file.read().decode()


def call(command: str, words: list[str]) -> int:
    """Runs a command, or the `main` of a module."""
    if "." in command:
        return import_module(command).main(words)
    from fbql.cli.app import run as run_command
    from fbql_studies.runner.study import STUDIES

    STUDIES["probe"] = "probe_study"
    try:
        return run_command(command, words, f"{command}.py")
    except SystemExit as end:
        return int(end.code or 0)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
