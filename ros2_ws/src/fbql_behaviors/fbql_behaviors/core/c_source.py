"""A tree as C99 source without any dependency.

The C function follows the same splits with the same comparisons of doubles, so it answers bit for bit like `Tree.answer`,
on thresholds too. It is a table and a loop, because C compilers need not accept deeply nested ifs.
"""

from __future__ import annotations

import re

from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.tree import Split, Tree


def to_c(tree: Tree) -> str:
    """A C99 file with `int NAME_answer(const double observation[d], double *left_rad_s, double *right_rad_s)`."""
    name = c_name(tree.behavior)
    signature = (
        f"int {name}_answer(const double observation[{len(tree.features)}], double *left_rad_s, double *right_rad_s)"
    )
    nodes = "".join(
        f"    {{{node.feature}, {node.left}, {node.right}, {float(node.threshold).hex()}}},\n"
        if isinstance(node, Split)
        else f"    {{-1, {node}, 0, 0.0}},\n"
        for node in tree.nodes
    )
    leaves = "".join(
        f"    {{{float(leaf.left_rad_s).hex()}, {float(leaf.right_rad_s).hex()}}},\n" for leaf in tree.leaves
    )
    features = "".join(f" *   [{k}] {_description(feature)}\n" for k, feature in enumerate(tree.features))
    return f"""\
/* The tree of behavior {_comment(tree.behavior)}: {tree.leaf_count} leaves, SHA-256 {tree.hash}.
 *
 * {signature};
 *
 * Returns the leaf_id, and the reference of the left and the right wheel [rad/s]. The observation is:
{features} * Outside these ranges the leaf at the edge answers. C99, no other file, no heap memory, thread-safe.
 */

const char {name}_tree_hash[] = "{tree.hash}";
const int {name}_leaf_count = {tree.leaf_count};

/* feature, left, right, threshold; feature -1: a leaf, and left is its leaf_id */
static const struct {{ int feature, left, right; double threshold; }} nodes[] = {{
{nodes}}};

/* left_rad_s, right_rad_s */
static const double leaves[][2] = {{
{leaves}}};

{signature}
{{
    int at = 0;
    while (nodes[at].feature >= 0)
        at = observation[nodes[at].feature] < nodes[at].threshold ? nodes[at].left : nodes[at].right;
    const int leaf_id = nodes[at].left;
    *left_rad_s = leaves[leaf_id][0];
    *right_rad_s = leaves[leaf_id][1];
    return leaf_id;
}}
"""


def c_name(behavior: str) -> str:
    """A behavior's name as the beginning of a C identifier."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", behavior)
    return name if name[:1].isalpha() else f"tree_{name}"


def _description(feature: Feature) -> str:
    return _comment(f"{feature.name} [{feature.unit}], {feature.low!r} to {feature.high!r}")


def _comment(text: str) -> str:
    """A text that cannot end the C comment it stands in."""
    plain = "".join(character if " " <= character <= "~" else "?" for character in text)
    return plain.replace("*", "?").replace("/", "|").replace("\\", "|")
