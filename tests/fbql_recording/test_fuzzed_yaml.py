"""Whatever a YAML file holds: it is read as another reader reads it, or refused in one line."""

from __future__ import annotations

import math
from typing import Any

import yaml
from fbql_recording.bag_agreement import told_by
from fbql_recording.bag_metadata import profiles_from_text, to_yaml
from fbql_recording.plain_yaml import from_yaml
from fuzzing import dice, odd_bytes, odd_copy, read_or_refused
from places import ROOT

RECORDED = ROOT / "tests" / "data" / "recorded_match"
TEXTS = [(RECORDED / name).read_bytes() for name in ("metadata.yaml", "config.yaml")]
SYNTAX = b"&a *a << !!bool !!int ? : - [ ] { } , # | > ' \" % @ ` --- ... ~ 0x1 1e5 .nan\t\n  "


def same(ours: Any, theirs: Any) -> bool:
    if isinstance(ours, dict):
        return isinstance(theirs, dict) and ours.keys() == theirs.keys() and all(same(ours[k], theirs[k]) for k in ours)
    if isinstance(ours, list):
        return isinstance(theirs, list) and len(ours) == len(theirs) and all(map(same, ours, theirs))
    if isinstance(ours, float) and math.isnan(ours):
        return isinstance(theirs, float) and math.isnan(theirs)
    return type(ours) is type(theirs) and ours == theirs


def test_a_mutated_text_is_read_or_refused_in_one_line():
    for rng in dice(400):
        text = odd_bytes(rng.choice(TEXTS), rng, SYNTAX)
        read_or_refused(lambda text=text: from_yaml(text, "x"))


def test_a_mutated_value_reads_back_as_it_was_or_is_refused():
    values = [yaml.safe_load(text) for text in TEXTS]
    for rng in dice(60):
        value = odd_copy(rng.choice(values), rng)
        try:
            text = to_yaml(value)
        except RecursionError:
            continue  # the writer does not go as deep
        found = read_or_refused(lambda text=text: [from_yaml(text, "x")])
        assert found is None or same(found[0], value)


def test_whatever_metadata_says_is_told_or_named_as_odd():
    information = yaml.safe_load(TEXTS[0])["rosbag2_bagfile_information"]
    for rng in dice(300):
        odd = odd_copy(information, rng)
        if isinstance(odd, dict):
            told = told_by(odd)
            assert all(isinstance(each, str) for each in told.odd)


def test_whatever_a_quality_of_service_says_is_a_list_of_profiles():
    profiles = yaml.safe_load(TEXTS[0])["rosbag2_bagfile_information"]["topics_with_message_count"][0]
    text = to_yaml(profiles["topic_metadata"]["offered_qos_profiles"]).encode()
    for rng in dice(200):
        found = profiles_from_text(odd_bytes(text, rng, SYNTAX).decode(errors="replace"))
        assert isinstance(found, list)
