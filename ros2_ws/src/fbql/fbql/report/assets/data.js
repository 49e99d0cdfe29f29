// The recorded steps: blocks of columns, as fbql_recording.core.packing writes them.

const NOT_AVAILABLE = -(2 ** 31);
const TOO_LARGE = NOT_AVAILABLE + 1;
const run = JSON.parse(document.getElementById("data").textContent);
const columns = new Map(); // name -> {whole: Int32Array, unit, floats: the same bytes as Float32Array}

/** The number of a column in a step; null is "n/a", Infinity what was too large to pack. */
function value(name, step) {
  const column = columns.get(name);
  if (column === undefined) return null;
  if (column.unit === 0) {
    const number = column.floats[step];
    return Number.isNaN(number) ? null : number;
  }
  const whole = column.whole[step];
  return whole === NOT_AVAILABLE ? null : whole === TOO_LARGE ? Infinity : whole * column.unit;
}

/** Whether a column of yes and no says yes. */
function flag(name, step) {
  return value(name, step) === 1;
}

/** Whether a column says yes in any step. */
function anywhere(name) {
  return columns.has(name) && columns.get(name).whole.includes(1);
}

/** An index that is stored in a column, or null for -1 and "n/a". */
function place(name, step) {
  const number = value(name, step);
  return number === null || number < 0 ? null : number;
}

async function readColumns() {
  const scripts = [...document.querySelectorAll("script.block")];
  let begin = 0;
  for (const [index, [rows, packing]] of run.blocks.entries()) {
    await readBlock(scripts[index].textContent, rows, packing, begin, run.steps);
    scripts[index].remove();
    begin += rows;
  }
}

/** Puts a block of steps into the columns, from row `begin` on; new columns get so much room. */
async function readBlock(text, rows, packing, begin, room) {
  const planes = await inflated(bytesOf(text));
  const packings = run.packings[packing];
  if (planes.length !== 4 * rows * packings.length) throw new Error(`the block from step ${begin} on is damaged`);
  packings.forEach(([name, unit], k) => {
    if (!columns.has(name)) columns.set(name, emptyColumn(unit, room));
    restore(planes.subarray(4 * rows * k, 4 * rows * (k + 1)), columns.get(name).whole.subarray(begin, begin + rows));
  });
}

function emptyColumn(unit, room) {
  const whole = new Int32Array(room);
  const floats = new Float32Array(whole.buffer);
  if (unit === 0) floats.fill(NaN);
  else whole.fill(NOT_AVAILABLE);
  return { whole, unit, floats };
}

function bytesOf(base64) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(base64);
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** From differences, byte by byte, to numbers. */
function restore(planes, whole) {
  const n = whole.length;
  let sum = 0;
  for (let i = 0; i < n; i++) {
    const unsigned = planes[i] | (planes[n + i] << 8) | (planes[2 * n + i] << 16) | (planes[3 * n + i] << 24);
    sum = (sum + ((unsigned >>> 1) ^ -(unsigned & 1))) | 0;
    whole[i] = sum;
  }
}

// Numbers as texts

function number(number, digits) {
  if (number === null) return "n/a";
  if (!Number.isFinite(number)) return number > 0 ? "too large" : "−∞";
  const text = Math.abs(number).toFixed(digits);
  return number < 0 && Number(text) !== 0 ? `−${text}` : text;
}

/** So many digits at most, for what may be of any size. */
function brief(number, digits = 7) {
  if (number === null) return "n/a";
  return Number.isFinite(number) ? String(Number(number.toPrecision(digits))).replace("-", "−") : "too large";
}
