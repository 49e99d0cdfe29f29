"""Draw one episode of a recorded run as an SVG: the trails of robot and ball, and who drove where.

python3 docs/make_picture.py RUN --episode 2 --out docs/images/episode.svg
"""

import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))  # noqa: PTH100, PTH120 - Python 2 gets as far as here
sys.path[:0] = [os.path.join(HERE, os.pardir, "scripts"), HERE]  # noqa: PTH118

from environment import enter  # noqa: E402

if __name__ == "__main__":
    enter("make_picture", module="fbql.pictures.episode")
