"""Trees and curves as pictures: what they show, where, in which colour; and names that cannot break out of their place."""

from __future__ import annotations

import re
from math import inf, pi
from xml.etree import ElementTree

import numpy as np
import pytest
from fbql_behaviors.core.explanation import Motion, rules
from fbql_behaviors.core.observation import Feature
from fbql_behaviors.core.tree import Leaf, Split, Tree
from fbql_behaviors.drawing.colours import COLOURS, OPACITY
from fbql_behaviors.drawing.curve import curve_svg
from fbql_behaviors.drawing.dot import to_dot
from fbql_behaviors.drawing.partition import MAX_POINTS, partition_svg
from fbql_behaviors.drawing.svg import multiples, ticks_between
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from hypothesis import given
from tree_strategies import FEATURES, NASTY, trees

SVG = "{http://www.w3.org/2000/svg}"


def test_names_cannot_break_out_of_svg_and_dot() -> None:
    tree = Tree(NASTY, (Feature(NASTY, NASTY, 0.0, 1.0),), (Split(0, 0.5, 1, 2), 0, 1), (Leaf(1, 2, 3), Leaf(4, 5, 6)))
    svg = partition_svg(tree)
    ElementTree.fromstring(svg)
    assert "<script>" not in svg
    dot = to_dot(tree)
    assert len(dot.splitlines()) == 9
    assert all(len(re.findall(r'(?<!\\)(?:\\\\)*"', line)) % 2 == 0 for line in dot.splitlines())


@given(trees())
def test_dot_has_a_node_for_each_node_and_an_edge_for_each_child(tree: Tree) -> None:
    dot = to_dot(tree)
    splits = sum(isinstance(node, Split) for node in tree.nodes)
    assert len(re.findall(r"^  n\d+ \[label=", dot, flags=re.MULTILINE)) == len(tree.nodes)
    assert len(re.findall(r"^  n\d+ -> n\d+ \[label=\"(?:yes|no)\"\];$", dot, flags=re.MULTILINE)) == 2 * splits
    assert dot.count("\\nleft ") == tree.leaf_count


def rectangles(svg: str) -> list[ElementTree.Element]:
    return [each for each in ElementTree.fromstring(svg).iter(f"{SVG}rect") if each.find(f"{SVG}title") is not None]


@given(trees())
def test_the_rectangles_of_a_partition_tile_the_picture(tree: Tree) -> None:
    found = rectangles(partition_svg(tree))
    assert len(found) == tree.leaf_count
    assert sum(float(r.attrib["width"]) * float(r.attrib["height"]) for r in found) == pytest.approx(
        470 * 400, rel=0.01
    )


@given(trees())
def test_a_region_has_the_colour_of_its_motion_and_names_its_rule(tree: Tree) -> None:
    for rectangle, rule in zip(rectangles(partition_svg(tree)), rules(tree), strict=True):
        assert rectangle.attrib["fill"] == COLOURS[rule.motion]
        assert float(rectangle.attrib["fill-opacity"]) == OPACITY[rule.speed]
        assert rectangle[0].text == f"leaf {rule.leaf_id}: {rule.sentence}"


def test_every_motion_has_a_colour_of_its_own() -> None:
    assert set(COLOURS) == set(Motion)
    assert len(set(COLOURS.values())) == len(Motion)


def test_a_region_lies_where_its_numbers_say() -> None:
    nodes = (Split(0, 1.6, 1, 2), 0, Split(1, pi / 2, 3, 4), 1, 2)
    tree = Tree("ball_seeking", FEATURES, nodes, tuple(Leaf(1.0, 1.0, 1) for _ in range(3)))
    left, _, corner = rectangles(partition_svg(tree))
    assert [float(left.attrib[key]) for key in ("x", "y", "width", "height")] == [64.0, 34.0, 235.0, 400.0]
    # the upper quarter of the angles, on the far side
    assert [float(corner.attrib[key]) for key in ("x", "y", "width", "height")] == [299.0, 34.0, 235.0, 100.0]


def test_patterns_are_drawn_and_thinned() -> None:
    tree = load_tree(shipped_trees() / "ball_seeking.json")
    few = partition_svg(tree, np.array([[0.5, 0.1], [99.0, 0.0]]))
    assert few.count("h0") == 2
    assert "M534.0 234.0h0" in few  # outside of the root region: at its edge
    many = partition_svg(tree, np.random.default_rng(0).uniform(0.0, 1.0, (10_000, 2)))
    assert many.count("h0") == MAX_POINTS


@pytest.mark.parametrize(("d", "panels"), [(1, 1), (2, 1), (3, 3), (4, 6), (5, 6)])
def test_more_features_are_cut_in_pairs_and_one_makes_a_strip(d: int, panels: int) -> None:
    features = tuple(Feature(f"x{k}", "m", 0.0, 1.0) for k in range(d))
    tree = Tree("any", features, (Split(0, 0.5, 1, 2), 0, 1), (Leaf(1.0, 1.0, 1), Leaf(9.0, -9.0, 1)))
    svg = partition_svg(tree)
    frames = [each for each in ElementTree.fromstring(svg).iter(f"{SVG}rect") if each.attrib["fill"] == "none"]
    assert len(frames) == panels
    assert ("cuts through the middle" in svg) == (d > 2)
    assert ("(6 of 10 pairs)" in svg) == (d == 5)


def test_a_cut_shows_the_leaves_that_it_goes_through() -> None:
    features = tuple(Feature(f"x{k}", "m", 0.0, 1.0) for k in range(3))
    tree = Tree("any", features, (Split(2, 0.5, 1, 2), 0, 1), (Leaf(1.0, 1.0, 1), Leaf(9.0, -9.0, 1)))
    titles = [rectangle[0].text or "" for rectangle in rectangles(partition_svg(tree))]
    # x0 x1 goes through the leaf of x2 = 0.5, which is the right one; the other two cuts show both leaves
    assert [title.split(":")[0] for title in titles] == ["leaf 1", "leaf 0", "leaf 1", "leaf 0", "leaf 1"]


def test_ticks_are_round_and_inside() -> None:
    assert ticks_between(0.0, 3.2) == (0.0, 1.0, 2.0, 3.0)
    assert multiples(45.0, -180.0, 180.0) == tuple(45.0 * k for k in range(-4, 5))
    assert ticks_between(0.0, 0.96) == pytest.approx((0.0, 0.2, 0.4, 0.6, 0.8))


def test_a_curve_goes_through_its_points_beside_its_level() -> None:
    svg = curve_svg("Learning", [(1.0, 0.0), (2.0, 1.0), (3.0, 0.5)], "trial", "value", ("best", 1.0))
    parsed = ElementTree.fromstring(svg)
    places = [place.split(",") for place in parsed.findall(f"{SVG}polyline")[0].attrib["points"].split()]
    assert [float(x) for x, _ in places] == [64.0, 344.0, 624.0]
    dashed = next(line for line in parsed.iter(f"{SVG}line") if "stroke-dasharray" in line.attrib)
    assert float(dashed.attrib["y1"]) == float(dashed.attrib["y2"]) == float(places[1][1])


def test_a_curve_of_doublings_gives_each_the_same_width() -> None:
    svg = curve_svg("Sizes", [(1.0, 3.0), (4.0, 2.0), (16.0, 2.5)], "leaves", "error", doubling=True)
    places = re.findall(r'points="([^"]*)"', svg)[0].split()
    assert [float(place.split(",")[0]) for place in places] == [64.0, 344.0, 624.0]
    texts = [each.text for each in ElementTree.fromstring(svg).iter(f"{SVG}text")]
    assert texts[1:6] == ["1", "2", "4", "8", "16"]


@pytest.mark.parametrize("points", [[], [(1.0, 2.0)], [(1.0, inf), (2.0, 1.0)], [(1.0, 0.0), (2.0, 0.0)]])
def test_a_curve_without_two_different_points_is_a_picture_too(points: list[tuple[float, float]]) -> None:
    assert ElementTree.fromstring(curve_svg("", points, "x", "y", ("level", 0.0))).tag == f"{SVG}svg"
    assert ElementTree.fromstring(curve_svg("", points, "x", "y")).tag == f"{SVG}svg"


def test_a_long_curve_is_thinned_and_keeps_its_ends() -> None:
    svg = curve_svg("", [(float(k), float(k)) for k in range(50_000)], "trial", "value")
    places = re.findall(r'points="([^"]*)"', svg)[0].split()
    assert 1000 <= len(places) <= 1001
    assert (places[0].split(",")[0], places[-1].split(",")[0]) == ("64", "624")


def texts_of(svg: str) -> list[tuple[str, float, float]]:
    """Each text with its place; that along the y axis has none of its own."""
    return [
        (each.text or "", float(each.attrib["x"]), float(each.attrib["y"]))
        for each in ElementTree.fromstring(svg).iter(f"{SVG}text")
    ]


def size_of(svg: str) -> tuple[float, float]:
    root = ElementTree.fromstring(svg)
    assert root.attrib["viewBox"] == f"0 0 {root.attrib['width']} {root.attrib['height']}"
    return float(root.attrib["width"]), float(root.attrib["height"])


def test_a_question_of_a_graph_has_the_unit_of_its_feature() -> None:
    features = (*FEATURES, Feature("count", "", 0.0, 9.0))
    nodes = (Split(0, 1.25, 1, 2), Split(1, pi / 6, 3, 4), Split(2, 2.5, 5, 6), 0, 1, 2, 3)
    dot = to_dot(Tree("ball_seeking", features, nodes, tuple(Leaf(1.0, 2.0, 7) for _ in range(4))))
    assert re.findall(r"n\d+ \[label=\"(.*\?)\"\];", dot) == [
        "ball_distance < 1.25 m?",
        "ball_bearing < 30 degrees?",
        "count < 2.5?",
    ]


def test_a_curve_fills_its_frame_but_for_a_margin_of_8_percent_and_fits_into_the_picture() -> None:
    svg = curve_svg("Learning", [(0.0, 2.0), (5.0, 4.0), (10.0, 3.0)], "trial", "value", ("best", 4.5))
    [points] = re.findall(r'points="([^"]*)"', svg)
    places = np.array([place.split(",") for place in points.split()], float)
    # 2.0 .. 4.5 and 0.2 at each end are the 240 pixels from 34 to 274
    assert places == pytest.approx(np.array([(64.0, 257.45), (344.0, 91.93), (624.0, 174.69)]), abs=0.02)
    assert size_of(svg) == (64.0 + 560.0 + 120.0, 34.0 + 240.0 + 48.0)
    assert texts_of(svg)[0] == ("Learning", 64.0, 20.0)
    assert texts_of(svg)[-1][:2] == ("best", 632.0)
    assert texts_of(svg)[-1][2] == pytest.approx(50.55 + 4.0, abs=0.02)


def test_a_level_alone_and_a_flat_curve_have_a_margin_of_their_own() -> None:
    alone = curve_svg("", [], "x", "y", ("level", 2.0))
    [y] = [float(y) for y in re.findall(r'y1="([^"]*)"[^>]*dasharray', alone)]
    assert y == pytest.approx(154.0), "in the middle"
    flat = curve_svg("", [(1.0, 0.0), (2.0, 0.0)], "x", "y")
    assert 'points="64,154 624,154"' in flat


def test_the_parts_of_a_partition_fit_into_its_picture() -> None:
    tree = load_tree(shipped_trees() / "ball_seeking.json")
    svg = partition_svg(tree)
    motions = [motion.value for motion in Motion if motion in {rule.motion for rule in rules(tree)}]
    legend = [(*each,) for each in texts_of(svg) if each[1] == 578.0]
    assert legend == [(word, 578.0, 42.0 + 24.0 * row + 13.0) for row, word in enumerate(motions)]
    assert ("paler: slower", 554.0, 42.0 + 24.0 * len(motions) + 13.0) in texts_of(svg)
    assert size_of(svg) == (64.0 + 470.0 + 20.0 + 200.0, 400.0 + 34.0 + 48.0)
    assert texts_of(svg)[0][1:] == (64.0, 20.0)


def test_a_picture_of_a_strip_has_room_for_its_legend() -> None:
    features = (Feature("x", "m", 0.0, 2.0),)
    nodes = (Split(0, 0.5, 1, 2), 0, Split(0, 1.0, 3, 4), 1, Split(0, 1.5, 5, 6), 2, Split(0, 1.75, 7, 8), 3, 4)
    wheels = ((50.0, 50.0), (-50.0, -50.0), (50.0, -50.0), (-50.0, 50.0), (0.0, 0.0))
    tree = Tree("any", features, nodes, tuple(Leaf(left, right, 1) for left, right in wheels))
    svg = partition_svg(tree, np.array([[0.5], [3.0]]))
    boxes = [[float(r.attrib[key]) for key in ("x", "y", "width", "height")] for r in rectangles(svg)]
    assert boxes[:2] == [[64.0, 34.0, 117.5, 60.0], [181.5, 34.0, 117.5, 60.0]]
    assert boxes[-1] == [475.25, 34.0, 58.75, 60.0]
    assert "M181.5 64.0h0M534.0 64.0h0" in svg
    motions = len({rule.motion for rule in rules(tree)})
    assert motions == 5
    last = texts_of(svg)[-1]
    assert last == ("paler: slower", 554.0, 42.0 + 24.0 * motions + 13.0)
    assert size_of(svg)[1] == 34.0 + 24.0 * (motions + 1) > last[2], "a strip alone is 142 high"


def test_cuts_stand_below_each_other() -> None:
    features = tuple(Feature(f"x{k}", "m", 0.0, 1.0) for k in range(3))
    tree = Tree("any", features, (Split(0, 0.5, 1, 2), 0, 1), (Leaf(1.0, 1.0, 1), Leaf(9.0, -9.0, 1)))
    svg = partition_svg(tree)
    frames = [each for each in ElementTree.fromstring(svg).iter(f"{SVG}rect") if each.attrib["fill"] == "none"]
    assert [float(each.attrib["y"]) for each in frames] == [34.0, 34.0 + 482.0, 34.0 + 2 * 482.0]
    assert size_of(svg) == (754.0, 3 * 482.0)


def test_angles_are_shown_in_degrees_with_ticks_at_45_where_there_is_room() -> None:
    wide = Feature("ball_bearing", "rad", -pi, pi)
    narrow = Feature("tilt", "rad", -pi / 6, pi / 6)
    tree = Tree("any", (wide, narrow), (Split(0, 0.0, 1, 2), 0, 1), (Leaf(1.0, 1.0, 1), Leaf(9.0, -9.0, 1)))
    words = [word for word, *_ in texts_of(partition_svg(tree))]
    assert words[1:10] == ["-180", "-135", "-90", "-45", "0", "45", "90", "135", "180"]
    assert words[10:17] == ["-30", "-20", "-10", "0", "10", "20", "30"]
    assert words[17:19] == ["ball bearing [degrees]", "tilt [degrees]"]
