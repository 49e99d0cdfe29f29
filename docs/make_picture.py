"""Draw episodes of a recorded run as an animated SVG: robot and ball, their trails, and who drove where.

python3 docs/make_picture.py RUN --episode 0 1 2 3 --out docs/images/match.svg
"""

import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))  # noqa: PTH100, PTH120 - Python 2 gets as far as here
sys.path[:0] = [os.path.join(HERE, os.pardir, "scripts"), HERE]  # noqa: PTH118

from environment import enter  # noqa: E402

if __name__ == "__main__":
    enter("make_picture", module="fbql.pictures.episode")
