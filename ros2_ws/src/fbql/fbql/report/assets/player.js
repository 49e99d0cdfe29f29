// Which step is shown, and how time passes.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8, 16, 32].map((speed) => [speed, `${speed}×`]);
const LONGEST_GAP_S = 1;
const REDUCED_MS = 250;
const JUMPS = [
  ["goal", "● goal", "g", (i) => flag("goal", i)],
  ["own_goal", "✕ own goal", "o", (i) => flag("own_goal", i)],
  ["collision", "▼ collision", "c", (i) => flag("collision_begun", i)],
  ["episode", "episode", "e", null],
];

class Player {
  /** changed(): another step is to be shown, or it plays or does not. */
  constructor(changed) {
    this.changed = changed;
    this.step = 0;
    this.speeds = SPEEDS;
    this.speed = 1;
    this.playing = false;
    this.clock = playingTimes();
    this.reduced = matchMedia("(prefers-reduced-motion: reduce)");
    this.targets = Object.fromEntries(JUMPS.map(([name, , , found]) => [name, found === null ? [] : stepsWhere(found)]));
    this.targets.episode = run.episodes.map((episode) => episode.first);
  }

  /** What the button does that plays and pauses: its sign and its word. */
  get does() {
    return this.playing ? ["❚❚", "Pause"] : ["▶", "Play"];
  }

  get episode() {
    return run.episodes[this.targets.episode.findLastIndex((first) => first <= this.step)];
  }

  seek(step) {
    this.step = Math.min(run.steps - 1, Math.max(0, step));
    this.played = this.clock[this.step];
    this.changed();
  }

  /** The next step of a kind (direction 1) or the one before (-1); undefined where there is none. */
  target(name, direction) {
    const steps = this.targets[name];
    return direction > 0 ? steps.find((step) => step > this.step) : steps.findLast((step) => step < this.step);
  }

  jump(name, direction) {
    const target = this.target(name, direction);
    if (target !== undefined) this.seek(target);
  }

  toSecond(second) {
    const nearest = { step: this.step, away: Infinity };
    for (let i = 0; i < run.steps; i++) {
      const away = Math.abs((value("time_s", i) ?? Infinity) - second);
      if (away < nearest.away) Object.assign(nearest, { step: i, away });
    }
    this.seek(nearest.step);
  }

  faster(by) {
    const place = this.speeds.findIndex(([speed]) => speed === this.speed) + by;
    this.setSpeed(this.speeds[Math.min(this.speeds.length - 1, Math.max(0, place))][0]);
  }

  setSpeed(speed) {
    this.speed = speed;
    this.changed();
  }

  toggle() {
    this.playing = !this.playing;
    if (this.playing && this.step === run.steps - 1) this.seek(0);
    this.played = this.clock[this.step];
    this.last = undefined;
    this.changed();
    if (this.playing) requestAnimationFrame((now) => this.tick(now));
  }

  tick(now) {
    if (!this.playing) return;
    this.last ??= now;
    if (!this.reduced.matches || now - this.last >= REDUCED_MS) {
      this.played += ((now - this.last) / 1000) * this.speed;
      this.last = now;
      let step = this.step;
      while (step < run.steps - 1 && this.clock[step + 1] <= this.played) step++;
      if (step === run.steps - 1) this.playing = false;
      if (step !== this.step || !this.playing) {
        this.step = step;
        this.changed();
      }
    }
    requestAnimationFrame((next) => this.tick(next));
  }
}

/** When each step is played [s]: as recorded, but for gaps, which are shortened. */
function playingTimes() {
  const times = new Float64Array(run.steps);
  for (let i = 1; i < run.steps; i++) {
    const gap = value("time_s", i) - value("time_s", i - 1);
    times[i] = times[i - 1] + Math.min(LONGEST_GAP_S, Math.max(0, gap || 0));
  }
  return times;
}

function stepsWhere(found, begin = 0) {
  const steps = [];
  for (let i = begin; i < run.steps; i++) if (found(i)) steps.push(i);
  return steps;
}
