// Rows of curves over one time axis, with a cursor that the player moves and that moves the player.

const ROW = 62, AXIS = 22, LEFT = 104, RIGHT = 84;

class Curves {
  /** `seek(time)` is called where the user points at a time. */
  constructor(box, seek) {
    this.box = box;
    [this.paper, this.glass] = box.querySelectorAll('canvas');
    this.rows = [];
    this.bands = [];
    this.end = 1;
    const move = e => {
      const x = e.clientX - this.glass.getBoundingClientRect().left;
      const share = (x - LEFT) / Math.max(1, this.width - LEFT - RIGHT);
      seek(Math.max(0, Math.min(1, share)) * this.end);
    };
    this.glass.addEventListener('pointerdown', e => {
      this.glass.setPointerCapture(e.pointerId);
      move(e);
    });
    this.glass.addEventListener('pointermove', e => { if (e.buttons) move(e); });
    new ResizeObserver(() => this.draw()).observe(box);
  }

  /** A row: name, unit, lines of {times, values, colour, dash}, limits or null. */
  show(rows, bands, end) {
    Object.assign(this, { rows, bands, end: end || 1 });
    this.box.style.height = `${rows.length * ROW + AXIS}px`;
    this.draw();
  }

  pen(canvas) {
    const ratio = window.devicePixelRatio || 1;
    this.width = this.box.clientWidth;
    canvas.width = Math.max(1, this.width * ratio);
    canvas.height = Math.max(1, this.box.clientHeight * ratio);
    const pen = canvas.getContext('2d');
    pen.scale(ratio, ratio);
    pen.font = '11px system-ui, sans-serif';
    pen.textBaseline = 'middle';
    return pen;
  }

  x(time) { return LEFT + time / this.end * (this.width - LEFT - RIGHT); }

  draw() {
    if (!this.box.clientWidth) return;
    const pen = this.pen(this.paper), style = getComputedStyle(document.documentElement);
    const ink = name => style.getPropertyValue(name).trim();
    const bottom = this.rows.length * ROW;
    pen.fillStyle = ink('--band');
    for (const [from, to] of this.bands) {
      pen.fillRect(this.x(from), 0, Math.max(0.5, this.x(to) - this.x(from)), bottom);
    }
    this.rows.forEach((row, i) => this.row(pen, ink, row, i * ROW));
    pen.fillStyle = ink('--faint');
    pen.textAlign = 'center';
    const most = Math.max(2, Math.floor((this.width - LEFT - RIGHT) / 70));
    const step = tidy(this.end / most);
    for (let t = 0; t <= this.end * 1.0001; t += step) {
      pen.fillText(`${+t.toFixed(6)}`, this.x(t), bottom + 10);
    }
    pen.textAlign = 'left';
    pen.fillText('time [s]', 0, bottom + 10);
    this.cursor(this.now ?? 0);
  }

  row(pen, ink, row, top) {
    let low = Infinity, high = -Infinity;
    for (const { values } of row.lines) {
      for (const v of values) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    }
    if (low > high) [low, high] = [0, 1];
    if (row.zero) low = Math.min(low, 0);
    if (high - low < 1e-6) { low -= 0.5; high += 0.5; }
    const room = 0.08 * (high - low), grounded = row.zero && low === 0, floor = top + ROW - 5, tall = ROW - 12;
    [low, high] = [grounded ? 0 : low - room, high + room];
    const y = v => floor - (v - low) / (high - low) * tall;
    pen.strokeStyle = ink('--rule');
    pen.lineWidth = 1;
    pen.strokeRect(LEFT, top + 7, this.width - LEFT - RIGHT, tall);
    pen.fillStyle = ink('--ink');
    pen.textAlign = 'left';
    row.name.split('\n').forEach((line, k) => pen.fillText(line, 0, top + 22 + 14 * k, LEFT - 36));
    pen.fillStyle = ink('--faint');
    pen.textAlign = 'right';
    pen.fillText(short(high), LEFT - 5, top + 13);
    pen.fillText(short(low), LEFT - 5, floor - 5);
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, top + 7, this.width - LEFT - RIGHT, tall);
    pen.clip();
    pen.strokeStyle = ink('--limit');
    pen.setLineDash([5, 4]);
    for (const limit of row.limits ?? []) {
      pen.beginPath();
      pen.moveTo(LEFT, y(limit));
      pen.lineTo(this.width, y(limit));
      pen.stroke();
    }
    for (const { times, values, colour, dash } of row.lines) {
      pen.strokeStyle = ink(colour);
      pen.lineWidth = 1.3;
      pen.setLineDash(dash ?? []);
      pen.beginPath();
      let on = false;
      for (let k = 0; k < times.length; k++) {
        if (!Number.isFinite(values[k])) { on = false; continue; }
        if (on) pen.lineTo(this.x(times[k]), y(values[k]));
        else pen.moveTo(this.x(times[k]), y(values[k]));
        on = true;
      }
      pen.stroke();
    }
    pen.restore();
  }

  cursor(time) {
    this.now = time;
    if (!this.box.clientWidth) return;
    const pen = this.pen(this.glass), style = getComputedStyle(document.documentElement);
    pen.strokeStyle = style.getPropertyValue('--accent');
    pen.beginPath();
    pen.moveTo(this.x(time), 0);
    pen.lineTo(this.x(time), this.rows.length * ROW);
    pen.stroke();
    pen.textAlign = 'left';
    this.rows.forEach((row, i) => {
      const lines = row.lines.filter(l => time >= l.times[0] - 1e-6 && time <= l.times.at(-1) + 1e-6);
      lines.slice(-2).forEach((line, k) => {
        const value = valueAt(line, time);
        pen.fillStyle = style.getPropertyValue(line.colour);
        const text = Number.isFinite(value) ? `${value >= row.most - 1e-3 ? '≥ ' : ''}${value.toFixed(row.digits ?? 3)} ${row.unit}` : '–';
        pen.fillText(text, this.width - RIGHT + 6, i * ROW + 24 + 15 * k);
      });
    });
  }
}

/** The index of the last of ascending times that is not after `time`. */
function before(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = low + high + 1 >> 1;
    if (times[middle] <= time) low = middle; else high = middle - 1;
  }
  return low;
}

function valueAt({ times, values }, time) {
  const k = before(times, time), next = Math.min(k + 1, times.length - 1);
  const span = times[next] - times[k];
  const share = span > 0 ? Math.min(1, Math.max(0, (time - times[k]) / span)) : 0;
  return values[k] + share * (values[next] - values[k]);
}

/** The least of 1, 2, 5 × 10ⁿ that is not below. */
function tidy(step) {
  const ten = 10 ** Math.floor(Math.log10(step || 1));
  return [1, 2, 5, 10].map(k => k * ten).find(k => k >= step * 0.999);
}

function short(value) {
  return Math.abs(value) >= 100 ? value.toFixed(0) : Math.abs(value) >= 10 ? value.toFixed(1) : value.toFixed(2);
}
