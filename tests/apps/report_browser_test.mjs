// node report_browser_test.mjs DOFUSION_PLACE ASSETS NODE_MODULES
// The report of dofusion-place in headless Chromium, from a file and without a network: it loads without an error, the
// 3D view shows something, the list of candidates and the slider change it, and without WebGL the still pictures remain.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { accessSync, constants, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { delimiter, join, resolve } from 'node:path';

const [program, assets, modules] = process.argv.slice(2);

function skip(why) {
  console.log(`skipped: ${why}`);  // the words that tests/apps/CMakeLists.txt looks for
  process.exit(0);
}

function onPath(names) {
  for (const folder of process.env.PATH.split(delimiter)) {
    for (const name of names) {
      try {
        accessSync(join(folder, name), constants.X_OK);
        return join(folder, name);
      } catch { /* not in this folder */ }
    }
  }
  return null;
}

const chromium = onPath(['chromium', 'chromium-browser', 'google-chrome']) ?? skip('chromium was not found');
let playwright;
try {
  playwright = createRequire(join(resolve(modules), '/'))('playwright-core');
} catch {
  skip('playwright-core is not installed (npm could not be reached when the viewer was built)');
}

const folder = mkdtempSync(join(tmpdir(), 'dofusion_test_'));
process.on('exit', () => rmSync(folder, { recursive: true, force: true }));
// Few steps, so that some candidates are bad ones that move.
execFileSync(program, ['--depth', `${assets}/scans/two_blocks/depth.png`, '--camera', `${assets}/scans/two_blocks/camera.json`,
                       '--objects', `${assets}/blocks`, '--query', 'hat', '--samples', '12', '--steps', '8', '--seed', '1',
                       '--threads', '2', '--out', `${folder}/out`], { stdio: ['ignore', 'ignore', 'inherit'] });
const report = `${folder}/out/report.html`;
if (!readFileSync(report, 'utf8').includes('id="scene-glb"')) skip('the toolkit was built without the viewer');
const { placements } = JSON.parse(readFileSync(`${folder}/out/placements.json`, 'utf8'));

const quiet = ['--disable-background-networking', '--disable-component-update', '--disable-sync', '--disable-quic',
               '--no-first-run', '--no-sandbox'];
const software = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];

/** The report in a fresh browser; `test` gets the page. Whatever goes wrong in the page fails. */
async function inBrowser(args, size, test) {
  const browser = await playwright.chromium.launch({ executablePath: chromium, args: [...quiet, ...args] });
  try {
    const page = await browser.newPage({ viewport: size });
    const wrong = [];
    page.on('pageerror', (error) => wrong.push(error.message));
    page.on('console', (message) => { if (['error', 'warning'].includes(message.type())) wrong.push(message.text()); });
    page.on('request', (request) => { if (!/^(data:|blob:)/.test(request.url())) wrong.push(`asks for ${request.url()}`); });
    const own = `asks for file://${report}`;
    await page.goto(`file://${report}`);
    await test(page);
    // Software drawing stalls the pipeline when pixels are read, and says so.
    assert.deepEqual(wrong.filter((text) => text !== own && !/GPU stall due to ReadPixels/.test(text)), []);
  } finally {
    await browser.close();
  }
}

/** The canvas' pixels at 160 x 120: [[r, g, b]]. */
async function pixels(page) {
  return page.evaluate(() => {
    const small = Object.assign(document.createElement('canvas'), { width: 160, height: 120 });
    const context = small.getContext('2d');
    context.drawImage(document.querySelector('#viewer canvas'), 0, 0, 160, 120);
    const { data } = context.getImageData(0, 0, 160, 120);
    return Array.from({ length: 160 * 120 }, (_, i) => [data[4 * i], data[4 * i + 1], data[4 * i + 2]]);
  });
}

const isOrange = ([r, g, b]) => r > 120 && r > 1.5 * g && g > 1.5 * b;  // the query's colour, in light and in shade
/** The share of pixels that differ clearly. */
function changed(before, after) {
  const far = before.filter((colour, i) => colour.some((c, k) => Math.abs(c - after[i][k]) > 24));
  return far.length / before.length;
}

/** What the page says of the motion so far, in mm and degrees. */
async function movedBy(page) {
  const [, shift, turn] = (await page.locator('#viewer .moved').textContent()).match(/([\d.]+) mm and ([\d.]+)°/);
  return { shift: Number(shift), turn: Number(turn) };
}

await inBrowser(software, { width: 1100, height: 800 }, async (page) => {
  await page.waitForSelector('#candidates tr.chosen');
  const rows = page.locator('#candidates tr[data-row]');
  assert.equal(await rows.count(), placements.length);

  const first = await pixels(page);
  const kinds = new Set(first.map((colour) => colour.map((c) => c >> 4).join()));
  assert.ok(kinds.size > 10, `the canvas has ${kinds.size} colours`);
  assert.ok(first.filter(isOrange).length > 20, 'the query is not to be seen');
  assert.ok(await page.locator('#viewer .note').count() === 0 && !(await page.locator('#stills').getAttribute('open')));

  // By keyboard to the second, by mouse to the one that moves most.
  await rows.nth(0).locator('button').focus();
  await page.keyboard.press('ArrowDown');
  assert.equal(await page.locator('#candidates tr.chosen').textContent(), await rows.nth(1).textContent());
  assert.equal(await rows.nth(1).locator('button').getAttribute('aria-pressed'), 'true');
  assert.ok(changed(first, await pixels(page)) > 0.002, 'another candidate is the same picture');
  const last = placements.length - 1;
  assert.ok(placements[last].rotational_displacement_deg > 10, 'the worst candidate should move');
  await rows.nth(last).click();
  const start = await pixels(page);
  const slider = page.locator('#viewer input[type=range]');
  await slider.fill('1000');
  assert.ok(changed(start, await pixels(page)) > 0.002, 'the slider moves nothing');
  assert.ok((await movedBy(page)).shift > 1);
  // The table's figures are those of the motions at their ends, in hundredths of a degree.
  for (const candidate of [0, last]) {
    await rows.nth(candidate).click();
    await slider.fill('1000');
    const { turn } = await movedBy(page);
    assert.ok(Math.abs(turn - placements[candidate].rotational_displacement_deg) < 0.006, `${candidate}: ${turn}`);
  }
  await slider.fill('0');
  assert.ok(changed(start, await pixels(page)) < 1e-3, 'time 0 is not where it began');

  await page.locator('#viewer .play').click();
  await page.waitForFunction(() => Number(document.querySelector('#viewer input[type=range]').value) === 1000);

  // Turning the view, other views, the readings.
  const box = await page.locator('#viewer canvas').boundingBox();
  const before = await pixels(page);
  await page.mouse.move(box.x + 200, box.y + 200);
  await page.mouse.down();
  await page.mouse.move(box.x + 300, box.y + 210, { steps: 4 });
  await page.mouse.up();
  assert.ok(changed(before, await pixels(page)) > 0.02, 'dragging turns nothing');
  await page.locator('[data-look=camera]').click();
  assert.ok(changed(before, await pixels(page)) < 0.02, 'the camera button does not lead back');
  await page.getByLabel('depth readings').check();
  assert.ok(changed(before, await pixels(page)) > 0.01, 'no readings appear');
});

// On a telephone nothing sticks out at the side, whatever font is installed: a wide one, too.
await inBrowser(software, { width: 400, height: 800 }, async (page) => {
  await page.waitForSelector('#candidates tr.chosen');
  for (const style of ['* {}', '* { font-family: monospace !important; letter-spacing: 2px; }']) {
    await page.addStyleTag({ content: style });
    const wide = await page.evaluate(() => document.documentElement.scrollWidth <= 400 ? '' : [...document.querySelectorAll('*')]
      .filter((e) => e.getBoundingClientRect().right > 400 && !e.closest('.list *'))
      .map((e) => `${e.tagName}.${e.className}: ${e.textContent.slice(0, 60)}`).join('\n'));
    assert.equal(wide, '', 'the page is wider than the screen');
  }
  await page.reload();
  await page.waitForSelector('#candidates tr.chosen');
  assert.ok((await pixels(page)).filter(isOrange).length > 20);
});

await inBrowser(['--disable-3d-apis'], { width: 1200, height: 800 }, async (page) => {
  await page.waitForFunction(() => /no WebGL/.test(document.querySelector('#viewer .note').textContent));
  assert.equal(await page.locator('#viewer canvas').count(), 0);
  assert.ok(await page.locator('#stills img').first().isVisible());
});
console.log('passed');
