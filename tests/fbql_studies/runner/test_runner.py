"""The runner of studies: the same results whatever the number of workers, and nothing lost when something dies."""

from __future__ import annotations

import argparse
import errno
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Timer
from typing import Any

import probe_study
import pytest
from commands import experiment as main
from fbql_studies import experiment
from fbql_studies.runner.store import COUNTS, Store, write_failure, write_result
from fbql_studies.runner.study import MEASURED, STUDIES, Parameters, study_of
from patience import PATIENCE_S
from places import ROOT

PROBE = ("probe", "probe_study")
LAUNCH = (
    f"import sys; from fbql_studies.runner.study import STUDIES; STUDIES.update([{PROBE!r}]); "
    "from fbql.cli.app import run; sys.exit(run('experiment', sys.argv[1:], 'experiment.py'))"
)


@pytest.fixture(autouse=True)
def the_probe_is_a_study(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Makes the probe known, and puts back the handlers of the signals that the command takes."""
    monkeypatch.setitem(STUDIES, *PROBE)
    monkeypatch.setattr(experiment, "STUDIES", {PROBE[0]: PROBE[1]})
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


def arguments(place: Path, *more: str, out: str = "out", jobs: int = 2) -> list[str]:
    return ["probe", "--place", str(place), "--out", str(place / out), "--jobs", str(jobs), "--json", *more]


def results_in(directory: Path) -> dict[str, Any]:
    """The results by task, but for what was measured."""
    found = {path.name: json.loads(path.read_text()) for path in (directory / "tasks").glob("*.json")}
    for result in found.values():
        del result[MEASURED]
    return found


def launched(place: Path, *more: str) -> subprocess.Popen[str]:
    """The command in a process of its own."""
    path = os.pathsep.join(entry for entry in sys.path if entry)
    return subprocess.Popen(
        [sys.executable, "-c", LAUNCH, *arguments(place, *more)],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def is_running(process_id: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_one_worker_and_two_give_the_same_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments(tmp_path, "--seeds", "2", out="one", jobs=1)) == 0
    one = json.loads(capsys.readouterr().out)
    assert main(arguments(tmp_path, "--seeds", "2", out="two", jobs=2)) == 0
    two = json.loads(capsys.readouterr().out)
    assert len(results_in(tmp_path / "one")) == 2
    assert results_in(tmp_path / "one") == results_in(tmp_path / "two")
    assert one["table"] == two["table"]


def test_json_is_one_object_with_the_table_and_the_same_as_in_the_directory(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments(tmp_path, "--seeds", "2")) == 0
    printed = capsys.readouterr().out
    assert printed.count("\n") == 1
    summary = json.loads(printed)
    assert summary["table"][0]["n"] == summary["tasks"] == summary["done"] == 2
    assert summary["columns"] == probe_study.COLUMNS
    assert summary["out"] == str(tmp_path / "out")
    assert json.loads((tmp_path / "out" / "table.json").read_text()) == summary
    assert (tmp_path / "out" / "figure.svg").exists()


def test_a_killed_worker_costs_its_task_one_retry(tmp_path: Path) -> None:
    assert main(arguments(tmp_path, "--seeds", "1", "--others", "kill_once")) == 0
    assert sorted(probe_study.attempts(tmp_path)) == ["draw0", "kill_once", "kill_once"]
    assert set(results_in(tmp_path / "out")) == {"draw0.json", "kill_once.json"}


@pytest.mark.parametrize(
    ("task", "reason"),
    [
        ("kill", "the worker was ended by SIGKILL"),
        ("raise", "ValueError: this task always fails"),
        ("infinite", "ValueError: Out of range float values are not JSON compliant: inf"),
    ],
)
def test_a_task_that_always_fails_is_recorded_and_the_table_tells_n(
    task: str, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments(tmp_path, "--seeds", "1", "--others", task)) == 1
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert probe_study.attempts(tmp_path).count(task) == 2
    assert summary["failed"] == {task: reason}
    assert summary["table"][0]["n"] == summary["done"] == 1
    assert f"{task} FAILED: {reason}" in captured.err


def test_a_result_that_cannot_be_written_fails_its_task_with_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments(tmp_path, "--seeds", "1", "--others", "unwritable")) == 1
    failed = json.loads(capsys.readouterr().out)["failed"]
    assert failed["unwritable"].startswith("IsADirectoryError: ")


def test_a_task_that_failed_is_tried_again_by_the_next_run(tmp_path: Path) -> None:
    assert main(arguments(tmp_path, "--seeds", "1", "--others", "raise")) == 1
    with Store(tmp_path / "out", json.loads((tmp_path / "out" / "config.json").read_text())) as store:
        assert store.failure_of("raise")
        write_result(store.directory, "raise", {"value": 1.0, MEASURED: {}})
        assert store.failure_of("raise") == ""
    assert main(arguments(tmp_path, "--seeds", "1", "--others", "raise")) == 0
    assert probe_study.attempts(tmp_path).count("draw0") == 1


def test_a_run_goes_on_where_a_killed_one_was(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    process = launched(tmp_path, "--seeds", "2", "--others", "wait")
    for path in ("waits", "out/tasks/draw0.json", "out/tasks/draw1.json"):
        probe_study.wait_for(tmp_path / path)
    process.kill()
    process.communicate()
    worker = int((tmp_path / "waits").read_text())
    (tmp_path / "gate").touch()
    assert main(arguments(tmp_path, "--seeds", "2", "--others", "wait")) == 0
    assert not is_running(worker)
    assert sorted(probe_study.attempts(tmp_path)) == ["draw0", "draw1", "wait", "wait"]
    assert "2 of 3 tasks are already done" in capsys.readouterr().err


def test_ctrl_c_ends_the_workers_and_says_how_to_go_on(tmp_path: Path) -> None:
    process = launched(tmp_path, "--seeds", "0", "--others", "wait")
    probe_study.wait_for(tmp_path / "waits")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert errors.splitlines()[-1] == "experiment.py: stopped; the same command resumes from here"
    assert not is_running(int((tmp_path / "waits").read_text()))


def test_a_second_run_into_a_directory_is_refused_while_the_first_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    process = launched(tmp_path, "--seeds", "0", "--others", "wait")
    try:
        probe_study.wait_for(tmp_path / "waits")
        assert main(arguments(tmp_path, "--seeds", "0", "--others", "wait")) == 2
        assert "a study is running there now" in capsys.readouterr().err
    finally:
        (tmp_path / "gate").touch()
        out, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0
    assert json.loads(out)["done"] == 1


@pytest.mark.parametrize(
    ("config", "says"),
    [
        ({"options": {"seeds": 1, "others": ["wait"]}}, "holds this study with --others wait, not no --others;"),
        ({"options": {"seeds": 1, "goals": 5}}, "holds this study with --goals 5, not no --goals;"),
        ({"else": 1}, "holds a config.json that is not a study's;"),
        ({"study": "trees"}, "holds the study trees, not probe;"),
        ({"options": {"seeds": 2, "max_steps": 7}}, "holds this study with --max-steps 7, not no --max-steps;"),
        ([], "holds a config.json that is not a study's;"),
    ],
)
def test_a_directory_of_another_study_or_other_options_is_refused(
    config: Any, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out" / "tasks").mkdir(parents=True)
    write_result(tmp_path / "out", "draw0", {"value": 1.0})
    path = tmp_path / "out" / "config.json"
    asked = {"study": "probe", "options": {"seeds": 2, "others": [], "place": str(tmp_path)}}
    if isinstance(config, dict):
        config = {**asked, **config, "options": {**asked["options"], **config.get("options", {})}}
    path.write_text(json.dumps(config, indent=2, sort_keys=True) + "\n")
    assert main(arguments(tmp_path, "--seeds", "2")) == 2
    captured = capsys.readouterr()
    assert says in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""


@pytest.mark.parametrize("text", ["[" * 100_000, '{"study": ' + "9" * 5000 + "}", "\x00", ""], ids=str.__len__)
def test_a_config_that_is_none_is_refused(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out" / "tasks").mkdir(parents=True)
    write_result(tmp_path / "out", "draw0", {"value": 1.0})
    (tmp_path / "out" / "config.json").write_text(text)
    assert main(arguments(tmp_path, "--seeds", "2")) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_study_that_did_nothing_leaves_its_directory_to_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments(tmp_path, "--scheduler", "nonsense://x")) == 2
    assert main(arguments(tmp_path, "--seeds", "0", "--others", "raise")) == 1, "a task ended, if badly"
    assert main(arguments(tmp_path, "--seeds", "1")) == 2
    assert "holds this study with --others raise, not no --others;" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out" / "tasks").iterdir()] == ["raise.failed"]


@pytest.mark.parametrize("other", ["tables.md", "tasks/draw7.json", "notes.txt"])
def test_a_directory_with_more_than_a_begun_study_is_not_another_s(other: str, tmp_path: Path) -> None:
    (tmp_path / "out" / "tasks").mkdir(parents=True)
    config = tmp_path / "out" / "config.json"
    config.write_text(json.dumps({"study": "other", "options": {}}))
    (tmp_path / "out" / other).touch()
    assert main(arguments(tmp_path, "--seeds", "1")) == 2
    assert json.loads(config.read_text())["study"] == "other"
    (tmp_path / "out" / other).unlink()
    assert main(arguments(tmp_path, "--seeds", "1")) == 0


@pytest.mark.parametrize(
    "config", [[], {"else": 1}, {"study": "probe", "options": {}, "else": 1}, {"study": 1, "options": {}}]
)
def test_what_is_no_study_s_stays(config: Any, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    path = tmp_path / "out" / "config.json"
    path.write_text(json.dumps(config))
    assert main(arguments(tmp_path, "--seeds", "1")) == 2
    assert json.loads(path.read_text()) == config


def test_a_directory_serves_more_seeds_and_fewer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments(tmp_path, "--seeds", "1")) == 0
    assert main(arguments(tmp_path, "--seeds", "3")) == 0
    summary = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (summary["options"]["seeds"], summary["done"]) == (3, 3)
    assert sorted(probe_study.attempts(tmp_path)) == ["draw0", "draw1", "draw2"]
    assert main(arguments(tmp_path, "--seeds", "2")) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["table"][0]["n"] == 2
    assert told.err == "2 of 2 tasks are already done\n"
    assert len(probe_study.attempts(tmp_path)) == 3


def test_a_config_that_cannot_be_written_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(arguments(tmp_path, "--seeds", "1")) == 0
    capsys.readouterr()
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    monkeypatch.setattr("fbql_studies.runner.store.write_atomically", lambda _path, _data: (_ for _ in ()).throw(full))
    assert main(arguments(tmp_path, "--seeds", "2")) == 2
    error = capsys.readouterr().err
    assert "out: can't be used for a study (No space left on device); make room there" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("name", STUDIES)
def test_no_task_of_more_seeds_and_trees_is_mistaken_for_one_of_fewer(name: str) -> None:
    if name == "peers":
        pytest.importorskip("gymnasium", reason="an optional extra, which is in requirements/test.txt")
    study = study_of(name)

    def tasks(count: int) -> dict[str, Parameters]:
        parser = argparse.ArgumentParser()
        study.add_options(parser)
        options = parser.parse_args([])
        for option in COUNTS:
            if option in vars(options):
                setattr(options, option, count)
        return {task.key: task.parameters for task in study.tasks(options)}

    few, many = tasks(2), tasks(3)
    assert all(many.get(key, parameters) == parameters for key, parameters in few.items())
    assert few != many
    plays_several_seeds_a_task = name == "paper"
    assert plays_several_seeds_a_task or few.keys() & many.keys(), "nothing that is done would stay"


def test_what_a_stopped_study_leaves_and_another_layout_of_the_options_are_no_other_study(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / ".config.json.123.tmp").touch()
    assert main(arguments(tmp_path, "--seeds", "1")) == 0
    path = tmp_path / "out" / "config.json"
    path.write_text(json.dumps(json.loads(path.read_text())))
    assert main(arguments(tmp_path, "--seeds", "1")) == 0


def test_a_directory_with_other_files_is_refused_and_left_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "notes.txt").touch()
    assert main(arguments(tmp_path)) == 2
    assert "not a study's directory: it contains notes.txt; choose a new one" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["notes.txt"]


def test_results_are_told_as_tables_of_words_and_kept_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = [each for each in arguments(tmp_path, "--seeds", "2") if each != "--json"]
    assert main(told) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:3] == ["what was drawn", "", "tasks                mean"]
    assert lines[-2].startswith("2 of 2 tasks; results in ")
    assert lines[-1] == f"figure {tmp_path / 'out' / 'figure.svg'}"
    assert (tmp_path / "out" / "tables.md").read_text().startswith("what was drawn\n\n| tasks | mean |\n")


@pytest.mark.parametrize("more", [("--seeds", "-1"), ("--jobs", "0"), ("--scheduler", "nonsense://x")])
def test_options_that_cannot_be_used_are_refused_in_one_line(
    more: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = list(arguments(tmp_path, *more))
    if "--scheduler" in words:  # with which --jobs has no effect, as another line would say
        at = words.index("--jobs")
        del words[at : at + 2]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"experiment.py: {more[0]}")
    assert error.count("\n") == 1


def test_a_place_that_cannot_be_used_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").touch()
    assert main(arguments(tmp_path, out="file")) == 2
    assert "choose another place" in capsys.readouterr().err


def test_the_revisions_that_did_the_tasks_are_told_and_not_the_one_that_tells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def told(revision: str, *more: str) -> tuple[str, str]:
        monkeypatch.setattr(experiment, "own_revision", lambda: revision)
        main(arguments(tmp_path, *more))
        captured = capsys.readouterr()
        return json.loads(captured.out)["git_revision"], captured.err

    assert told("none", "--seeds", "0", "--others", "raise") == (
        "unknown",
        f"1 task, 1 at a time; results go to {tmp_path / 'out'}, and Ctrl-C loses none that are done\n"
        "[1/1] raise FAILED: ValueError: this task always fails\n",
    )
    shutil.rmtree(tmp_path / "out")
    assert told("one", "--others", "raise")[0] == "one"
    revision, said = told("two", "--others", "raise")
    assert revision == "one", "it did nothing that lasts"
    assert "note: they were done by another revision of the project" in said
    (tmp_path / "out" / "tasks" / "draw0.json").unlink()
    assert told("two", "--others", "raise")[0] == "one, two"
    (tmp_path / "out" / "tasks" / "draw0.json").unlink()
    (tmp_path / "out" / "revisions.json").unlink()
    assert told("four", "--others", "raise")[0] == "unknown, four"
    (tmp_path / "out" / "tasks" / "draw0.json").unlink()
    (tmp_path / "out" / "revisions.json").write_text("3")
    assert told("five", "--others", "raise")[0] == "unknown, five"


def test_without_matplotlib_the_tables_are_printed_and_one_line_tells_of_the_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def draw(*_: object) -> list[Path]:
        raise ModuleNotFoundError("No module named 'matplotlib'", name="matplotlib")

    monkeypatch.setattr(probe_study, "figures", draw)
    assert main(arguments(tmp_path)) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["table"]
    assert "warning: no figures: this needs matplotlib, which is not installed: " in captured.err


def test_a_torn_result_counts_as_not_done(tmp_path: Path) -> None:
    with Store(tmp_path, {}) as store:
        write_result(tmp_path, "a", {"value": 1})
        assert store.result_of("a") == {"value": 1}
        for torn in ('{"val', "", "{}", "[1]", "null", "[" * 100_000, '{"value": NaN}'):
            (tmp_path / "tasks" / "a.json").write_text(torn)
            assert store.result_of("a") is None
        write_failure(tmp_path, "a", "reason")
        assert store.failure_of("a") == "reason"
    Store(tmp_path, {}).__exit__(None, None, None)


@pytest.mark.parametrize("name", sorted(STUDIES))
def test_every_study_has_what_a_study_needs(name: str) -> None:
    study = study_of(name)
    assert study.DESCRIPTION
    assert isinstance(study.CAPTIONS, dict)
    parts = ("add_options", "tasks", "run", "table", "words", "figures")
    assert all(callable(getattr(study, part)) for part in parts)


@pytest.mark.parametrize("name", sorted(STUDIES))
def test_every_column_of_a_study_says_what_it_is(name: str) -> None:
    path = ROOT / "docs" / "data" / f"{name}.json"
    if not path.exists():
        pytest.skip("it has not been run for the documents yet")
    rows = json.loads(path.read_text())["table"]
    assert rows and all(study_of(name).COLUMNS[column] for row in rows for column in row)


@contextmanager
def cluster(
    place: Path, workers: int = 2, first: Sequence[str] = ()
) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """The address of a Dask scheduler, and the processes: its own and those of the workers.

    Args:
        first: directories that they import from before all others.
    """
    path = os.pathsep.join([*first, *(entry for entry in sys.path if entry)])
    file = str(place / "scheduler.json")
    commands = [
        ["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", file],
        *[["worker", "--scheduler-file", file, "--nthreads", "1", "--no-dashboard", "--no-nanny"]] * workers,
    ]
    processes: list[subprocess.Popen[bytes]] = []
    try:
        for number, (program, *options) in enumerate(commands):
            with (place / f"log{number}").open("wb") as log:
                processes.append(
                    subprocess.Popen(
                        [sys.executable, "-m", f"distributed.cli.dask_{program}", *options],
                        env={**os.environ, "PYTHONPATH": path},
                        cwd=place,
                        stdout=log,
                        stderr=subprocess.STDOUT,
                    )
                )
            probe_study.wait_for(Path(file))
        yield json.loads(Path(file).read_text())["address"], processes
    finally:
        for process in processes:
            process.kill()  # a worker that is asked to end may wait for a scheduler that ends as well
        for process in processes:
            process.wait(timeout=PATIENCE_S)


@pytest.mark.long
def test_a_cluster_gives_the_results_of_the_local_workers_and_a_killed_worker_costs_one_retry(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed", reason="Dask is in requirements/study.txt")
    with cluster(tmp_path) as (address, processes):
        assert main(arguments(tmp_path, "--others", "raise", "kill_once", "--scheduler", address, out="cluster")) == 1
        summary = json.loads(capsys.readouterr().out)
    assert probe_study.attempts(tmp_path).count("kill_once") == 2
    assert main(arguments(tmp_path, "--others", "raise", "kill_once", out="local")) == 1
    assert results_in(tmp_path / "cluster") == results_in(tmp_path / "local")
    assert summary["failed"] == {"raise": "ValueError: this task always fails"}
    workers = {
        json.loads(found.read_text())[MEASURED]["process"] for found in (tmp_path / "cluster" / "tasks").glob("*.json")
    }
    assert workers <= {process.pid for process in processes[1:]}


def test_a_cluster_without_workers_is_reported_in_one_line_within_seconds(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="Dask is in requirements/study.txt")
    with cluster(tmp_path, workers=0) as (address, _):
        process = launched(tmp_path, "--seeds", "1", "--jobs", "1", "--scheduler", address)
        assert process.stderr is not None
        said = ""
        limit = Timer(60.0, process.kill)
        limit.start()
        while "no workers" not in said:
            line = process.stderr.readline()
            assert line, f"it ended without saying so: {said}"
            said += line
        process.send_signal(signal.SIGINT)
        process.communicate()
        limit.cancel()
    assert f"--scheduler {address}: it has no workers; waiting until one connects" in said
    assert "--jobs has no effect with --scheduler" in said
    assert "Traceback" not in said


def test_a_cluster_without_this_project_is_refused_in_one_line_and_no_task_counts_as_failed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed", reason="Dask is in requirements/study.txt")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "fbql_studies.py").write_text("raise ModuleNotFoundError(\"No module named 'fbql_studies'\")\n")
    with cluster(tmp_path, workers=0, first=[str(elsewhere)]) as (address, _):
        assert main(arguments(tmp_path, "--seeds", "1", "--scheduler", address)) == 2
    said = capsys.readouterr().err.splitlines()
    assert f"--scheduler {address}: it, or a worker, cannot import this project" in said[-1]
    assert list((tmp_path / "out" / "tasks").iterdir()) == []


def test_there_are_as_many_workers_as_cores_that_may_be_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = arguments(tmp_path, "--seeds", "2")
    at = words.index("--jobs")
    allowed = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(allowed)})
        assert experiment.usable_cores() == 1
        assert main([*words[:at], *words[at + 2 :]]) == 0
        assert "2 tasks, 1 at a time" in capsys.readouterr().err
    finally:
        os.sched_setaffinity(0, allowed)
    assert experiment.usable_cores() == len(allowed)


@pytest.mark.long
def test_a_cluster_that_ends_ends_the_study_in_one_line_and_it_goes_on_without(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="Dask is in requirements/study.txt")
    with cluster(tmp_path) as (address, processes):
        process = launched(tmp_path, "--seeds", "1", "--others", "wait", "--scheduler", address)
        probe_study.wait_for(tmp_path / "waits")
        processes[0].kill()
        _, said = process.communicate(timeout=120)
    assert process.returncode == 2, said
    assert f"--scheduler {address}: it ended; the same command resumes from here" in said
    assert "Traceback" not in said
    (tmp_path / "gate").touch()
    assert main(arguments(tmp_path, "--seeds", "1", "--others", "wait")) == 0
