// One step in words and numbers: who drove and why, each behavior's leaf, reference, weight and Q, and the rest.

const FACTS = [
  ["command", (i) => `${number(value("command_left_rad_s", i), 2)} left, ${number(value("command_right_rad_s", i), 2)} right [rad/s]`],
  ["that is", (i) => run.commands[place("command_words", i)] ?? "n/a"],
  ["joint state", (i) => jointState(i)],
  ["reward", (i) => brief(value("reward", i))],
  ["phase", (i) => run.phases[place("phase", i)] ?? "n/a"],
  ["controller", (i) => run.controllers[place("controller", i)] ?? "n/a"],
  ["robot at", (i) => `${number(value("robot_x_m", i), 4)}, ${number(value("robot_y_m", i), 4)} m`],
  ["robot heads", (i) => degrees(value("robot_yaw_rad", i))],
  ["robot drives", (i) => `${number(value("robot_speed_m_s", i), 3)} m/s, turns ${turning(value("robot_yaw_rate_rad_s", i))}`],
  ["ball at", (i) => `${number(value("ball_x_m", i), 4)}, ${number(value("ball_y_m", i), 4)} m`],
  ["ball rolls", (i) => `${number(speed(value("ball_vx_m_s", i), value("ball_vy_m_s", i)), 3)} m/s`],
  ["closest wall point", (i) => `${number(value("wall_x_m", i), 4)}, ${number(value("wall_y_m", i), 4)} m`],
  ["events", (i) => events(i)],
];

function jointState(step) {
  const leaves = run.behaviors.map((_, k) => value(`joint_state.${k}`, step));
  if (!leaves.length || leaves.every((leaf) => leaf === null)) return "n/a";
  return `(${leaves.map((leaf) => (leaf === null || leaf < 0 ? "n/a" : leaf)).join(", ")})`;
}

function degrees(rad) {
  return rad === null ? "n/a" : `${number((rad * 180) / Math.PI, 1)}°`;
}

function sideways(rad) {
  if (rad === null || !Number.isFinite(rad)) return number(rad, 1);
  return `${number(Math.abs((rad * 180) / Math.PI), 1)}° ${rad >= 0 ? "left" : "right"}`;
}

function turning(rad_s) {
  if (rad_s === null || !Number.isFinite(rad_s)) return number(rad_s, 2);
  return `${rad_s >= 0 ? "left" : "right"} at ${number(Math.abs(rad_s), 2)} rad/s`;
}

function speed(x, y) {
  return x === null || y === null ? null : Math.hypot(x, y);
}

function events(step) {
  if (!columns.has("goal") || !flag("has_world", step)) return "n/a";
  const found = [
    ["goal", "● goal"], ["own_goal", "✕ own goal"], ["truncated", "◆ timeout"],
    ["collision_begun", "▼ collision begins"], ["collision", "in contact with a wall"], ["begins_again", "the episode restarts"],
  ].filter(([name]) => flag(name, step)).map(([, words]) => words);
  if (flag("degraded", step)) found.push("degraded: an answer was missing");
  return found.join(", ") || "none";
}

/** The rule of the leaf that a behavior answered with, as [where, what]; null where its tree or leaf is not known. */
function rule(behavior, step) {
  const tree = run.trees[place(`tree.${behavior}`, step)];
  return tree?.leaves[place(`leaf_id.${behavior}`, step)] ?? null;
}

function ruleText(behavior, step) {
  const found = rule(behavior, step);
  if (found !== null) return `${found[0]} → ${found[1]}`;
  return place(`leaf_id.${behavior}`, step) === null ? "n/a: no answer was recorded" : "n/a: its tree is not in the recording";
}

function sensed(behavior, step) {
  const tree = run.trees[place(`tree.${behavior}`, step)];
  const parts = [];
  for (let k = 0; columns.has(`observation.${behavior}.${k}`); k++) {
    const [name, unit, direction] = tree?.features[k] ?? [`feature ${k}`, "", false];
    const observed = value(`observation.${behavior}.${k}`, step);
    const text = direction ? sideways(observed) : `${number(observed, 3)} ${unit}`.trim();
    parts.push(`${name.replaceAll("_", " ")} ${text}`);
  }
  return parts.join(", ") || "n/a";
}

/** What the words of a behavior's rules mean; nothing where its features are not ours. */
function meaning(behavior, step) {
  const features = run.trees[place(`tree.${behavior}`, step)]?.features ?? [];
  return features.filter(([, , , means]) => means).map(([name, , , means]) => `${name.replaceAll("_", " ")}: ${means}.`).join(" ");
}

/** How sure the learner was of its choice; nothing where it did not learn, or the guide chose. */
function choice(driver, step) {
  const learned = run.behaviors.map((_, k) => value(`learned_weights.${k}`, step));
  if (run.phases[place("phase", step)] === "guided" || learned.includes(null)) return "";
  const weights = learned.map((weight, k) => `${signOf(k)} ${number(100 * weight, 1)} %`).join(", ");
  const how = learned[driver] === Math.max(...learned) ? "with the largest of" : "drawn by";
  return `, ${how} the weights learned for this situation (${weights})`;
}

/** Why the command is what it is, in words. */
function why(step) {
  if (run.shown) return `The instructor demonstrates ${run.shown}. The command: ${run.commands[place("command_words", step)] ?? "n/a"}.`;
  if (!flag("has_decision", step)) return "The decision at this step is not in the recording.";
  const driver = place("driver", step);
  const motion = run.commands[place("command_words", step)] ?? "n/a";
  if (flag("terminated", step) || flag("truncated", step)) return `The episode ends here: ${events(step)}. The command: ${motion}.`;
  const guided = run.phases[place("phase", step)] === "guided" ? " (the guide's choice)" : "";
  if (driver !== null) {
    const found = rule(driver, step);
    const reason = found === null ? ruleText(driver, step) : `its rule there: ${found[0]} → ${found[1]}`;
    return `${signOf(driver)} ${run.behaviors[driver]} drives alone${guided}${choice(driver, step)}; ${reason}. So the command is: ${motion}.`;
  }
  const order = run.behaviors.map((_, k) => k).filter((k) => value(`weights.${k}`, step) > 0);
  if (!order.length) return `Nobody drives: no behavior has any weight. So the command is: ${motion}.`;
  order.sort((a, b) => value(`weights.${b}`, step) - value(`weights.${a}`, step));
  const parts = order.map((k) => {
    const share = `${number(100 * value(`weights.${k}`, step), 1)} %`;
    return `${signOf(k)} ${run.behaviors[k]} ${share} (${rule(k, step)?.[1] ?? "n/a"})`;
  });
  return `They drive together${guided}: ${parts.join(" + ")}. The weighted sum of their references: ${motion}.`;
}

class Moment {
  constructor() {
    this.when = document.getElementById("when");
    this.why = document.getElementById("why");
    this.cards = run.behaviors.map((name, k) => this.card(name, k));
    document.getElementById("behaviors").append(...this.cards.map((card) => card.whole));
    this.facts = FACTS.map(([name]) => {
      const shown = element("dd");
      document.getElementById("facts").append(element("div", {}, element("dt", { text: name }), shown));
      return shown;
    });
  }

  card(name, k) {
    const drives = element("span", { kind: "drives" });
    const [rule, observed, means] = [element("p", { kind: "rule" }), element("summary"), element("p")];
    const sensed = element("details", { kind: "sensed quiet", title: "What these words mean" }, observed, means);
    const [bar, share] = [element("i"), element("span")];
    const [reference, learned, q, leaf] = [element("b"), element("b"), element("b"), element("b")];
    const whole = element(
      "article", { kind: "behavior" },
      element("h3", {}, element("span", { text: signOf(k), kind: "sign", "aria-hidden": "true" }), element("span", { text: name }), drives),
      element("div", { kind: "meter" }, element("div", { "aria-hidden": "true" }, bar), share),
      rule, sensed,
      element("div", { kind: "numbers" },
        element("span", { text: "reference " }, reference), element("span", { text: "learned weight " }, learned),
        element("span", { text: "Q " }, q), element("span", { text: "leaf " }, leaf)),
    );
    return { whole, drives, rule, observed, means, bar, share, reference, learned, q, leaf };
  }

  /** The colours, which change with the system's scheme. */
  paint() {
    this.cards.forEach((card, k) => {
      card.whole.style.borderLeftColor = card.bar.style.backgroundColor = colourOf(k);
      card.whole.querySelector(".sign").style.color = colourOf(k);
    });
  }

  draw(step, episode) {
    const ended = episode.running ? "" : `, ended: ${OUTCOMES[episode.outcome] ?? "n/a"}`;
    this.when.textContent =
      `Second ${number(value("time_s", step), 3)} · episode ${episode.index} (${episode.phase ?? "n/a"}${ended}) · ` +
      `step ${brief(value("step", step))}${episode.running ? "" : ` of ${episode.steps}`}`;
    this.why.textContent = why(step);
    this.cards.forEach((card, k) => {
      const weight = value(`weights.${k}`, step);
      const leaf = place(`leaf_id.${k}`, step);
      const count = run.trees[place(`tree.${k}`, step)]?.leaves.length;
      card.drives.textContent = place("driver", step) === k ? "drives" : "";
      card.bar.style.width = `${100 * Math.min(1, Math.max(0, weight ?? 0))}%`;
      card.share.textContent = `weight ${number(weight, 4)}`;
      card.rule.textContent = ruleText(k, step) + (flag(`clamped.${k}`, step) ? " (outside of its tree: the nearest leaf)" : "");
      card.observed.textContent = `senses: ${sensed(k, step)}`;
      card.means.textContent = meaning(k, step) || "What these words mean is not in the recording.";
      const wheels = ["left", "right"].map((side) => number(value(`reference_${side}_rad_s.${k}`, step), 2));
      card.reference.textContent = `${wheels[0]} left, ${wheels[1]} right [rad/s]`;
      card.learned.textContent = number(value(`learned_weights.${k}`, step), 4);
      card.q.textContent = brief(value(`q.${k}`, step));
      card.leaf.textContent = leaf === null ? "n/a" : `${leaf}${count ? ` of ${count}` : ""}`;
    });
    FACTS.forEach(([, text], k) => (this.facts[k].textContent = text(step)));
  }
}
