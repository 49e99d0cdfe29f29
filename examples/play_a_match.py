"""Play a match from Python and look at it as arrays. No ROS needed: `python examples/play_a_match.py`."""

# %% Three episodes of Subsumption, every step kept.
import fbql
import numpy as np

result = fbql.play(controller="subsumption", episodes=3, seed=31, steps=True)
summary, episodes, steps = result.summary, result.episodes, result.steps
print(f"{summary['goals']} goals in {summary['episodes']} episodes, digest {summary['digest'][:8]}")

# %% One row per episode: arrays of the same length.
for index, outcome, count in zip(episodes["index"], episodes["outcome"], episodes["steps"], strict=True):
    print(f"episode {index}: {outcome} after {count} steps")

# %% One row per step. Distances are in metres, angles in rad, wheel velocities in rad/s.
to_ball_m = np.hypot(steps["ball_x_m"] - steps["robot_x_m"], steps["ball_y_m"] - steps["robot_y_m"])
for index in episodes["index"]:
    here = steps["episode"] == index
    print(f"episode {index}: the ball was {to_ball_m[here].min():.2f} to {to_ball_m[here].max():.2f} m away")

# %% Which behavior drove: weights has the shape [steps, behaviors], and Subsumption gives one of them the whole weight.
share = steps["weights"].mean(axis=0)
print("share of the steps:", ", ".join(f"{each:.0%}" for each in share))

# %% Other parameters, by the names of docs/parameters.md. A value that can't be used is reported in one line.
slippery = fbql.play(controller="subsumption", episodes=3, seed=31, parameters={"ball_robot_friction": 0.1})
print(f"with less friction: {slippery.summary['steps']} steps instead of {summary['steps']}")
try:
    fbql.play(controller="subsumption", episodes=0)
except fbql.BadInput as error:
    print("refused:", error)
