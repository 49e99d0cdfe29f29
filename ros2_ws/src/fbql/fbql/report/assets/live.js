// Starts the page of a match that is being played: its steps come over a connection, which also sets the match's pace.

const TIMELINES_MS = 1000; // drawing them takes as long as many pictures of the field

/** Shows the newest step as it comes. Whoever goes back looks around there, until sent back; at the end it is a Player. */
class LivePlayer extends Player {
  constructor(changed, send) {
    super(changed);
    this.send = send;
    this.live = true;
    this.following = true;
    this.speeds = run.rates.map((rate) => [rate, rate ? `${rate}×` : "as fast as possible"]);
    this.step = run.steps - 1;
  }

  /** What sets the match's pace; null where it keeps its own time. */
  set pace(pace) {
    this.paced = pace;
    if (this.live) this.speed = pace ? pace.rate : 1;
  }

  get playing() {
    return this.live ? this.following && !this.paced?.paused : this.plays;
  }

  set playing(plays) {
    this.plays = plays;
  }

  get does() {
    return this.live && !this.following ? ["▶", "Live"] : super.does;
  }

  toggle() {
    if (!this.live) return super.toggle();
    if (!this.following) return this.seek(run.steps - 1);
    if (this.paced) return this.send("pause");
    this.following = false;
    this.changed();
  }

  seek(step) {
    if (this.live && this.following && this.paced && step >= run.steps) return this.send("step");
    super.seek(step);
    this.following = this.step === run.steps - 1;
  }

  target(name, direction) {
    const known = super.target(name, direction);
    const more = this.live && this.paced && name === "episode" && direction > 0;
    return known === undefined && more ? Infinity : known;
  }

  jump(name, direction) {
    if (this.target(name, direction) === Infinity) this.send("next");
    else super.jump(name, direction);
  }

  setSpeed(speed) {
    if (!this.live) return super.setSpeed(speed);
    const place = (rate) => this.speeds.findIndex(([each]) => each === rate);
    const by = place(speed) - place(this.speed);
    if (this.paced) for (let i = 0; i < Math.abs(by); i++) this.send(by > 0 ? "faster" : "slower");
  }

  /** Steps have come. */
  grow(begin) {
    for (const [name, , , found] of JUMPS) if (found !== null) this.targets[name].push(...stepsWhere(found, begin));
    this.targets.episode = run.episodes.map((episode) => episode.first);
    if (this.live && this.following) this.step = run.steps - 1;
  }

  /** The oldest steps were forgotten. */
  shrink(count) {
    for (const [name, , , found] of JUMPS) if (found !== null) this.targets[name] = stepsWhere(found);
    this.targets.episode = run.episodes.map((episode) => episode.first);
    this.step = Math.max(0, this.step - count);
  }

  /** No step will come any more: from now on it plays what there is. */
  end() {
    this.live = this.playing = false;
    this.speeds = SPEEDS;
    this.speed = 1;
    this.clock = playingTimes();
    fillSpeeds(this);
    this.seek(this.step);
  }
}

/** What comes over the connection, one message after the other. */
class Live {
  constructor() {
    this.forgotten = 0; // steps of the match that are older than the first one here
    this.room = 4096;
    this.player = null;
    this.renewed = -Infinity;
    this.changed = Infinity; // the episode from which on the timelines are not what they were
    byId("loading").textContent = "Waiting for the first step ...";
    this.socket = new WebSocket(`ws://${location.host}/live`);
    this.rest = Promise.resolve();
    this.socket.addEventListener("message", (event) => this.then(() => this.take(JSON.parse(event.data))));
    this.socket.addEventListener("close", () => this.then(() => this.end()));
  }

  then(work) {
    this.rest = this.rest.then(work).catch((error) => {
      this.socket.close();
      trouble(`The steps can't be shown: ${error.message}. Load the page again.`);
      throw error;
    });
  }

  async take({ begin, blocks = [], episodes = [], tiles, pace, ...words }) {
    Object.assign(run, words);
    if (begin !== undefined) this.forgotten = begin;
    this.makeRoom(blocks.reduce((sum, [rows]) => sum + rows, 0));
    const before = run.steps;
    for (const [rows, packing, text] of blocks) {
      await readBlock(text, rows, packing, run.steps, this.room);
      run.steps += rows;
    }
    this.takeEpisodes(episodes);
    if (tiles !== undefined) this.showTiles(tiles);
    if (this.player === null && run.steps > 0) this.renew = main((changed) => (this.player = new LivePlayer(changed, (words) => this.socket.send(words))));
    else if (run.steps > before) this.player.grow(before);
    if (pace !== undefined) this.pace = pace;
    if (this.player !== null) this.show();
  }

  /** The episode that was the last one may have become longer; others may have begun. */
  takeEpisodes(episodes) {
    for (const episode of episodes) {
      episode.first -= this.forgotten;
      if (episode.first < 0) [episode.first, episode.count] = [0, episode.count + episode.first];
      const last = run.episodes.at(-1);
      if (last !== undefined && last.first >= episode.first) Object.assign(last, episode);
      else run.episodes.push(episode);
      this.changed = Math.min(this.changed, run.episodes.length - 1);
    }
    run.episodes.forEach((episode, k) => (episode.running = k === run.episodes.length - 1 && episode.outcome === null));
  }

  show() {
    this.player.pace = this.pace ?? null;
    byId("speed").disabled = !this.pace;
    this.tell(this.pace ? `Live: ${this.pace.words}.` : run.steps ? "Live, at the match's own pace." : "Live.");
    if (performance.now() - this.renewed > TIMELINES_MS) {
      this.renewed = performance.now();
      this.renew(this.changed);
      this.changed = Infinity;
    }
    this.player.changed();
  }

  end() {
    for (const episode of run.episodes) episode.running = false;
    this.tell("The match has ended, or its command was stopped. Everything so far can be browsed as long as this page is open.");
    if (this.player === null) return;
    this.player.end();
    byId("speed").disabled = false;
    this.renew(0);
  }

  tell(words) {
    if (byId("live").textContent !== words) byId("live").textContent = words;
  }

  showTiles(tiles) {
    document.querySelectorAll(".tiles li").forEach((tile, k) => {
      tile.querySelector("b").textContent = tiles[k][0];
      tile.querySelector("small").textContent = tiles[k][1];
    });
  }

  makeRoom(rows) {
    if (run.steps + rows > run.kept) this.forget(Math.min(run.kept / 2, run.steps));
    if (run.steps + rows <= this.room) return;
    while (run.steps + rows > this.room) this.room *= 2;
    for (const [name, { whole, unit }] of columns) {
      const column = emptyColumn(unit, this.room);
      column.whole.set(whole);
      columns.set(name, column);
    }
  }

  /** Forgets the oldest steps. */
  forget(count) {
    run.episodes = run.episodes.filter((episode) => episode.first + episode.count > count);
    for (const episode of run.episodes) {
      episode.first -= count;
      if (episode.first < 0) [episode.first, episode.count] = [0, episode.count + episode.first];
    }
    for (const [name, { whole, unit }] of columns) {
      const column = emptyColumn(unit, this.room);
      column.whole.set(whole.subarray(count, run.steps));
      columns.set(name, column);
    }
    run.steps -= count;
    this.forgotten += count;
    this.changed = 0;
    this.player?.shrink(count);
  }
}

if (canUnpack()) new Live();
