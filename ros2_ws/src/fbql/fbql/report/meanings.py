"""What the controllers do, and what the features of our behaviors mean, for a reader who knows the paper alone."""

from __future__ import annotations

CONTROLLERS = {
    "subsumption": "One behavior drives alone: the first of the layers that is triggered.",
    "uniform": "All behaviors drive together: the command is the mean of their references.",
    "fbql_literal": "All behaviors drive together: the command is the sum of their references, each times its weight. The "
    "weights belong to the joint state (the leaves of all behaviors) and change by the paper's equations 5 and 6.",
    "fbql": "One behavior drives alone for some steps (fbql_hold_steps); it is chosen by learned weights, which depend on "
    'the joint state (the leaves of all behaviors) and on what is sensed. "weight" is the choice: 1 for who drives. It '
    "learns no Q.",
    "fbql_value": "One behavior drives alone for some steps (fbql_value_hold_steps); it is chosen by weights that follow Q, the "
    "learned value of each behavior, which depends on the joint state (the leaves of all behaviors) and on what is sensed. "
    '"weight" is the choice: 1 for who drives.',
}
"""By the name that a decision carries."""

FEATURES = {
    "ball_distance": "how far the ball is away",
    "ball_bearing": "on which side of the robot the ball is; 0 is straight ahead",
    "wall_distance": "how far the closest point of the walls is away",
    "wall_bearing": "on which side of the robot that point is",
    "detour_heading_error": "on which side of the robot the way round the ball is (in the rules: the detour): straight at the "
    "ball when that pushes it at the goal, else past it on the side that leads behind it",
    "approach_angle": "how far the line from the ball to the goal (in the rules: the ball-to-goal line) turns from the line "
    "from the robot to the ball; 0 means that driving at the ball pushes it at the goal",
}
"""By the name that a tree carries."""
