"""A tree in other languages: C99 without any dependency, and DOT for Graphviz.

The C function takes the same way through the same splits with the same comparisons of doubles, so it answers bit for bit
like `Tree.answer`, also on a threshold. It is a table and a loop: C compilers need not take deeply nested ifs.
"""

from __future__ import annotations

import re
from math import degrees

from fbql_behaviors.core.explanation import rules
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.partition_svg import COLOURS
from fbql_behaviors.core.tree import Split, Tree


def to_c(tree: Tree) -> str:
    """A C99 file with `int NAME_answer(const double observation[d], double *left_rad_s, double *right_rad_s)`."""
    name = c_name(tree.behavior)
    d = len(tree.features)
    splits: list[str] = []
    for node in tree.nodes:
        if isinstance(node, Split):
            splits.append(f"{{{node.feature}, {node.left}, {node.right}, {float(node.threshold).hex()}}}")
        else:
            splits.append(f"{{-1, {node}, 0, 0.0}}")
    leaves = [f"{{{float(leaf.left_rad_s).hex()}, {float(leaf.right_rad_s).hex()}}}" for leaf in tree.leaves]
    senses = [f" *   [{k}] {_feature(feature)}" for k, feature in enumerate(tree.features)]
    return "\n".join(
        (
            f"/* The tree of behavior {_comment(tree.behavior)}: {tree.leaf_count} leaves, SHA-256 {tree.hash}.",
            " *",
            f" * int {name}_answer(const double observation[{d}], double *left_rad_s, double *right_rad_s);",
            " *",
            " * Gives the leaf_id, and the reference of the left and the right wheel [rad/s]. The observation is:",
            *senses,
            " * Outside of these ranges the leaf at the edge answers. C99, no other file, no memory, thread-safe.",
            " */",
            "",
            f'const char {name}_tree_hash[] = "{tree.hash}";',
            f"const int {name}_leaf_count = {tree.leaf_count};",
            "",
            "/* feature, left, right, threshold; feature -1: a leaf, and left is its leaf_id */",
            "static const struct { int feature, left, right; double threshold; } nodes[] = {",
            *_lines(splits),
            "};",
            "",
            "/* left_rad_s, right_rad_s */",
            "static const double leaves[][2] = {",
            *_lines(leaves),
            "};",
            "",
            f"int {name}_answer(const double observation[{d}], double *left_rad_s, double *right_rad_s)",
            "{",
            "    int at = 0;",
            "    while (nodes[at].feature >= 0)",
            "        at = observation[nodes[at].feature] < nodes[at].threshold ? nodes[at].left : nodes[at].right;",
            "    const int leaf_id = nodes[at].left;",
            "    *left_rad_s = leaves[leaf_id][0];",
            "    *right_rad_s = leaves[leaf_id][1];",
            "    return leaf_id;",
            "}",
            "",
        )
    )


def to_dot(tree: Tree) -> str:
    """A DOT graph: splits as questions, leaves in the colour of their motion."""
    every = rules(tree)
    lines = [
        f"digraph {_quoted(tree.behavior)} {{",
        f"  label={_quoted(f'{tree.behavior}: {tree.leaf_count} leaves, SHA-256 {tree.hash[:12]}')};",
        '  node [shape=box, style="rounded,filled", fillcolor=white, fontname="sans-serif"];',
    ]
    for index, node in enumerate(tree.nodes):
        if isinstance(node, Split):
            lines.append(f"  n{index} [label={_quoted(_question(tree.features[node.feature], node.threshold))}];")
            lines.append(f'  n{index} -> n{node.left} [label="yes"];')
            lines.append(f'  n{index} -> n{node.right} [label="no"];')
        else:
            rule, (left, right, patterns) = every[node], tree.leaves[node]
            wheels = f"left {left:.0f}, right {right:.0f} rad/s"
            label = _quoted(f"leaf {node}\n{rule.what}\n{wheels}\n{patterns} patterns")
            lines.append(f'  n{index} [label={label}, fillcolor="{COLOURS[rule.motion]}"];')
    return "\n".join((*lines, "}", ""))


def c_name(behavior: str) -> str:
    """A behavior's name as the beginning of a C identifier."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", behavior)
    return name if name[:1].isalpha() else f"tree_{name}"


def _lines(items: list[str]) -> list[str]:
    return [f"    {item}," for item in items]


def _feature(feature: Feature) -> str:
    return _comment(f"{feature.name} [{feature.unit}], {feature.low!r} to {feature.high!r}")


def _comment(text: str) -> str:
    """A text that stays inside of a C comment, whatever it is."""
    plain = "".join(character if " " <= character <= "~" else "?" for character in text)
    return plain.replace("*", "?").replace("/", "|").replace("\\", "|")


def _question(feature: Feature, threshold: float) -> str:
    if feature.unit == "rad":
        return f"{feature.name} < {degrees(threshold):.4g} degrees?"
    return f"{feature.name} < {threshold:.4g} {feature.unit}".strip() + "?"


def _quoted(text: str) -> str:
    """A DOT string: line breaks are \\n, and nothing in it ends it or is an escape of Graphviz."""
    printable = "".join(character if character.isprintable() or character == "\n" else "?" for character in text)
    escaped = printable.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
