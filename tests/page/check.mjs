// Opens a page of `planner plan --report` or `planner view` in headless Chromium and uses it as a
// user would: nothing fails, nothing is fetched, the slider moves the arm. Run by tests/page/run.
import { chromium } from 'playwright-core';
import { mkdtempSync, statSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';

const [page_file, pictures] = process.argv.slice(2);
const failures = [];
const check = (what, ok, found = '') => {
  console.log(`${ok ? 'ok  ' : 'FAIL'} ${what}${found === '' ? '' : `: ${found}`}`);
  if (!ok) failures.push(what);
};

const context = await chromium.launchPersistentContext(mkdtempSync(join(tmpdir(), 'page-')), {
  executablePath: process.env.CHROMIUM || '/usr/bin/chromium',
  headless: true,
  viewport: { width: 1440, height: 900 },
  args: ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync', '--use-gl=angle', '--use-angle=swiftshader',
    '--enable-unsafe-swiftshader'],
});
const page = await context.newPage();
const errors = [], fetched = [];
page.on('pageerror', e => errors.push(e.message));
page.on('console', m => { if (m.type() === 'error') errors.push(m.text()); });
page.on('request', r => { if (!/^(file|data):/.test(r.url())) fetched.push(r.url()); });

const started = performance.now();
await page.goto(`file://${resolve(page_file)}`);
await page.waitForFunction('window.nullsweep && nullsweep.frames.length > 0');
const kilobytes = statSync(page_file).size / 1000;
check('it is at most 6 MB', kilobytes <= 6000, `${kilobytes.toFixed(0)} kB, loaded in ${(performance.now() - started).toFixed(0)} ms`);

/** How many pixels of the scene differ between two moments. */
const pixels = () => page.evaluate(() => {
  const canvas = document.getElementById('space'), copy = document.createElement('canvas');
  copy.width = canvas.width; copy.height = canvas.height;
  const pen = copy.getContext('2d');
  pen.drawImage(canvas, 0, 0);
  return [...new Uint32Array(pen.getImageData(0, 0, copy.width, copy.height).data.buffer)];
});
const settle = () => page.waitForTimeout(900);
const differ = (a, b) => a.reduce((n, x, i) => n + (x !== b[i]), 0);
const shot = name => (pictures ? page.screenshot({ path: join(pictures, `${name}.png`) }) : null);

const before = await pixels();
check('the scene shows something', new Set(before).size > 50, `${new Set(before).size} colours`);
const moves = await page.evaluate('nullsweep.plans.length > 0');
if (moves) {
  const misfit = await page.evaluate('nullsweep.misfit()');
  check('the page moves the pad where the planner does', misfit < 1e-4, `${(misfit * 1e6).toFixed(1)} µm off at most`);
  const slider = page.locator('#time');
  await slider.focus();
  await slider.evaluate(e => { e.value = e.max / 2; e.dispatchEvent(new Event('input')); });
  await settle();
  const middle = await pixels();
  check('the slider moves the arm', differ(before, middle) > 500, `${differ(before, middle)} pixels`);
  const at = await page.evaluate('nullsweep.player.time');
  await page.keyboard.press('ArrowRight');
  const next = await page.evaluate('nullsweep.player.time');
  check('an arrow key jumps to the next stop', next > at, `${at.toFixed(2)} to ${next.toFixed(2)} s`);
  await page.locator('#knot').fill('5');
  await page.locator('#knot').press('Enter');
  const knot = await page.evaluate(t => {
    const motion = nullsweep.plans[nullsweep.runningAt(t)];
    return Math.abs(nullsweep.player.time - motion.starts_at - motion.times[5]);
  }, next);
  check('a knot is jumped to', knot < 1e-5);
  await page.locator('#plot canvas').last().click({ position: { x: 400, y: 30 } });
  const clicked = await page.evaluate('nullsweep.player.time');
  check('a click on a curve sets the time', Math.abs(clicked - next) > 1e-3, `${clicked.toFixed(2)} s`);
  await page.locator('#time').focus();
  await page.keyboard.press('Space');
  const from = await page.evaluate('nullsweep.player.time');
  await page.waitForTimeout(1500);
  await page.keyboard.press('Space');
  const to = await page.evaluate('nullsweep.player.time');
  check('it plays', to > from, `${(to - from).toFixed(2)} s in 1.5 s`);
  // Until the pixels are there, not until the calls are made.
  const times = await page.evaluate(() => Array.from({ length: 40 }, (_, i) => {
    nullsweep.seek(nullsweep.end * i / 40);
    const start = performance.now();
    nullsweep.draw();
    return performance.now() - start;
  }).sort((a, b) => a - b));
  const renderer = await page.evaluate(() => {
    const gl = document.createElement('canvas').getContext('webgl2');
    const told = gl.getExtension('WEBGL_debug_renderer_info');
    return gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  });
  check('a step of the slider is drawn', times.length === 40,
    `${times[20].toFixed(1)} ms (p50), ${times[38].toFixed(1)} ms (p95), by ${renderer}`);
  // What lies over the canvas must let the mouse through.
  await page.evaluate('scrollTo(0, 0)');
  const canvas = await page.locator('#space').boundingBox();
  const held = [canvas.x + canvas.width / 2, canvas.y + canvas.height / 2];
  const eye = () => page.evaluate('JSON.stringify(nullsweep.camera)');
  const stood = await eye();
  await page.mouse.move(...held);
  await page.mouse.down();
  await page.mouse.move(held[0] + 40, held[1] + 10);
  await page.mouse.up();
  await settle();
  check('the mouse turns the scene', await eye() !== stood, '40 pixels to the right');
  await page.keyboard.press('f');
  await settle();
  if (await page.evaluate('nullsweep.measured.length')) {
    const button = page.getByRole('button', { name: 'measured path' });
    const shown = await pixels();
    await button.click();
    await settle();
    const hidden = differ(shown, await pixels());
    check('what was measured is drawn', hidden > 50, `${hidden} pixels of path`);
    await button.click();
  }
  const share = +process.env.AT || 0.45;
  await slider.evaluate((e, s) => { e.value = e.max * s; e.dispatchEvent(new Event('input')); }, share);
  await settle();
}
await page.evaluate('scrollTo(0, 0)');
await shot('wide');
if (await page.locator('.places button').count()) {
  const home = await page.evaluate('nullsweep.camera.target.join()');
  await page.locator('.places button').first().click();
  await settle();
  check('a click on the list flies there', await page.evaluate('nullsweep.camera.target.join()') !== home);
  await shot('place');
  await page.keyboard.press('f');
  await settle();
}
await page.locator('#theme').click();
await settle();
check('dark is dark', (await page.evaluate('getComputedStyle(document.body).backgroundColor')) === 'rgb(18, 22, 28)');
await shot('dark');
await page.locator('#theme').click();
if (moves) {
  for (const tab of ['velocities', 'distances']) {
    const button = page.locator(`[data-tab="${tab}"]`);
    if (!(await button.count())) continue;
    await button.click();
    await page.locator('.curves').scrollIntoViewIfNeeded();
    await settle();
    if (pictures) await page.locator('.curves').screenshot({ path: join(pictures, `${tab}.png`) });
  }
}
await page.setViewportSize({ width: 390, height: 844 });
await page.evaluate('scrollTo(0, 0)');
await page.keyboard.press('f');
await settle();
const over = await page.evaluate('document.documentElement.scrollWidth - innerWidth');
check("it fits a phone's width", over <= 0, `${over} px over`);
if (pictures) await page.screenshot({ path: join(pictures, 'narrow.png'), fullPage: true });
check('no error', errors.length === 0, errors.join('; '));
check('nothing is fetched', fetched.length === 0, fetched.join(' '));
await context.close();
process.exit(failures.length ? 1 : 0);
