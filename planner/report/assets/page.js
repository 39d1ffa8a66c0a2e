// The page: reads its data, moves the robot as the executor will move it, and links scene, slider,
// curves and list with each other.

const $ = id => document.getElementById(id);
const data = JSON.parse($('data').textContent);

function bytes(text) {
  const raw = atob(text), out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out.buffer;
}
const floats = text => new Float32Array(bytes(text));

// ---- motions: joints at a time, as the executor interpolates --------------------------------

const dof = data.joints.length;
function motionOf(raw) {
  return { ...raw, times: floats(raw.times), q: floats(raw.q), v: raw.v ? floats(raw.v) : null,
    contact: raw.contact ? new Uint8Array(bytes(raw.contact)) : null,
    series: raw.series.map(s => ({ ...s, times: floats(s.times), values: floats(s.values) })) };
}
const plans = data.plans.map(motionOf), measured = data.measured.map(motionOf);

/** Joints [rad] or [m] of a motion at its own time [s]: a straight line between two knots, or the
 *  cubic with the knots' velocities. */
function jointsAt(motion, time) {
  const { times, q, v } = motion, n = times.length, out = new Array(dof);
  const k = Math.min(before(times, time), Math.max(0, n - 2)), next = Math.min(k + 1, n - 1);
  const span = times[next] - times[k];
  const u = span > 0 ? Math.min(1, Math.max(0, (time - times[k]) / span)) : 0;
  for (let j = 0; j < dof; j++) {
    const a = q[k * dof + j], b = q[next * dof + j];
    if (v) {
      const va = v[k * dof + j] * span, vb = v[next * dof + j] * span;
      const c = 3 * (b - a) - 2 * va - vb, d = va + vb - 2 * (b - a);
      out[j] = a + u * (va + u * (c + u * d));
    } else {
      out[j] = a + u * (b - a);
    }
  }
  return out;
}

/** Velocity of each joint over time: steps of straight motions, else the knots' own. */
function velocities(motion, j) {
  const { times, q, v } = motion, t = [], values = [];
  for (let k = 0; k < times.length; k++) {
    if (v) {
      t.push(times[k]);
      values.push(v[k * dof + j]);
    } else if (k > 0 && times[k] > times[k - 1]) {
      const speed = (q[k * dof + j] - q[(k - 1) * dof + j]) / (times[k] - times[k - 1]);
      t.push(times[k - 1], times[k]);
      values.push(speed, speed);
    }
  }
  return { times: t, values };
}

/** The pose of each body in the root frame. */
function bodies(q) {
  const poses = [];
  for (const body of data.bodies) {
    const value = body.factor * q[body.joint] + body.offset;
    const motion = body.slides ? Mat.shift(Vec.scale(body.axis, value)) : Mat.turn(body.axis, value);
    const local = Mat.times(body.rest, motion);
    poses.push(body.parent === null ? local : Mat.times(poses[body.parent], local));
  }
  return poses;
}

/** The pad's centre in the root frame. [m] */
function padAt(q) {
  return data.pad ? Mat.apply(bodies(q)[data.pad.body], data.pad.centre) : null;
}

/** The farthest that the page's own kinematics are from the plan's, at the probes it was given. [m] */
function misfit() {
  let worst = 0;
  for (const motion of plans) {
    for (const { time, pad } of motion.probes) {
      worst = Math.max(worst, Math.hypot(...Vec.sub(padAt(jointsAt(motion, time)), pad)));
    }
  }
  return worst;
}

// ---- the clock -----------------------------------------------------------------------------

// A plan that another one takes over from is not gone to its end.
const end = Math.max(0, ...[...plans.slice(-1), ...measured].map(m => m.starts_at + (m.times.at(-1) ?? 0)));
const player = { time: 0, speed: 1, playing: false };

/** The plan that moves the arm at a time: the last one that has begun. */
function runningAt(time) {
  return plans.reduce((best, m, i) => (m.starts_at <= time + 1e-9 ? i : best), 0);
}

/** Times of the stops (or knots) of what runs, on the page's clock. */
function instants(stops) {
  const all = [];
  plans.forEach((motion, i) => {
    const until = plans[i + 1]?.starts_at ?? Infinity;
    const knots = stops ? motion.stops : motion.times.keys();
    for (const k of knots) {
      const t = motion.starts_at + motion.times[k];
      if (t <= until) all.push(t);
    }
  });
  return all;
}

function seek(time) {
  player.time = Math.max(0, Math.min(end, time));
  if (space) space.touch();
  refresh();
}

function step(stops, way) {
  const all = instants(stops), gap = 1e-5;
  const next = way > 0 ? all.find(t => t > player.time + gap) : all.findLast(t => t < player.time - gap);
  play(false);
  seek(next ?? (way > 0 ? end : 0));
}

function play(on) {
  if (on && player.time >= end) player.time = 0;
  player.playing = on;
  player.last = performance.now();
  if ($('play')) $('play').textContent = on ? '❚❚ Pause' : '▶ Play';
  if (on) wake();
}

// ---- the scene -----------------------------------------------------------------------------

let space = null, moving = [], ghost = [], paths = [];
const PAINT = { swept: '--swept', left: '--left', unseen: '--unseen', around: '--around' };
const NUMBERED = ['#e69f00', '#0072b2', '#009e73', '#cc79a7', '#d55e00', '#56b4e9', '#8a7a00'];
const LOOK = { robot: '--robot', pad: '--pad', guessed: '--guessed', obstacle: '--obstacle',
  ground: '--ground' };
const layers = [];

function paint(of) {
  if (typeof of === 'number') {
    const n = parseInt(NUMBERED[of % NUMBERED.length].slice(1), 16);
    return () => [(n >> 16 & 255) / 255, (n >> 8 & 255) / 255, (n & 255) / 255, 1];
  }
  return () => colourOf(PAINT[of]);
}

/** Things that a button shows and hides together. */
function layer(name, swatch, things, shown = true) {
  if (!things.length) return;
  for (const thing of things) thing.shown = shown;
  const button = document.createElement('button');
  button.innerHTML = '<i></i>';
  button.append(name);
  button.setAttribute('aria-pressed', shown);
  button.onclick = () => {
    const on = button.getAttribute('aria-pressed') !== 'true';
    button.setAttribute('aria-pressed', on);
    for (const thing of things) thing.shown = on;
    space.touch();
  };
  layers.push({ dot: button.firstChild, swatch });
  $('layers').append(button);
}

function swatches() {
  for (const { dot, swatch } of layers) {
    const [r, g, b] = swatch();
    dot.style.background = `rgb(${r * 255} ${g * 255} ${b * 255})`;
  }
}

function buildScene() {
  space = new Space($('space'));
  space.onstale = () => wake();
  const still = [Mat.identity()];
  const robot = [], guessed = [], around = [], ground = [];
  for (const shape of data.shapes) {
    const vertices = floats(shape.vertices), triangles = new Uint32Array(bytes(shape.triangles));
    const body = shape.body, name = LOOK[shape.look];
    const clear = { obstacle: 0.42, ground: 0.6 }[shape.look] ?? 1;
    const models = body === null ? () => still : () => [moving[body]];
    const thing = space.mesh(vertices, triangles, () => colourOf(name, clear), models);
    ({ obstacle: around, ground, guessed }[shape.look] ?? robot).push(thing);
    if (body !== null && measured.length) {
      const shade = space.mesh(vertices, triangles, () => colourOf('--measured', 0.4),
        () => (ghost.length ? [ghost[body]] : []));
      shade.ghost = true;
    }
  }
  const grain = 0.9 * Math.max(0.002, Math.min(0.02, data.spacing || 0.006));
  for (const cloud of data.clouds) {
    const thing = space.points(new Uint16Array(bytes(cloud.shares)), cloud.low, cloud.size,
      paint(cloud.paint));
    thing.grain = grain;
    layer(cloud.name, paint(cloud.paint), [thing], cloud.shown);
  }
  layer('robot', () => colourOf('--robot'), robot);
  layer('guessed shapes', () => colourOf('--guessed'), guessed);
  layer('measured arm', () => colourOf('--measured'), space.things.filter(t => t.ghost));
  layer('obstacles', () => colourOf('--obstacle'), around);
  layer('floor', () => colourOf('--ground'), ground);
  for (const set of data.lines) {
    const points = [];
    for (const line of set.lines.map(floats)) {
      for (let i = 3; i < line.length; i += 3) {
        points.push(...line.subarray(i - 3, i), -1, 0, ...line.subarray(i, i + 3), -1, 0);
      }
    }
    const thing = space.lines(new Float32Array(points), () => colourOf('--faint', 0.7),
      { wide: 1.4, lift: 0.0004 });
    layer(set.name, () => colourOf('--faint'), [thing], set.shown);
  }
  plans.forEach(buildPath);
  layer('tool path', () => colourOf('--accent'), paths.flatMap(p => p.things));
  const seen = measured.flatMap(m => tracks(m, () => -1));
  if (seen.length && data.pad) {
    layer('measured path', () => colourOf('--measured'),
      [space.lines(new Float32Array(seen.flatMap(s => s.data)), () => colourOf('--measured'),
        { wide: 1.8, lift: 0.0016, passes: true })]);
  }
  const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((way, i) => space.lines(
    new Float32Array([0, 0, 0.002, -1, 0, ...Vec.add(Vec.scale(way, 0.25), [0, 0, 0.002]), -1, 0]),
    () => [i === 0 ? 0.85 : 0.1, i === 1 ? 0.65 : 0.15, i === 2 ? 0.9 : 0.1, 1], { wide: 3 }));
  layer('base', () => colourOf('--accent'), axes);
  swatches();
}

/** Pieces of a motion's path by the pad's centre, close enough to show its curve. */
function tracks(motion, value) {
  if (!data.pad) return [];
  const out = [], at = t => padAt(jointsAt(motion, t));
  let last = null;
  for (let k = 0; k < motion.times.length; k++) {
    const t1 = motion.times[k], t0 = k ? motion.times[k - 1] : t1;
    const point = at(t1);
    if (last) {
      const parts = Math.min(24, Math.max(1, Math.ceil(Math.hypot(...Vec.sub(point, last.point)) / 0.02)));
      for (let s = 1; s <= parts; s++) {
        const t = s === parts ? t1 : t0 + (t1 - t0) * s / parts;
        const p = s === parts ? point : at(t);
        const v = value(motion, t);
        out.push({ contact: !motion.contact || motion.contact[k] === 1,
          data: [...last.point, last.value, last.time + motion.starts_at, ...p, v, t + motion.starts_at] });
        last = { point: p, value: v, time: t };
      }
    } else {
      last = { point, value: value(motion, t1), time: t1 };
    }
  }
  return out;
}

const byTime = (motion, t) => (motion.starts_at + t) / (end || 1);
function byPress(motion, t) {
  const press = motion.series.find(s => s.name === 'press');
  const value = press ? valueAt(press, t) : NaN;
  return Number.isFinite(value) ? value / (pressTop() || 1) : -1;
}
function pressTop() {
  let top = 0;
  for (const m of plans) {
    for (const v of m.series.find(s => s.name === 'press')?.values ?? []) if (v > top) top = v;
  }
  return top;
}

function buildPath(motion) {
  const pieces = tracks(motion, byTime);
  const of = contact => new Float32Array(pieces.filter(p => p.contact === contact).flatMap(p => p.data));
  const on = space.lines(of(true), () => colourOf('--path'),
    { wide: 4, lift: 0.0012, ramp: true, passes: true });
  const off = space.lines(of(false), () => colourOf('--path'), { wide: 1.6, lift: 0.0008, passes: true });
  paths.push({ motion, things: [on, off] });
}

function repaint(by) {
  for (const { motion, things: [on] } of paths) {
    const pieces = tracks(motion, by).filter(p => p.contact);
    space.reline(on, new Float32Array(pieces.flatMap(p => p.data)));
  }
  scale();
  space?.touch();
}

function scale() {
  const byPressNow = $('colour')?.value === 'press';
  $('scale').innerHTML = plans.length
    ? `${byPressNow ? '0 mm' : '0 s'}<i style="background:linear-gradient(90deg,#450a5c,#3b528c,#21918c,#5ec961,#fcdb24)"></i>${byPressNow ? `${pressTop().toFixed(1)} mm pressed in` : `${end.toFixed(1)} s`}` : '';
}

/** A ball about what matters: the given focus. */
function overview(at_once) {
  if (!space) return;
  space.mark = null; space.fly(data.focus.at, data.focus.radius, { turn: data.focus.turn, tilt: 0.45 }, at_once);
}

// ---- the list ------------------------------------------------------------------------------

let place = -1;
const buttons = [];
function buildPlaces() {
  for (const group of data.places) {
    const head = document.createElement('h3');
    head.append(group.name);
    const small = document.createElement('small');
    small.append(group.detail ? ` ${group.detail}` : '');
    head.append(small);
    const list = document.createElement('ol');
    for (const item of group.items) {
      const button = document.createElement('button');
      button.append(item.label);
      const index = buttons.length;
      button.onclick = () => visit(index);
      buttons.push({ button, item });
      const row = document.createElement('li');
      row.append(button);
      list.append(row);
    }
    $('places').append(head, list);
  }
}

function visit(index) {
  if (!buttons.length || !space) return;
  place = (index + buttons.length) % buttons.length;
  buttons.forEach(({ button }, i) => button.setAttribute('aria-pressed', i === place));
  const { item } = buttons[place];
  space.mark = { at: item.at, radius: item.radius };
  const view = {};
  if (item.normal) {
    const [x, y, z] = item.normal;
    view.tilt = Math.max(-0.2, Math.min(0.85, Math.asin(z)));
    if (Math.hypot(x, y) > 0.15) {
      const turn = Math.atan2(y, x), now = space.camera.turn;
      view.turn = turn + 2 * Math.PI * Math.round((now - turn) / (2 * Math.PI));
    }
  }
  space.fly(item.at, Math.max(0.16, 2.2 * item.radius), view);
}

// ---- curves --------------------------------------------------------------------------------

let curves = null;
const COLOURS = ['--accent', '--left', '--good'];
function lines(motions, of, colours, dash) {
  return motions.map((motion, i) => {
    const { times, values } = of(motion);
    const shifted = Float64Array.from(times, t => t + motion.starts_at);
    return { times: shifted, values, colour: colours[i % colours.length], dash };
  });
}

function rowsOf(what) {
  const both = of => [...lines(plans, of, COLOURS), ...lines(measured, of, ['--measured'], [3, 3])];
  const title = joint => joint.name.replace(/_joint$/, '').replace(/(.{1,13})(_|$)/g, '$1\n').trim();
  if (what === 'positions') {
    return data.joints.map((joint, j) => ({ name: title(joint), unit: joint.unit, limits: joint.limits,
      lines: both(m => ({ times: m.times, values: m.times.map((_, k) => m.q[k * dof + j]) })) }));
  }
  if (what === 'velocities') {
    return data.joints.map((joint, j) => ({ name: title(joint), unit: `${joint.unit}/s`,
      lines: both(m => velocities(m, j)) }));
  }
  const of = name => m => m.series.find(s => s.name === name);
  const with_ = (motions, name) => motions.filter(of(name));
  const all = [...plans, ...measured];
  const names = [...new Set(all.flatMap(m => m.series.map(s => s.name)))];
  const first = name => of(name)(with_(all, name)[0]);
  return names.map(name => ({ name: name.replace(', ', '\n'), unit: first(name).unit,
    most: first(name).most ?? Infinity, zero: true, digits: 1,
    lines: [...lines(with_(plans, name), of(name), COLOURS),
      ...lines(with_(measured, name), of(name), ['--measured'])] }));
}

/** Stretches of time in which what runs is off the surface. */
function transfers() {
  const bands = [];
  plans.forEach((m, i) => {
    const until = plans[i + 1]?.starts_at ?? Infinity;
    for (let k = 1; m.contact && k < m.times.length; k++) {
      const from = m.starts_at + m.times[k - 1], to = Math.min(until, m.starts_at + m.times[k]);
      if (m.contact[k] === 1 || from >= to) continue;
      if (bands.length && Math.abs(bands.at(-1)[1] - from) < 1e-6) bands.at(-1)[1] = to;
      else bands.push([from, to]);
    }
  });
  return bands;
}

function tab(what) {
  for (const button of $('tabs').querySelectorAll('[data-tab]')) {
    button.setAttribute('aria-pressed', button.dataset.tab === what);
  }
  curves.show(rowsOf(what), transfers(), end);
  curves.cursor(player.time);
}

// ---- together ------------------------------------------------------------------------------

function refresh() {
  if (!plans.length) return;
  const running = plans[runningAt(player.time)], own = player.time - running.starts_at;
  if (space) {
    moving = bodies(jointsAt(running, own));
    const seen = measured.findLast(m => m.starts_at <= player.time + 1e-9);
    ghost = seen ? bodies(jointsAt(seen, player.time - seen.starts_at)) : [];
  }
  $('time').value = player.time;
  const knot = before(running.times, own);
  const ahead = Math.min(knot + 1, running.times.length - 1);
  const words = [`${player.time.toFixed(2)} of ${end.toFixed(1)} s`,
    `${plans.length > 1 ? `${running.name}, ` : ''}knot ${knot}`];
  if (running.contact) words.push(running.contact[ahead] === 1 ? 'on the surface' : 'in transfer');
  $('now').textContent = words.join(' · ');
  if (document.activeElement !== $('knot')) $('knot').value = knot;
  curves?.cursor(player.time);
}

let awake = false;
function wake() {
  if (awake) return;
  awake = true;
  requestAnimationFrame(frame);
}

const frames = [];
function frame(now) {
  awake = false;
  if (player.playing) {
    const past = Math.min(0.25, (now - player.last) / 1000);
    player.last = now;
    const time = player.time + Math.max(0, past) * player.speed;
    player.time = Math.min(end, time);
    refresh();
    if (time >= end) play(false);
    if (space) space.stale = true;
  }
  if (space?.stale) {
    const start = performance.now();
    space.draw(player.time);
    frames.push(performance.now() - start);
    if (frames.length > 240) frames.shift();
  }
  if (player.playing) wake();
}

function theme(name) {
  document.documentElement.dataset.theme = name;
  colours.clear();
  $('theme').textContent = name === 'dark' ? 'Light' : 'Dark';
  swatches();
  curves?.draw();
  space?.touch();
}

function buildPlayer() {
  $('time').max = end;
  $('time').step = 'any';
  $('time').oninput = () => { play(false); seek(+$('time').value); };
  $('play').onclick = () => play(!player.playing);
  $('back').onclick = () => step(true, -1);
  $('ahead').onclick = () => step(true, 1);
  $('speed').onchange = () => { player.speed = +$('speed').value; };
  $('knot').onchange = () => {
    const motion = plans[runningAt(player.time)];
    const k = Math.max(0, Math.min(motion.times.length - 1, Math.round(+$('knot').value) || 0));
    play(false);
    seek(motion.starts_at + motion.times[k]);
  };
  if (plans.some(m => m.series.some(s => s.name === 'press'))) {
    $('colour').onchange = () => repaint($('colour').value === 'press' ? byPress : byTime);
  } else {
    $('colour').remove();
  }
  curves = new Curves($('plot'), t => { play(false); seek(t); });
  for (const button of $('tabs').querySelectorAll('[data-tab]')) {
    button.onclick = () => tab(button.dataset.tab);
    if (button.dataset.tab === 'distances' && ![...plans, ...measured].some(m => m.series.length)) button.remove();
  }
  tab('positions');
}

function keys(e) {
  if (/^(INPUT|SELECT|TEXTAREA)$/.test(e.target.tagName) && e.target.type !== 'range') return;
  if (e.ctrlKey || e.metaKey || e.altKey) return;
  const arrow = { ArrowLeft: [-0.12, 0], ArrowRight: [0.12, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[e.key];
  if (arrow && e.shiftKey) { space?.orbit(...arrow); e.preventDefault(); return; }
  const faster = way => {
    const list = [...$('speed').options], at = $('speed').selectedIndex + way;
    if (list[at]) { $('speed').selectedIndex = at; player.speed = +$('speed').value; }
  };
  const moves = !plans.length ? {} : {
    ' ': () => play(!player.playing), ArrowLeft: () => step(true, -1), ArrowRight: () => step(true, 1),
    ',': () => step(false, -1), '.': () => step(false, 1), Home: () => { play(false); seek(0); },
    End: () => { play(false); seek(end); }, '<': () => faster(-1), '>': () => faster(1) };
  const act = { ...moves, '+': () => space?.zoom(0.85), '-': () => space?.zoom(1 / 0.85),
    n: () => visit(place + 1), p: () => visit(place < 0 ? buttons.length - 1 : place - 1),
    f: () => overview(), t: () => $('theme').click() }[e.key];
  if (!act || (e.key === ' ' && e.target.tagName === 'BUTTON')) return;
  e.preventDefault();
  act();
}

/** What a test asks. */
window.nullsweep = { player, seek, padAt, jointsAt, plans, measured, misfit, runningAt, frames, visit, end,
  get camera() { return space?.camera; }, draw: () => space?.finish(player.time), bodies: () => moving };

theme(matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light');
$('theme').onclick = () => theme(document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark');
document.addEventListener('keydown', keys);
if (plans.length) buildPlayer();
buildPlaces();
if (data.focus) {
  try {
    buildScene();
    scale();
    overview(true);
  } catch (error) {
    $('trouble').textContent = `No picture in space: ${error.message}.`;
    $('trouble').hidden = false;
    space = null;
  }
}
if (plans.length && data.pad && misfit() > 1e-4) {
  const note = document.createElement('li');
  note.append(`This page moves the arm otherwise than the plan does, by ${(misfit() * 1e3).toFixed(2)} mm: do not trust its motion.`);
  $('notes').append(note);
}
refresh();
space?.touch();
