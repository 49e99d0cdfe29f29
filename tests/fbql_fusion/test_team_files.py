"""The trees that the fusion node reads for a controller that imagines: whole files of behaviors that command wheels."""

from __future__ import annotations

from pathlib import Path

import pytest
from fbql.match.trees import playing_trees
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.errors import BadInput
from fbql_fusion.core.tasks.soccer.world_model.team import Team
from fbql_fusion.team_files import read_playing_trees

FILES = [shipped_trees() / f"{name}.json" for name in ("ball_seeking", "wall_avoiding", "approaching")]


def test_the_files_have_the_trees_that_the_behaviors_play_with() -> None:
    read, played = read_playing_trees(FILES), playing_trees(map(load_tree, FILES))
    assert [tree.senses for tree in read] == [tree.senses for tree in played]
    one, other = (Team([tree.parts for tree in trees], [tree.senses for tree in trees]) for trees in (read, played))
    assert one.hashes == other.hashes == tuple(load_tree(path).hash for path in FILES)
    for mine, its in zip(one.trees, other.trees, strict=True):
        assert mine.tobytes() == its.tobytes()


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text[: len(text) // 2],
        lambda text: text.replace("ball_seeking", "ball_finding", 1),
        lambda _: "[]",
        lambda _: "{}",
        lambda text: text.replace('"sha256"', '"sha"'),
    ],
)
def test_a_file_that_is_no_whole_tree_is_refused_in_one_line_with_its_name(tmp_path: Path, change) -> None:
    path = tmp_path / "ball_seeking.json"
    path.write_text(change(FILES[0].read_text()))
    with pytest.raises(BadInput) as error:
        read_playing_trees([path])
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"absent\.json"):
        read_playing_trees([tmp_path / "absent.json"])
