// Puts everything together: controls, keys, the address of a moment (#step=N).

const KEYS = [
  [[" "], "Space", "play, pause", (player) => player.toggle()],
  [["ArrowLeft"], "←", "one step back", (player, fast) => player.seek(player.step - (fast ? 60 : 1))],
  [["ArrowRight"], "→", "one step forward; with Shift 60 steps", (player, fast) => player.seek(player.step + (fast ? 60 : 1))],
  [["Home"], "Home", "first step of the episode", (player) => player.seek(player.episode.first)],
  [["End"], "End", "last step of the episode", (player) => player.seek(player.episode.first + player.episode.count - 1)],
  ...JUMPS.map(([name, words, key]) => [
    [key, key.toUpperCase()], key, `next ${words.replace(/^\W /, "")}; with Shift the previous one`, (player, back) => player.jump(name, back ? -1 : 1),
  ]),
  [["-"], "−", "slower", (player) => player.faster(-1)],
  [["+", "="], "+", "faster", (player) => player.faster(1)],
];
const byId = (id) => document.getElementById(id);

/** Makes the page work, with the player that `makePlayer` makes; returns what draws it anew when steps have come. */
function main(makePlayer = (changed) => new Player(changed)) {
  const player = makePlayer(() => show());
  const [field, moment] = [new Field(byId("field")), new Moment()];
  const timelines = new Timelines((step) => player.seek(step));
  const rows = [...document.querySelectorAll("[data-episode]")];
  const jumpButtons = makeJumps(player);
  let shown = null;
  let waiting = false;

  /** Draws at the browser's next picture, once, however much has changed until then. */
  function show() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      draw();
    });
  }

  function draw() {
    const { step, episode } = player;
    field.draw(step, episode);
    moment.draw(step, episode);
    timelines.draw(step, episode);
    const scrub = byId("scrub");
    scrub.max = episode.count - 1;
    scrub.value = step - episode.first;
    scrub.setAttribute("aria-valuetext", `step ${scrub.value} of ${scrub.max}, episode ${episode.index}`);
    byId("scrub-words").textContent = `Episode ${episode.index}: step ${scrub.value} of ${scrub.max}`;
    byId("speed").value = player.speed;
    byId("play").textContent = player.does.join(" ");
    byId("play").setAttribute("aria-label", player.does[1]);
    if (document.activeElement !== byId("second")) byId("second").value = number(value("time_s", step), 2);
    for (const [button, name, direction, words] of jumpButtons) {
      button.disabled = player.target(name, direction) === undefined;
      words.textContent = jumpWords(player, name);
    }
    byId("why").setAttribute("aria-live", player.playing ? "off" : "polite");
    if (episode !== shown) rows.forEach((row) => mark(row, run.episodes[row.dataset.episode] === episode));
    shown = episode;
    if (!player.playing && !player.live) history.replaceState(null, "", `#step=${step}`);
  }

  makeControls(player);
  makeKeys(player);
  rows.forEach((row) => row.addEventListener("click", () => {
    player.seek(run.episodes[row.dataset.episode].first);
    byId("field").scrollIntoView({ block: "nearest" });
  }));
  const redraw = () => {
    readColours();
    moment.paint();
    timelines.stale = true;
    legend();
    show();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  addEventListener("resize", redraw);
  addEventListener("hashchange", () => player.seek(addressed(player.step)));
  byId("loading").remove();
  byId("player").removeAttribute("aria-busy");
  redraw();
  player.seek(addressed(player.step));
  draw();
  return (episode) => {
    timelines.renew(episode);
    show();
  };
}

/** The step in the page's address. */
function addressed(otherwise) {
  const found = /^#step=(\d{1,9})$/.exec(location.hash);
  return found ? Number(found[1]) : otherwise;
}

function mark(button, current) {
  const row = button.closest("tr");
  if (current) row.setAttribute("aria-current", "true");
  else row.removeAttribute("aria-current");
}

function legend() {
  const entries = run.behaviors.map((name, k) => [signOf(k), name, colourOf(k)]);
  entries.push(["━", "command, and the trail where no single behavior drives", colours.ink], ["◉", "ball (its trail dashed)", colours.ball], ["✕", "closest wall point", colours.bad]);
  byId("legend").replaceChildren(...entries.map(([sign, words, colour]) => {
    const shown = element("span", { text: sign, "aria-hidden": "true" });
    shown.style.color = colour;
    return element("span", {}, shown, ` ${words}`);
  }));
}

function makeControls(player) {
  fillSpeeds(player);
  byId("speed").addEventListener("change", (event) => player.setSpeed(Number(event.target.value)));
  byId("play").addEventListener("click", () => player.toggle());
  byId("back").addEventListener("click", () => player.seek(player.step - 1));
  byId("forth").addEventListener("click", () => player.seek(player.step + 1));
  byId("scrub").addEventListener("input", (event) => player.seek(player.episode.first + Number(event.target.value)));
  byId("second").addEventListener("change", (event) => {
    if (event.target.value !== "") player.toSecond(Number(event.target.value));
  });
}

function fillSpeeds(player) {
  byId("speed").replaceChildren(...player.speeds.map(([speed, text]) => element("option", { text, value: speed })));
}

function jumpWords(player, name) {
  const words = JUMPS.find(([each]) => each === name)[1];
  return `${words} (${name === "episode" || anywhere("has_world") ? player.targets[name].length : "n/a"})`;
}

function makeJumps(player) {
  const buttons = [];
  for (const [name, words, key] of JUMPS) {
    const plain = words.replace(/^\W /, "");
    const counted = element("b");
    const [before, after] = [-1, 1].map((direction) => {
      const label = `${direction < 0 ? "Previous" : "Next"} ${plain}`;
      const shortcut = direction < 0 ? `Shift+${key.toUpperCase()}` : key.toUpperCase();
      const button = element("button", {
        text: direction < 0 ? "◀" : "▶", type: "button", id: `${direction < 0 ? "previous" : "next"}-${name}`,
        "aria-label": label, "aria-keyshortcuts": shortcut, title: `${label} (${shortcut})`,
      });
      button.addEventListener("click", () => player.jump(name, direction));
      buttons.push([button, name, direction, counted]);
      return button;
    });
    byId("jumps").append(element("span", {}, before, counted, after));
  }
  return buttons;
}

function makeKeys(player) {
  byId("keys").append(...KEYS.map(([, name, words]) => element("div", {}, element("dt", {}, element("kbd", { text: name })), element("dd", { text: words }))));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const target = event.target;
    if (target.matches("input, select, textarea")) return;
    if (event.key === " " && target.matches("button, summary, a")) return;
    const found = KEYS.find(([keys]) => keys.includes(event.key));
    if (found === undefined) return;
    event.preventDefault();
    found[3](player, event.shiftKey);
  });
}

function trouble(words) {
  byId("trouble").textContent = words;
  byId("trouble").hidden = false;
  byId("player").hidden = true;
}

/** Whether this browser can unpack steps; if not, says which ones can. */
function canUnpack() {
  if (window.DecompressionStream && Array.prototype.findLast) return true;
  trouble("This browser is too old to unpack the steps; the page needs Chrome or Edge 103, Firefox 113, Safari 16.4, or newer. The tables below can be read.");
  return false;
}
