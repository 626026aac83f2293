// The page: time runs, and everything follows it.
const SIGNALS = { position: "Position", velocity: "Velocity", acceleration: "Acceleration", torque: "Torque" };
const UNITS = { position: ["rad", "m"], velocity: ["rad/s", "m/s"], acceleration: ["rad/s²", "m/s²"], torque: ["N·m", "N"] };
const PERCENT = [{ value: 1, text: "100 %", limit: true }, { value: 0, text: "0" }, { value: -1, text: "−100 %", limit: true }];
const by = (name) => document.getElementById(name);
const said = (x, digits) => x.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "−");

class Viewer {
  constructor(data) {
    Object.assign(this, { data, trajectory: 0, time: 0, playing: false, hidden: new Set() });
    this.colours = data.joints.map((_, j) => data.colours[j % data.colours.length]);
    try {
      this.space = new Space(data, by("space"));
    } catch (error) {
      by("fault").hidden = false;
      by("fault").textContent = `This browser shows no 3D picture (${error.message}); the curves are there all the same.`;
    }
    this.legend();
    this.charts = {};
    if (data.arrays.distance)
      this.charts.distance = new Chart(by("charts"), "Closest pair", "distance [m]", true, (part) => this.seek(part));
    for (const [name, title] of Object.entries(SIGNALS))
      this.charts[name] = new Chart(by("charts"), title, this.unit(name), false, (part) => this.seek(part));
    this.table();
    this.controls();
    this.choose(0);
    this.space?.show("shapes", false);
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) this.play(true);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.curves());
    requestAnimationFrame((now) => this.tick(now));
  }

  unit(name) {
    const { limited } = this.data.signals[name];
    if (limited.every((x) => x)) return "share of its limit";
    return limited.some((x) => x) ? "share of its limit, or of its largest in this set" : "share of its largest in this set (no limit)";
  }

  legend() {
    this.data.joints.forEach((name, j) => {
      const button = element("button", "", by("legend"));
      button.type = "button";
      button.textContent = name;
      button.style.setProperty("--tone", this.colours[j]);
      button.setAttribute("aria-pressed", "true");
      button.addEventListener("click", () => {
        if (!this.hidden.delete(j)) this.hidden.add(j);
        button.setAttribute("aria-pressed", String(!this.hidden.has(j)));
        this.curves();
      });
    });
  }

  controls() {
    this.data.titles.forEach((title, k) => { element("option", "", by("which")).textContent = title; by("which").lastChild.value = k; });
    by("which").addEventListener("change", () => this.choose(Number(by("which").value)));
    by("before").addEventListener("click", () => this.step(-1));
    by("after").addEventListener("click", () => this.step(1));
    by("play").addEventListener("click", () => this.play(!this.playing));
    by("time").addEventListener("input", () => this.seek(Number(by("time").value)));
    by("reset").addEventListener("click", () => this.space?.reset());
    for (const what of ["shapes", "path"])
      by(what).addEventListener("change", () => this.space?.show(what, by(what).checked));
    addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    if (event.target.matches("input, select, button")) return;
    const part = this.time / this.data.period;
    const keys = {
      " ": () => this.play(!this.playing), ArrowRight: () => this.seek(Math.min(part + 0.01, 1)),
      ArrowLeft: () => this.seek(Math.max(part - 0.01, 0)), ArrowUp: () => this.step(-1), ArrowDown: () => this.step(1),
    };
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  }

  step(way) {
    const count = this.data.titles.length;
    this.choose((this.trajectory + way + count) % count);
  }

  choose(k) {
    this.trajectory = k;
    by("which").value = k;
    this.space?.trace(k);
    this.curves();
    this.update();
  }

  curves() {
    const { data, trajectory } = this, all = Array.from({ length: data.samples + 1 }, (_, k) => k);
    for (const name of Object.keys(SIGNALS)) {
      const lines = data.joints.map((_, j) => ({
        values: all.map((k) => share(data, name, trajectory, k, j)), colour: this.colours[j], faint: this.hidden.has(j),
      }));
      const most = Math.max(1.05, ...lines.flatMap((line) => line.values.map((x) => 1.03 * Math.abs(x))));
      const marks = data.signals[name].limited.some((x) => x) ? PERCENT : PERCENT.map((mark) => ({ ...mark, limit: false }));
      this.charts[name].show(lines, -most, most, marks);
    }
    if (this.charts.distance) {
      const values = all.map((k) => nearest(data, trajectory, k).distance);
      const least = Math.min(...values), most = Math.max(...values, 0.01);
      const marks = [{ value: 0, text: "0", limit: true }, { value: least, text: said(least, 3) }, { value: most, text: said(most, 3) }];
      const apart = marks.filter((mark, k) => k !== 1 || (least > 0.15 * most && least < 0.85 * most));
      this.charts.distance.show([{ values }], Math.min(0, least), 1.03 * most, apart);
    }
  }

  seek(part) {
    this.time = part * this.data.period;
    this.update();
  }

  play(playing) {
    this.playing = playing;
    by("play").textContent = playing ? "❚❚" : "▶";
    by("play").setAttribute("aria-label", playing ? "Pause" : "Play");
  }

  tick(now) {
    if (this.playing) {
      this.time += Math.min((now - (this.last ?? now)) / 1000, 0.1) * Number(by("speed").value);
      if (this.time >= this.data.period) {
        this.time %= this.data.period;
        if (by("onwards").checked) this.step(1);
      }
      this.update();
    }
    this.last = now;
    this.space?.draw();
    requestAnimationFrame((next) => this.tick(next));
  }

  update() {
    const { data, trajectory } = this, part = this.time / data.period, sample = part * data.samples;
    const found = nearest(data, trajectory, sample);
    this.space?.pose(positions(data, trajectory, sample));
    by("time").value = part;
    by("clock").textContent = `${said(this.time, 2)} / ${Number(data.period.toPrecision(6))} s`;
    const line = by("nearest");
    line.replaceChildren();
    if (found) {
      line.append(`closest: ${found.name}, `);
      element("b", "", line).textContent = `${said(found.distance, 3)} m`;
    }
    for (const chart of Object.values(this.charts)) chart.at(part);
    for (const { cell, share: small, name, joint } of this.cells) {
      const signal = data.signals[name], value = share(data, name, trajectory, sample, joint);
      cell.data = `${said(signal.scale[joint] * value + (name === "position" ? data.middle[joint] : 0), 3)} `;
      small.textContent = signal.limited[joint] ? `${said(100 * value, 0)} %` : "";
    }
  }

  table() {
    const { data } = this, head = element("tr", "", element("thead", "", by("now"))), body = element("tbody", "", by("now"));
    const kinds = new Set(data.prismatic.map(Number));
    element("th", "text", head).textContent = "joint";
    for (const [name, title] of Object.entries(SIGNALS))
      element("th", "", head).textContent = `${title} [${[...kinds].map((kind) => UNITS[name][kind]).join(" or ")}]`;
    this.cells = [];
    data.joints.forEach((joint, j) => {
      const row = element("tr", "", body), first = element("td", "text", row);
      element("i", "", first).style.background = this.colours[j];
      first.append(joint);
      for (const name of Object.keys(SIGNALS)) {
        const cell = element("td", "", row), text = document.createTextNode("");
        cell.append(text);
        this.cells.push({ cell: text, share: element("span", "share", cell), name, joint: j });
      }
    });
    by("notes").textContent = "Shares of positions are of half the range, from its middle.";
  }
}

readData().then((data) => { window.viewer = new Viewer(data); }, (error) => {
  by("fault").hidden = false;
  by("fault").textContent = `The data cannot be read (${error.message}): a newer browser is needed.`;
});
