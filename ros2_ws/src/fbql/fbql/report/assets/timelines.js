// Timelines: of the steps of one episode, and of the episodes of the run.

const [LEFT, RIGHT] = [46, 8];
const OUTCOMES = { goal: "● goal", own_goal: "✕ own goal", timeout: "◆ timeout" };

class Strip {
  /** words(): of the caption; paint(strip): draws the content; moved(share): somebody points at a place. */
  constructor(parent, words, height, paint, moved) {
    this.height = height;
    this.words = words;
    this.paint = paint;
    this.canvas = element("canvas", { role: "img" });
    this.caption = element("figcaption");
    this.cursor = element("div", { kind: "cursor", hidden: "" });
    this.figure = element("figure", { kind: "strip" }, this.caption, this.canvas, this.cursor);
    parent.append(this.figure);
    const point = (event) => {
      const box = this.canvas.getBoundingClientRect();
      moved(Math.min(1, Math.max(0, (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT))));
    };
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      point(event);
    });
    this.canvas.addEventListener("pointermove", (event) => event.buttons && point(event));
  }

  draw() {
    this.caption.textContent = this.words();
    const { pen, width, height } = surface(this.canvas, this.height);
    Object.assign(this, { pen, width, inner: width - LEFT - RIGHT });
    this.top = 6;
    this.bottom = height - 6;
    pen.textBaseline = "middle";
    this.paint(this);
  }

  /** Says that nothing is known of what it would show. */
  missing() {
    this.pen.fillStyle = colours.quiet;
    this.pen.textAlign = "center";
    this.pen.fillText("n/a", this.x(0.5), (this.top + this.bottom) / 2);
    this.canvas.setAttribute("aria-label", `${this.caption.textContent}: n/a`);
  }

  x(share) {
    return LEFT + share * this.inner;
  }

  /** Numbers and lines of the vertical axis, low to high. */
  axis(low, high, ticks) {
    this.low = low;
    this.high = high;
    const pen = this.pen;
    pen.textAlign = "right";
    for (const tick of ticks) {
      pen.fillStyle = colours.line;
      pen.fillRect(LEFT, Math.round(this.y(tick)), this.inner, 1);
      pen.fillStyle = colours.quiet;
      pen.fillText(brief(tick, 3), LEFT - 6, this.y(tick));
    }
  }

  y(number) {
    return this.bottom - ((number - this.low) / (this.high - this.low)) * (this.bottom - this.top);
  }

  /** Marks a place, without drawing anything anew. */
  mark(share) {
    this.cursor.hidden = false;
    this.cursor.style.height = `${this.height}px`;
    this.cursor.style.left = `${this.x(share)}px`;
  }
}

/** A stack of shares, one a behavior, between two places. */
function stack(strip, from, to, shares, fills) {
  let below = 0;
  shares.forEach((share, k) => {
    strip.pen.fillStyle = fills[k];
    strip.pen.fillRect(Math.round(from), strip.y(below + share), Math.max(1, Math.round(to) - Math.round(from)), strip.y(below) - strip.y(below + share));
    below += share;
  });
}

class Timelines {
  /** seek(step): somebody wants to go there. */
  constructor(seek) {
    this.seek = seek;
    this.means = [];
    const inEpisode = document.getElementById("episode-strips");
    const inRun = document.getElementById("run-strips");
    const within = (share) => seek(this.episode.first + Math.round(share * (this.episode.count - 1)));
    const among = (share) => {
      const chosen = run.episodes[Math.min(run.episodes.length - 1, Math.floor(share * run.episodes.length))];
      seek(chosen.first);
    };
    const names = run.behaviors.map((name, k) => `${signOf(k)} ${name}`).join("  ");
    this.within = [
      new Strip(inEpisode, () => `${TITLES[this.told]} (stacked): ${names}`, 110, (strip) => this.weights(strip), within),
      new Strip(inEpisode, () => "Rewards, and ▼ collisions", 84, (strip) => this.rewards(strip), within),
      (this.ofQ = new Strip(inEpisode, () => "Q of each behavior", 84, (strip) => this.q(strip), within)),
    ];
    const bars = (name) => (strip) => this.bars(strip, name);
    this.among = [
      new Strip(inRun, () => `${TITLES[this.told]}, mean of each episode (stacked): ${names}`, 110, (strip) => this.meanWeights(strip), among),
      new Strip(inRun, () => "Reward: sum of each episode", 84, bars("return"), among),
      new Strip(inRun, () => "Steps of each episode: ● goal, ✕ own goal, ◆ timeout, – no end recorded", 110, (strip) => this.steps(strip), among),
      new Strip(inRun, () => "Collisions of each episode", 84, bars("collisions"), among),
    ];
  }

  draw(step, episode) {
    if (episode !== this.episode || this.stale) {
      this.episode = episode;
      if (told() !== this.told) this.means = [];
      this.told = told();
      this.ofQ.figure.hidden = !(columns.has("q.0") && columns.get("q.0").floats.some((q) => !Number.isNaN(q)));
      for (const strip of [...this.within, ...this.among]) if (!strip.figure.hidden) strip.draw();
      this.stale = false;
    }
    this.within.forEach((strip) => strip.mark(this.share(step)));
  }

  /** Steps have come, or were forgotten: the episodes from this one on are not what they were. */
  renew(episode) {
    this.means.length = Math.min(this.means.length, episode);
    this.stale = true;
  }

  share(step) {
    return this.episode.count > 1 ? (step - this.episode.first) / (this.episode.count - 1) : 0;
  }

  weights(strip) {
    if (!anywhere("has_decision")) return strip.missing();
    strip.axis(0, 1, [0, 0.5, 1]);
    const { first, count } = this.episode;
    const fills = run.behaviors.map((_, k) => hatched(strip.pen, k));
    const bins = Math.min(count, Math.floor(strip.inner));
    for (let bin = 0; bin < bins; bin++) {
      const [from, to] = [Math.floor((bin * count) / bins), Math.floor(((bin + 1) * count) / bins)];
      stack(strip, strip.x(bin / bins), strip.x((bin + 1) / bins), mean(this.told, first + from, first + to), fills);
    }
    strip.canvas.setAttribute("aria-label", `Weights over the ${count} steps of episode ${this.episode.index}`);
  }

  rewards(strip) {
    if (!anywhere("has_decision") && !anywhere("has_world")) return strip.missing();
    const { first, count } = this.episode;
    const found = [];
    const collisions = [];
    for (let i = first; i < first + count; i++) {
      const reward = value("reward", i);
      if (reward !== null && reward !== 0 && Number.isFinite(reward)) found.push([i, reward]);
      if (flag("collision_begun", i)) collisions.push(i);
    }
    const most = Math.max(1, ...found.map(([, reward]) => Math.abs(reward)));
    strip.axis(-most, most, [-most, 0, most]);
    for (const [i, reward] of found) {
      strip.pen.fillStyle = reward > 0 ? colours.good : colours.bad;
      const [top, bottom] = [strip.y(Math.max(0, reward)), strip.y(Math.min(0, reward))];
      strip.pen.fillRect(strip.x(this.share(i)) - 1.5, top, 3, Math.max(2, bottom - top));
    }
    strip.pen.textAlign = "center";
    strip.pen.fillStyle = colours.ink;
    for (const i of collisions) strip.pen.fillText("▼", strip.x(this.share(i)), strip.top + 4);
    const sum = found.reduce((total, [, reward]) => total + reward, 0);
    strip.canvas.setAttribute("aria-label", `${found.length} rewards, ${brief(sum)}; ${collisions.length} collisions`);
  }

  q(strip) {
    const { first, count } = this.episode;
    const all = [];
    const stride = Math.max(1, Math.floor(count / strip.inner));
    for (let i = first; i < first + count; i += stride) run.behaviors.forEach((_, k) => all.push(value(`q.${k}`, i) ?? 0));
    const [low, high] = [Math.min(0, ...all), Math.max(0, ...all)];
    strip.axis(low, high === low ? low + 1 : high, high === low ? [low] : [low, high]);
    run.behaviors.forEach((_, k) => {
      const pen = strip.pen;
      pen.beginPath();
      for (let i = first; i < first + count; i += stride) {
        const q = value(`q.${k}`, i);
        if (q !== null) pen.lineTo(strip.x(this.share(i)), strip.y(q));
      }
      pen.strokeStyle = colourOf(k);
      pen.setLineDash([[], [7, 3], [2, 3], [9, 3, 2, 3]][k % 4]);
      pen.lineWidth = 1.5;
      pen.stroke();
      pen.setLineDash([]);
      const last = value(`q.${k}`, first + count - 1);
      pen.fillStyle = colourOf(k);
      pen.textAlign = "right";
      if (last !== null) pen.fillText(signOf(k), strip.x(1) - 14 * k, Math.min(strip.bottom - 5, Math.max(strip.top + 5, strip.y(last))));
    });
    strip.canvas.setAttribute("aria-label", `Q from ${brief(low)} to ${brief(high)}`);
  }

  /** Draws something for each episode, and marks the one that is shown. */
  each(strip, paint) {
    const count = run.episodes.length;
    run.episodes.forEach((episode, k) => {
      const [from, to] = [strip.x(k / count), strip.x((k + 1) / count)];
      const gap = to - from > 6 ? 1 : 0;
      if (episode === this.episode) {
        strip.pen.fillStyle = colours.accent;
        strip.pen.globalAlpha = 0.25;
        strip.pen.fillRect(from, 0, Math.max(3, to - from), strip.height);
        strip.pen.globalAlpha = 1;
      }
      paint(episode, from + gap, to - gap, k);
    });
  }

  meanWeights(strip) {
    if (!anywhere("has_decision")) return strip.missing();
    strip.axis(0, 1, [0, 0.5, 1]);
    const fills = run.behaviors.map((_, k) => hatched(strip.pen, k));
    this.each(strip, (episode, from, to, k) => {
      this.means[k] ??= mean(this.told, episode.first, episode.first + episode.count);
      stack(strip, from, to, this.means[k], fills);
    });
    strip.canvas.setAttribute("aria-label", `Mean weights of ${run.episodes.length} episodes`);
  }

  bars(strip, name) {
    const numbers = run.episodes.map((episode) => episode[name]);
    const known = numbers.filter((each) => each !== null);
    if (!known.length) return strip.missing();
    const [low, high] = [Math.min(0, ...known), Math.max(0, ...known)];
    strip.axis(low, high === low ? 1 : high, [...new Set([low, 0, high])]);
    this.each(strip, (episode, from, to, k) => {
      if (numbers[k] === null) return;
      strip.pen.fillStyle = name !== "return" ? colours.quiet : numbers[k] < 0 ? colours.bad : colours.good;
      const [top, bottom] = [strip.y(Math.max(0, numbers[k])), strip.y(Math.min(0, numbers[k]))];
      strip.pen.fillRect(from, top, Math.max(1, to - from), bottom - top);
    });
    strip.canvas.setAttribute("aria-label", `${strip.caption.textContent}: from ${brief(low)} to ${brief(high)}`);
  }

  steps(strip) {
    const most = Math.max(1, ...run.episodes.map((episode) => episode.steps));
    strip.top = 18;
    strip.axis(0, most, [0, most]);
    strip.pen.textAlign = "center";
    this.each(strip, (episode, from, to) => {
      const outcome = episode.outcome;
      strip.pen.fillStyle = outcome === "goal" ? colours.good : outcome === "own_goal" ? colours.bad : colours.quiet;
      strip.pen.fillRect(from, strip.y(episode.steps), Math.max(1, to - from), strip.bottom - strip.y(episode.steps));
      if (to - from > 8 || outcome !== "goal") strip.pen.fillText((OUTCOMES[outcome] ?? "–")[0], (from + to) / 2, strip.y(episode.steps) - 8);
    });
    strip.canvas.setAttribute("aria-label", `Steps of ${run.episodes.length} episodes, at most ${most}`);
  }
}

const TITLES = { weights: "Weights", learned_weights: "Learned weights" };

/** The weights that tell why: those that were learned, where there are some; else those that made the command. */
function told() {
  const learned = columns.get("learned_weights.0");
  return learned !== undefined && learned.whole.some((weight) => weight !== NOT_AVAILABLE) ? "learned_weights" : "weights";
}

/** The means of a column of each behavior over some steps; 0 where nothing is known. */
function mean(name, from, to) {
  return run.behaviors.map((_, k) => {
    let [sum, known] = [0, 0];
    for (let i = from; i < to; i++) {
      const each = value(`${name}.${k}`, i);
      if (each === null || !Number.isFinite(each)) continue;
      sum += each;
      known++;
    }
    return known ? sum / known : 0;
  });
}
