// Canvases that are sharp on every screen, and the signs and patterns that stand beside each behavior's colour.

const SIGNS = ["●", "■", "▲", "◆", "★", "✚"];
const HATCHES = ["", "/", "·", "\\", "–", "+"];
let colours = {};

/** Takes the colours from the style sheet again: the system's scheme may have changed. */
function readColours() {
  const style = getComputedStyle(document.documentElement);
  const names = ["paper", "raised", "ink", "quiet", "line", "accent", "grass", "chalk", "wall", "ball", "robot", "good", "bad"];
  colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  colours.behaviors = SIGNS.map((_, k) => style.getPropertyValue(`--b${k}`).trim());
}

function colourOf(behavior) {
  return behavior === null ? colours.ink : colours.behaviors[behavior % SIGNS.length];
}

function signOf(behavior) {
  return behavior === null ? "◎" : SIGNS[behavior % SIGNS.length];
}

/** A context to draw on in CSS pixels, emptied, and its size. */
function surface(canvas, height) {
  const width = canvas.clientWidth;
  const ratio = window.devicePixelRatio || 1;
  const [across, down] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== across || canvas.height !== down) {
    canvas.width = across;
    canvas.height = down;
    canvas.style.height = `${height}px`;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "12px system-ui, sans-serif";
  return { pen, width, height };
}

/** A behavior's colour with its pattern in it, to fill with. */
function hatched(pen, behavior) {
  const tile = document.createElement("canvas");
  tile.width = tile.height = 8;
  const paint = tile.getContext("2d");
  paint.fillStyle = colourOf(behavior);
  paint.fillRect(0, 0, 8, 8);
  paint.strokeStyle = paint.fillStyle = colours.paper;
  paint.lineWidth = 1.4;
  paint.beginPath();
  for (const [x1, y1, x2, y2] of hatchLines(HATCHES[behavior % HATCHES.length])) {
    paint.moveTo(x1, y1);
    paint.lineTo(x2, y2);
  }
  paint.stroke();
  if (HATCHES[behavior % HATCHES.length] === "·") paint.fillRect(3, 3, 2.4, 2.4);
  return pen.createPattern(tile, "repeat");
}

function hatchLines(hatch) {
  if (hatch === "/") return [[-1, 9, 9, -1], [-5, 5, 5, -5], [3, 13, 13, 3]];
  if (hatch === "\\") return [[-1, -1, 9, 9], [-5, 3, 5, 13], [3, -5, 13, 5]];
  if (hatch === "–") return [[0, 4, 8, 4]];
  if (hatch === "+") return [[0, 4, 8, 4], [4, 0, 4, 8]];
  return [];
}

/** An element with a text, a class and children. Texts are never markup. */
function element(tag, { text, kind, ...attributes } = {}, ...children) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (kind) made.className = kind;
  for (const [name, setting] of Object.entries(attributes)) made.setAttribute(name, setting);
  made.append(...children);
  return made;
}
