"""The sparse table of joint states."""

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_fusion.core.learners.literal.table import JointStateTable


def filled() -> JointStateTable:
    table = JointStateTable(2, 0.0)
    table.set_row((5, 1), (1.0, 2.0), (0.25, 0.75))
    table.set_row((0, 9), (3.0, 4.0), (0.5, 0.5))
    return table


def test_an_unknown_joint_state_has_the_initial_q_and_equal_weights():
    assert JointStateTable(4, 1.5).row((1, 2, 3, 4)) == ((1.5,) * 4, (0.25,) * 4)


def test_memory_grows_with_what_was_learned_and_not_with_what_was_looked_at():
    table = JointStateTable(3, 0.0)
    for leaf in range(1000):
        table.row((leaf, leaf, leaf))
    assert len(table) == 0
    table.set_row((100000, 1, 2), (0.0,) * 3, (1 / 3,) * 3)
    assert len(table) == 1


def test_export_is_sorted_and_has_the_documented_shapes_and_types():
    arrays = filled().to_arrays()
    assert arrays["joint_states"].tolist() == [[0, 9], [5, 1]]
    assert arrays["q"].tolist() == [[3.0, 4.0], [1.0, 2.0]]
    assert arrays["weights"].tolist() == [[0.5, 0.5], [0.25, 0.75]]
    assert [str(arrays[name].dtype) for name in ("joint_states", "q", "weights")] == ["int32", "float64", "float64"]


def test_an_empty_table_exports_arrays_without_rows():
    assert [array.shape for array in JointStateTable(3, 0.0).to_arrays().values()] == [(0, 3)] * 3


def test_import_gives_back_what_was_exported():
    table = JointStateTable(2, 0.0)
    table.load_arrays(filled().to_arrays())
    assert len(table) == 2
    assert table.row((5, 1)) == ((1.0, 2.0), (0.25, 0.75))
    assert table.row((0, 9)) == ((3.0, 4.0), (0.5, 0.5))


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("q", None, "no array 'q'"),
        ("q", np.zeros((3, 2)), "expected float64 [2, 2]"),
        ("q", np.zeros((2, 3)), "expected float64 [2, 2]"),
        ("q", np.zeros(2), "expected float64 [2, 2]"),
        ("q", np.zeros((2, 2), np.float32), "expected float64 [2, 2]"),
        ("q", np.array([[1.0, np.nan], [0.0, 0.0]]), "not finite"),
        ("weights", np.array([[0.5, 0.5], [np.inf, 0.0]]), "not finite"),
        ("weights", np.array([[0.5, 0.5], [0.5, 0.6]]), "do not sum to 1"),
        ("joint_states", np.array([[0, 1], [0, 1]], np.int32), "twice"),
        ("joint_states", np.array([[0, 1], [0, -1]], np.int32), "below 0"),
        ("joint_states", np.array(3, np.int32), "expected int32"),
        ("joint_states", np.array([["a", "b"], ["c", "d"]]), "expected int32"),
    ],
)
def test_arrays_that_are_no_table_are_refused_and_change_nothing(name, value, reason):
    arrays = filled().to_arrays()
    if value is None:
        del arrays[name]
    else:
        arrays[name] = value
    table = filled()
    with pytest.raises(BadInput) as refusal:
        table.load_arrays(arrays)
    assert reason in str(refusal.value)
    assert table.row((5, 1)) == ((1.0, 2.0), (0.25, 0.75))
