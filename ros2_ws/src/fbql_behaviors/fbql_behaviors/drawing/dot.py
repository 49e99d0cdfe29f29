"""A tree as a DOT graph for Graphviz."""

from __future__ import annotations

from math import degrees

from fbql_behaviors.core.explanation import command_text, rules
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.tree import Split, Tree
from fbql_behaviors.drawing.colours import COLOURS


def to_dot(tree: Tree) -> str:
    """The DOT graph of a tree: splits as questions, leaves in the color of their motion."""
    leaf_rules = rules(tree)
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
            rule, leaf = leaf_rules[node], tree.leaves[node]
            command = command_text(tree.commands, leaf.command)
            label = _quoted(f"leaf {node}\n{rule.what}\n{command}\n{leaf.patterns} patterns")
            lines.append(f'  n{index} [label={label}, fillcolor="{COLOURS[rule.motion]}"];')
    return "\n".join((*lines, "}", ""))


def _question(feature: Feature, threshold: float) -> str:
    if feature.unit == "rad":
        return f"{feature.name} < {degrees(threshold):.4g} degrees?"
    return f"{feature.name} < {threshold:.4g} {feature.unit}".strip() + "?"


def _quoted(text: str) -> str:
    """A DOT string: line breaks are \\n, and no character ends it early or forms an escape of Graphviz."""
    printable = "".join(character if character.isprintable() or character == "\n" else "?" for character in text)
    escaped = printable.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
