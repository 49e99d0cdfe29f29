"""A robot in rooms with a mux that learns which source to follow: all nodes in one process, over ROS.

    python examples/rooms/rooms.py play                                 by the priorities that the mux starts from
    python examples/rooms/rooms.py train --out my_mux                   learn: my_mux/policy.npz
    python examples/rooms/rooms.py play --policy my_mux/policy.npz --out learned
    python examples/rooms/rooms.py show learned                         a picture of the rooms, and a page

Run it after `source scripts/env.sh`.
"""

import argparse
import csv
import json
import os
import sys
from collections import deque
from itertools import groupby
from pathlib import Path

HERE = Path(__file__).resolve().parent
TRAINING_ROOM, TEST_ROOM = 0, 50_000
"""The first room to train in, and to play in."""
TREE = "tree"
"""The source that is a tree, on the topic tree_vel."""


def parser():
    """The command line."""
    from fbql.cli.parser import Help, Parser, output_path

    result = Parser(prog="rooms.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = result.add_subparsers(dest="command", required=True)
    kinds = (
        ("play", "drive by the priorities of mux.yaml, or by a policy", 9, TEST_ROOM, "irsim"),
        ("train", "learn, from the priorities on or from a policy", 2000, TRAINING_ROOM, "twin"),
    )
    for name, does, episodes, room, world in kinds:
        own = commands.add_parser(name, help=does, description=does, formatter_class=Help)
        own.add_argument("--episodes", type=int, default=episodes, help="rooms to drive through")
        own.add_argument("--first-room", type=int, default=room, help="seed of the first room")
        own.add_argument("--family", choices=["traps", "doors"], default="traps", help="family of rooms")
        own.add_argument("--world", choices=["irsim", "twin"], default=world, help="IR-SIM, or its faster twin")
        own.add_argument("--policy", type=Path, metavar="FILE", help="policy.npz of an earlier training")
        own.add_argument("--prior", type=float, default=3.0, help="how strongly the priorities are preferred at first")
        own.add_argument("--seed", type=int, default=0, help="seed of the mux")
        own.add_argument("--out", type=output_path, default=Path(f"rooms_{name}"), help="run directory, a new one")
    does = "draw a run: RUN/rooms.png and RUN/report.html"
    shown = commands.add_parser("show", help=does, description=does, formatter_class=Help)
    shown.add_argument("run", type=Path, metavar="RUN", help="run directory")
    shown.add_argument("--rooms", type=int, default=9, help="how many of its last rooms to draw")
    return result


def drive(options: argparse.Namespace) -> int:
    """Plays or trains. Returns the exit code."""
    from fbql.cli.exit_codes import DONE
    from fbql.cli.output import print_result
    from fbql.graph.domains import free_domain
    from fbql_behaviors.twist_behavior_node import TwistBehaviorNode
    from fbql_common.spin import spin
    from fbql_fusion.twist_mux_node import TwistMuxNode
    from fbql_studies.rooms.sources import SOURCES
    from fbql_studies.rooms.tree_source import SHIPPED

    sys.path.insert(0, str(HERE))
    from bridge import Bridge
    from source import SourceNode

    learns = options.command == "train"
    parameters = {
        "twist_mux": {
            "use_sim_time": True,
            "learn": learns or not options.policy,
            "controller": "fbql" if learns or options.policy else "priorities",
            "fbql_prior": options.prior,
            "seed": options.seed,
            "run_directory": str(options.out),
            "record": True,
        },
        "rooms": {name: getattr(options, name) for name in ("family", "first_room", "episodes", "world")}
        | {"trails": str(options.out / "trails.csv")},
        "twist_behavior": {"tree_file": str(SHIPPED), "rate_hz": 0.0, "use_sim_time": True},
    }
    if options.policy:
        parameters["twist_mux"]["policy"] = str(options.policy)
    words = ["--ros-args", "--disable-external-lib-logs", "--params-file", str(HERE / "mux.yaml")]
    words += ["--log-level", "warn", "--log-level", "rooms:=info"]
    words += ["-r", "cmd_vel_out:=cmd_vel", "-r", f"twist_behavior:cmd_vel:={TREE}_vel"]
    for node, values in parameters.items():
        for name, value in values.items():
            words += ["-p", f"{node}:{name}:={json.dumps(value)}"]  # which is YAML as well
    # What can be refused comes first, and last of that the mux, which makes the run directory.
    sources = [lambda name=name: SourceNode(name) for name in SOURCES]
    nodes = [lambda: Bridge((*SOURCES, TREE)), *sources, TwistMuxNode, TwistBehaviorNode]
    with free_domain() as domain_id:  # never the one that is set: a robot of the user's may listen there
        os.environ["ROS_DOMAIN_ID"] = str(domain_id)
        code = spin(nodes, ["rooms.py", *words])
    if code == DONE:
        print_result(f"run {options.out}")
    return code


def show(options: argparse.Namespace) -> int:
    """Draws the last rooms of a run, and writes its page."""
    from fbql.cli.output import print_result, warn
    from fbql.report.mux import write_mux_page
    from fbql_common.files import atomic_text
    from fbql_recording.run import open_run
    from fbql_studies.rooms.drawing import draw

    trails = trails_of(options.run / "trails.csv", options.rooms)
    run = open_run(options.run)
    picture, page = options.run / "rooms.png", options.run / "report.html"
    draw(trails, picture)
    with atomic_text(page) as file:
        write_mux_page(run, file, picture=picture.read_bytes())
    warn(run.warnings)
    print_result(f"picture {picture}\npage {page}")
    return 0


def trails_of(path: Path, count: int):
    """The last trails of a file that the bridge wrote. Raises BadInput."""
    from fbql_common.core.errors import BadInput
    from fbql_common.files import unreadable
    from fbql_studies.rooms.drawing import Trail
    from fbql_studies.rooms.maps import room_of

    if count < 1:
        raise BadInput(f"--rooms is {count}; it must be at least 1")
    last = deque(maxlen=count)
    try:
        with path.open() as file:
            for (family, seed), rows in groupby(csv.DictReader(file), key=lambda row: (row["family"], row["room"])):
                points = [(float(row["x_m"]), float(row["y_m"]), row["driver"]) for row in rows]
                last.append((family, int(seed), points))
        trails = [Trail(room_of(family, seed), points) for family, seed, points in last]
    except OSError as error:
        raise unreadable(path, error) from None
    except (KeyError, TypeError, ValueError):
        raise BadInput(f"{path}: not the trails of rooms") from None
    if not trails:
        raise BadInput(f"{path}: no room was driven through")
    return trails


def main() -> int:
    """Runs the command."""
    try:
        from fbql.cli.app import reporting
    except ModuleNotFoundError:
        print("rooms.py: the packages are not on Python's path: run `source scripts/env.sh` first", file=sys.stderr)
        return 2
    from fbql.cli.output import set_program

    set_program("rooms.py")
    options = parser().parse_args()
    return reporting(lambda: show(options) if options.command == "show" else drive(options))


if __name__ == "__main__":
    sys.exit(main())
