"""A tree as C99 source without any dependency.

The C function follows the same splits with the same comparisons of doubles, so it answers bit for bit like `Tree.answer`,
on thresholds too. It is a table and a loop, because C compilers need not accept deeply nested ifs.
"""

from __future__ import annotations

import re

from fbql_common.core.field import WHEELS

from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.tree import Split, Tree


def to_c(tree: Tree) -> str:
    """A C99 file with `int NAME_answer(const double observation[d], double *left_rad_s, double *right_rad_s)`.

    For another command space than the wheels': `int NAME_answer(const double observation[d], double command[axes])`.
    """
    name = c_name(tree.behavior)
    axes = tree.commands.axes
    if tree.commands == WHEELS:
        results = "double *left_rad_s, double *right_rad_s"
        returned = (
            "Returns the leaf_id, and the reference of the left and the right wheel [rad/s]. The observation is:\n"
        )
        columns = "left_rad_s, right_rad_s"
        copies = "    *left_rad_s = leaves[leaf_id][0];\n    *right_rad_s = leaves[leaf_id][1];\n"
    else:
        results = f"double command[{len(axes)}]"
        listed = "".join(
            f" *   [{k}] {_comment(axis.name)} [{_unit(axis.unit)}], {axis.low!r} to {axis.high!r}\n"
            for k, axis in enumerate(axes)
        )
        returned = f"Returns the leaf_id, and the command:\n{listed} * The observation is:\n"
        columns = _comment(", ".join(axis.name for axis in axes))
        copies = f"    for (int k = 0; k < {len(axes)}; k++)\n        command[k] = leaves[leaf_id][k];\n"
    signature = f"int {name}_answer(const double observation[{len(tree.features)}], {results})"
    nodes = "".join(
        f"    {{{node.feature}, {node.left}, {node.right}, {float(node.threshold).hex()}}},\n"
        if isinstance(node, Split)
        else f"    {{-1, {node}, 0, 0.0}},\n"
        for node in tree.nodes
    )
    leaves = "".join(f"    {{{', '.join(float(value).hex() for value in leaf.command)}}},\n" for leaf in tree.leaves)
    features = "".join(f" *   [{k}] {_description(feature)}\n" for k, feature in enumerate(tree.features))
    return f"""\
/* The tree of behavior {_comment(tree.behavior)}: {tree.leaf_count} leaves, SHA-256 {tree.hash}.
 *
 * {signature};
 *
 * {returned}{features} * Outside these ranges the leaf at the edge answers. C99, no other file, no heap memory, thread-safe.
 */

const char {name}_tree_hash[] = "{tree.hash}";
const int {name}_leaf_count = {tree.leaf_count};

/* feature, left, right, threshold; feature -1: a leaf, and left is its leaf_id */
static const struct {{ int feature, left, right; double threshold; }} nodes[] = {{
{nodes}}};

/* {columns} */
static const double leaves[][{len(axes)}] = {{
{leaves}}};

{signature}
{{
    int at = 0;
    while (nodes[at].feature >= 0)
        at = observation[nodes[at].feature] < nodes[at].threshold ? nodes[at].left : nodes[at].right;
    const int leaf_id = nodes[at].left;
{copies}    return leaf_id;
}}
"""


def c_name(behavior: str) -> str:
    """A behavior's name as the beginning of a C identifier."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", behavior)
    return name if name[:1].isalpha() else f"tree_{name}"


def _description(feature: Feature) -> str:
    return _comment(f"{feature.name} [{feature.unit}], {feature.low!r} to {feature.high!r}")


def _unit(text: str) -> str:
    """A unit in a comment, such as m/s: a slash ends no comment where there is no star."""
    return _comment(text).replace("|", "/")


def _comment(text: str) -> str:
    """A text that cannot end the C comment it stands in."""
    plain = "".join(character if " " <= character <= "~" else "?" for character in text)
    return plain.replace("*", "?").replace("/", "|").replace("\\", "|")
