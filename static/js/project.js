// What the page knows of the open project: resources as the server has them, refreshed when it says that they changed.

import { ApiError, get, post, put } from "./api.js";
import { listen } from "./events.js";

// Which resources to ask for again when something changed.
const RESULTS = ["plan", "alignment", "assessment"];
const CONCERNS = {
  part: ["part", "surface", "setup", "keypoints", ...RESULTS],
  setup: ["setup", "calibrations", ...RESULTS],
  surface: ["surface", ...RESULTS],
  keypoints: ["keypoints", ...RESULTS],
  plan: ["keypoints", ...RESULTS],
  scan: ["scans", ...RESULTS],
  alignment: ["alignment"],
  assessment: ["assessment"],
  project: ["project"],
  record: ["record"],
  calibration: ["calibrations"],
};
const PATHS = { project: "", part: "/part", setup: "/setup", surface: "/surface", keypoints: "/keypoints", plan: "/plan", scans: "/scans", alignment: "/alignments", assessment: "/assessments", record: "/record", calibrations: "/calibrations", state: "/state" };
const OPEN = new Set(["queued", "running"]);
const NEWEST = new Set(["alignment", "assessment"]);
// An answer that takes longer than this is given up; what did not come is asked for again so much later at first.
const SOON_MS = 60_000;
const AGAIN_MS = 1_500;
const ALL = ["project", "part", "setup", "surface", "keypoints", "plan", "scans", "alignment", "assessment", "record", "calibrations"];

export class Project {
  constructor(id, changed) {
    this.id = id;
    this.changed = changed;
    this.path = `/projects/${id}`;
    this.data = { jobs: new Map(), insight: null, people: { clients: 0, names: [] }, viewIssues: [] };
    this.online = true;
    this.pending = new Set();
    this.missed = new Map();
    this.undoSetups = [];
    this.stop = listen(`${this.path}/events`, ["changed", "job", "insight", "people", "view", "view-error", "resync"], (name, data) => this.hear(name, data), (up) => this.link(up));
  }

  close() { this.closed = true; this.stop(); clearTimeout(this.timer); }

  link(up) {
    if (this.online === up) return;
    this.online = up;
    if (up) this.load(ALL);
    this.changed("link");
  }

  hear(name, data) {
    if (name === "job") {
      const before = this.data.jobs.get(data.id);
      this.data.jobs.set(data.id, data);
      this.changed("jobs");
      const over = !OPEN.has(data.state);
      // Whoever started it: a job that failed or was cancelled changes where the project stands, too.
      if (over && before?.state !== data.state) this.load(data.state === "done" ? ALL : []);
      for (const waiter of this.waiters?.get(data.id) ?? []) if (over) waiter(data);
    } else if (name === "insight" || name === "people") {
      this.data[name] = data;
      this.changed(name);
    } else if (name === "view-error") {
      this.data.viewIssues = [{ ...data, at: Date.now() }, ...this.data.viewIssues.filter((i) => i.code !== data.code)].slice(0, 4);
      this.changed("issues");
    } else if (name === "view") {
      this.changed("view");
    } else {
      if (data.what === "deleted") this.deleted = true;
      if (!CONCERNS[data.what]) this.meetJobs();
      this.load(CONCERNS[data.what] ?? ALL);
    }
  }

  // A stream that begins again tells nothing of what ended meanwhile: ask which jobs run and what became of the known ones.
  async meetJobs() {
    let rows;
    try { rows = await get(`${this.path}/jobs?limit=20`); } catch { return; }
    for (const row of rows) {
      const known = this.data.jobs.get(row.id);
      // An answer that was under way while an event came is the older one, unless it says that the job is over.
      if (OPEN.has(row.state) ? !known : known && OPEN.has(known.state)) this.hear("job", row);
    }
  }

  /** Ask for resources again, soon and once. */
  load(names) {
    for (const name of names) this.pending.add(name);
    clearTimeout(this.timer);
    return new Promise((resolve) => {
      this.loaded = [...(this.loaded ?? []), resolve];
      this.timer = setTimeout(() => this.fetchInTurn(), 30);
    });
  }

  // One after the other: an older answer that comes late must not cover a newer one.
  fetchInTurn() {
    this.turn = (this.turn ?? Promise.resolve()).then(() => this.fetchPending());
    return this.turn;
  }

  async fetchPending() {
    const names = new Set([...this.pending, "state"]);
    const done = this.loaded ?? [];
    this.pending.clear();
    this.loaded = [];
    // The state says first what there is, so that nothing is asked for that does not exist.
    await this.fetchOne("state");
    names.delete("state");
    await Promise.all([...names].map((name) => (this.exists(name) ? this.fetchOne(name) : (this.data[name] = null))));
    this.changed("data");
    for (const resolve of done) resolve();
  }

  exists(name) {
    const { state } = this.data;
    if (name === "part") return (state?.versions?.part ?? 0) > 0;
    if (name === "plan") return state?.programs?.alignment?.error?.code !== "plan-missing";
    return true;
  }

  async fetchOne(name) {
    try {
      const answer = await get(`${this.path}${PATHS[name]}`, SOON_MS);
      // Of results the newest counts.
      this.missed.delete(name);
      this.data[name] = NEWEST.has(name) ? (answer.at(-1) ?? null) : answer;
      if (NEWEST.has(name)) this.data[`${name}s`] = answer;
    } catch (error) {
      if (error instanceof ApiError && [404, 409].includes(error.status)) this.data[name] = null;
      if (["project", "state"].includes(name) && error.status === 404) this.deleted = true;
      if (!(error instanceof ApiError) || error.status === 0 || error.status >= 500) this.askAgain(name);
    }
  }

  // What did not come is asked for again, as no later event may tell of it; less and less often, as every answer redraws the
  // page. Without a link all is asked for when it is back.
  askAgain(name) {
    const times = (this.missed.get(name) ?? 0) + 1;
    this.missed.set(name, times);
    setTimeout(() => { if (this.online && !this.closed) this.load([name]); }, Math.min(AGAIN_MS * 2 ** (times - 1), SOON_MS));
  }

  /** Start a job and wait for its end; resolves with the job, rejects with an ApiError. */
  async run(path, body) {
    const job = await post(`${this.path}${path}`, body);
    if (job.state === "done") { await this.load(ALL); return job; }
    this.data.jobs.set(job.id, job);
    this.changed("jobs");
    const over = await this.over(job.id);
    if (over.state === "failed") {
      // The event says that it failed; why is in the job itself.
      const { issues } = await get(`/jobs/${job.id}`);
      await this.load([]);
      throw new ApiError(422, issues);
    }
    if (over.state === "done") await this.load(ALL);
    return over;
  }

  /** Wait until a job is over; asks now and then, in case an event was lost with the link. */
  over(id) {
    this.waiters ??= new Map();
    return new Promise((resolve) => {
      const finish = (job) => { clearInterval(poll); this.waiters.delete(id); this.data.jobs.set(id, job); this.changed("jobs"); resolve(job); };
      this.waiters.set(id, [finish]);
      const poll = setInterval(async () => {
        try {
          const job = await get(`/jobs/${id}`);
          if (!OPEN.has(job.state)) finish(job);
        } catch (error) {
          if (error.status === 404) finish({ id, state: "failed", issues: error.issues });
        }
      }, 2000);
    });
  }

  /** Save the setup; the one before can be brought back. */
  async saveSetup(next) {
    const before = this.data.setup;
    this.data.setup = await put(`${this.path}/setup`, next);
    if (before) this.undoSetups.push(before);
    this.changed("data");
  }

  async undoSetup() {
    const before = this.undoSetups.pop();
    if (!before) return;
    this.data.setup = await put(`${this.path}/setup`, before);
    this.changed("data");
  }
}
