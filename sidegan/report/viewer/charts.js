// Curves over one period with a cursor that all charts share; dragging on a chart moves it.
const LEFT = 44, RIGHT = 6, TOP = 5, BELOW = 5;

class Chart {
  constructor(parent, title, unit, low, seek) {
    const box = element("div", "chart", parent), heading = element("h3", "", box);
    heading.textContent = `${title} `;
    element("span", "", heading).textContent = unit;
    this.plot = element("div", low ? "plot low" : "plot", box);
    this.canvas = element("canvas", "", this.plot);
    this.cursor = element("i", "", this.plot);
    const drag = (event) => {
      if (event.type === "pointerdown") this.plot.setPointerCapture(event.pointerId);
      if (!event.buttons) return;
      const { left, width } = this.plot.getBoundingClientRect();
      seek(Math.min(Math.max((event.clientX - left - LEFT) / (width - LEFT - RIGHT), 0), 1));
    };
    this.plot.addEventListener("pointerdown", drag);
    this.plot.addEventListener("pointermove", drag);
    new ResizeObserver(() => this.draw()).observe(this.plot);
  }

  at(part) {
    this.cursor.style.left = `calc(${LEFT}px + ${part} * (100% - ${LEFT + RIGHT}px))`;
  }

  // The curves of a trajectory: values, a colour, and whether it is faint, for each; marks are labelled horizontal lines.
  show(lines, low, high, marks) {
    Object.assign(this, { lines, low, high, marks });
    this.draw();
  }

  draw() {
    if (!this.lines) return;
    const ratio = window.devicePixelRatio || 1, width = this.plot.clientWidth, height = this.plot.clientHeight;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const pen = this.canvas.getContext("2d"), style = getComputedStyle(document.documentElement);
    pen.scale(ratio, ratio);
    const y = (value) => TOP + (this.high - value) / (this.high - this.low) * (height - TOP - BELOW);
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const { value, text, limit } of this.marks) {
      pen.strokeStyle = style.getPropertyValue(limit ? "--limit" : "--line");
      pen.fillStyle = style.getPropertyValue("--soft");
      pen.setLineDash(limit ? [5, 4] : []);
      pen.lineWidth = 1;
      pen.beginPath();
      pen.moveTo(LEFT, y(value));
      pen.lineTo(width - RIGHT, y(value));
      pen.stroke();
      pen.fillText(text, LEFT - 5, y(value));
    }
    pen.setLineDash([]);
    pen.lineJoin = "round";
    for (const { values, colour, faint } of this.lines) {
      pen.strokeStyle = colour || style.getPropertyValue("--accent");
      pen.globalAlpha = faint ? 0.13 : 1;
      pen.lineWidth = 1.5;
      pen.beginPath();
      values.forEach((value, k) => {
        const x = LEFT + k / (values.length - 1) * (width - LEFT - RIGHT);
        if (k) pen.lineTo(x, y(value)); else pen.moveTo(x, y(value));
      });
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }
}

function element(tag, name, parent) {
  const made = document.createElement(tag);
  if (name) made.className = name;
  parent.append(made);
  return made;
}
