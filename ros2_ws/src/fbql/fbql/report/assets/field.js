// The field at one step: robot, trail, ball, wall point, and where each behavior would go from here.

const RECENT_STEPS = 240;
const TRAIL_STEPS = 5000;
const AHEAD_S = 0.25;
const MARGIN_M = 0.05;

class Field {
  constructor(canvas) {
    this.canvas = canvas;
  }

  draw(step, episode) {
    const { half_length_m, half_width_m, goal_depth_m } = run.field;
    const length = 2 * (half_length_m + goal_depth_m + MARGIN_M);
    const breadth = 2 * (half_width_m + MARGIN_M);
    const height = (this.canvas.clientWidth * breadth) / length;
    const { pen, width } = surface(this.canvas, height);
    this.pen = pen;
    this.scale = width / length;
    this.centre = [width / 2, height / 2];
    this.lines();
    this.trails(step, episode);
    this.labels();
    this.wallPoint(step);
    this.ball(step);
    this.ahead(step);
    this.robot(step);
    this.canvas.setAttribute("aria-label", this.inWords(step));
  }

  /** Pixels of a point of the field; y goes up there and down here. */
  at(x_m, y_m) {
    return [this.centre[0] + x_m * this.scale, this.centre[1] - y_m * this.scale];
  }

  path(points, colour, width, dashes = []) {
    const pen = this.pen;
    pen.beginPath();
    points.forEach((point, k) => (k ? pen.lineTo(...point) : pen.moveTo(...point)));
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.setLineDash(dashes);
    pen.lineJoin = pen.lineCap = "round";
    pen.stroke();
    pen.setLineDash([]);
  }

  lines() {
    const { half_length_m: x, half_width_m: y, half_goal_m: goal, goal_depth_m: depth, corner_m: corner } = run.field;
    const quarter = [[x - corner, y], [x, y - corner], [x, goal], [x + depth, goal]];
    const back = [...quarter].reverse();
    const outline = [
      ...quarter, ...back.map(([a, b]) => [a, -b]), ...quarter.map(([a, b]) => [-a, -b]), ...back.map(([a, b]) => [-a, b]), quarter[0],
    ].map(([a, b]) => this.at(a, b));
    const pen = this.pen;
    this.path([this.at(0, y), this.at(0, -y)], colours.chalk, 1.5);
    pen.beginPath();
    pen.arc(...this.at(0, 0), 0.25 * this.scale, 0, 2 * Math.PI);
    pen.stroke();
    for (const side of [1, -1]) this.path([this.at(side * x, goal), this.at(side * x, -goal)], colours.chalk, 1.5);
    this.path(outline, colours.wall, 3);
  }

  labels() {
    const { half_length_m: x, half_goal_m: goal } = run.field;
    const pen = this.pen;
    pen.fillStyle = colours.quiet;
    pen.strokeStyle = colours.grass;
    pen.lineWidth = 4;
    pen.font = `${Math.max(11, Math.min(14, 0.045 * this.scale))}px system-ui, sans-serif`;
    pen.textBaseline = "middle";
    for (const [side, words] of [[1, "goal to score in →"], [-1, "← own goal"]]) {
      pen.textAlign = side > 0 ? "right" : "left";
      const [px, py] = this.at(side * (x - 0.03), goal + 0.07);
      pen.strokeText(words, px, py);
      pen.fillText(words, px, py);
    }
    pen.textAlign = "center";
  }

  trails(step, episode) {
    const first = Math.max(episode.first, step - TRAIL_STEPS);
    const recent = Math.max(first, step - RECENT_STEPS);
    this.path(this.points("ball", first, step), colours.ball, 1.5, [2, 5]);
    this.pen.globalAlpha = 0.35;
    this.path(this.points("robot", first, recent), colours.robot, 1.5);
    this.pen.globalAlpha = 1;
    let begin = recent;
    for (let i = recent; i <= step; i++) {
      const driver = place("driver", i);
      if (i < step && place("driver", i + 1) === driver) continue;
      this.path(this.points("robot", begin, Math.min(i + 1, step)), colourOf(driver), 4);
      if (driver !== null && (i - begin > 4 || i === step)) this.sign(driver, Math.floor((begin + i) / 2));
      begin = i + 1;
    }
  }

  points(what, begin, end) {
    const points = [];
    for (let i = begin; i <= end; i++) {
      const [x, y] = [value(`${what}_x_m`, i), value(`${what}_y_m`, i)];
      if (Number.isFinite(x) && Number.isFinite(y) && x !== null && y !== null) points.push(this.at(x, y));
    }
    return points;
  }

  sign(behavior, step) {
    const [point] = this.points("robot", step, step);
    if (point === undefined) return;
    const pen = this.pen;
    pen.font = "13px system-ui, sans-serif";
    pen.lineWidth = 3;
    pen.strokeStyle = colours.grass;
    pen.strokeText(signOf(behavior), ...point);
    pen.fillStyle = colourOf(behavior);
    pen.fillText(signOf(behavior), ...point);
  }

  wallPoint(step) {
    const [robot] = this.points("robot", step, step);
    const [point] = this.points("wall", step, step);
    if (robot === undefined || point === undefined) return;
    this.path([robot, point], colours.quiet, 1, [4, 4]);
    const [x, y] = point;
    this.path([[x - 5, y - 5], [x + 5, y + 5]], colours.bad, 2.5);
    this.path([[x - 5, y + 5], [x + 5, y - 5]], colours.bad, 2.5);
  }

  ball(step) {
    const [point] = this.points("ball", step, step);
    if (point === undefined) return;
    const pen = this.pen;
    pen.beginPath();
    pen.arc(...point, Math.max(5, run.field.ball_radius_m * this.scale), 0, 2 * Math.PI);
    pen.fillStyle = colours.ball;
    pen.fill();
    pen.strokeStyle = colours.ink;
    pen.lineWidth = 1.5;
    pen.stroke();
  }

  robot(step) {
    const [point] = this.points("robot", step, step);
    const yaw = value("robot_yaw_rad", step);
    if (point === undefined || yaw === null) return;
    const pen = this.pen;
    const half = Math.max(7, (run.field.robot_side_m / 2) * this.scale);
    pen.save();
    pen.translate(...point);
    pen.rotate(-yaw);
    pen.fillStyle = colours.robot;
    pen.strokeStyle = flag("collision", step) ? colours.bad : colours.paper;
    pen.lineWidth = flag("collision", step) ? 4 : 1.5;
    pen.beginPath();
    pen.rect(-half, -half, 2 * half, 2 * half);
    pen.fill();
    pen.stroke();
    pen.fillStyle = colours.paper;
    pen.beginPath();
    pen.moveTo(half * 0.8, 0);
    pen.lineTo(-half * 0.2, -half * 0.6);
    pen.lineTo(-half * 0.2, half * 0.6);
    pen.fill();
    pen.restore();
  }

  /** Where the robot would be for the next quarter of a second with the wheels of each behavior, and of the command. */
  ahead(step) {
    run.behaviors.forEach((_, k) => {
      const wheels = ["left", "right"].map((side) => value(`reference_${side}_rad_s.${k}`, step));
      const points = this.arc(step, ...wheels);
      if (points === null) return;
      this.path(points, colourOf(k), 2, [3, 3]);
      this.pen.fillStyle = colourOf(k);
      this.pen.font = "14px system-ui, sans-serif";
      this.pen.fillText(signOf(k), ...points[points.length - 1]);
    });
    const points = this.arc(step, value("command_left_rad_s", step), value("command_right_rad_s", step));
    if (points === null) return;
    this.path(points, colours.ink, 3);
    const [[x0, y0], [x, y]] = points.slice(-2);
    const angle = Math.atan2(y - y0, x - x0);
    const wing = (turn) => [x - 9 * Math.cos(angle + turn), y - 9 * Math.sin(angle + turn)];
    this.path([wing(0.5), [x, y], wing(-0.5)], colours.ink, 3);
  }

  arc(step, left, right) {
    const [x, y, yaw] = ["robot_x_m", "robot_y_m", "robot_yaw_rad"].map((name) => value(name, step));
    if ([x, y, yaw, left, right].some((each) => each === null || !Number.isFinite(each))) return null;
    const { wheel_radius_m, axle_m } = run.field;
    const speed = ((left + right) / 2) * wheel_radius_m;
    const turn = ((right - left) * wheel_radius_m) / axle_m;
    const points = [];
    let [px, py] = [x, y];
    const parts = 16;
    for (let i = 0; i <= parts; i++) {
      points.push(this.at(px, py));
      const angle = yaw + (turn * AHEAD_S * (i + 0.5)) / parts;
      px += ((speed * AHEAD_S) / parts) * Math.cos(angle);
      py += ((speed * AHEAD_S) / parts) * Math.sin(angle);
    }
    return points;
  }

  inWords(step) {
    const where = (what) => `${number(value(`${what}_x_m`, step), 2)}, ${number(value(`${what}_y_m`, step), 2)} m`;
    return `The field: robot at ${where("robot")}, ball at ${where("ball")}, closest wall point at ${where("wall")}`;
  }
}
