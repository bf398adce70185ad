// The page's core: one connection that comes back by itself, the picture, and what ties the other parts together.
import { watchInput } from './input.js';
import { Panels } from './panels.js';
import { Overlay } from './overlay.js';

const $ = id => document.getElementById(id);
const token = new URLSearchParams(location.search).get('token') ?? '';
const canvas = $('picture');
const context = canvas.getContext('2d', { alpha: false });

/** What all parts share. Tests read it through `window.heliostat`. */
const app = {
  state: null, company: null, key: '', header: null, pictures: 0, latency: 0,
  send(input) {
    if (socket?.readyState !== WebSocket.OPEN) return;
    number += 1;
    sent.set(number, performance.now());
    if (sent.size > 500) sent.delete(sent.keys().next().value);
    socket.send(JSON.stringify({ input, number }));
  },
  tell(message) { if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message)); },
  address(path, extra = {}) {
    return path + '?' + new URLSearchParams({ ...(token && { token }), ...extra });
  },
  say(text, error = false) {
    const line = document.createElement('p');
    line.textContent = text;
    line.className = error ? 'error' : '';
    $('messages').append(line);
    while ($('messages').children.length > 4) $('messages').firstChild.remove();
    setTimeout(() => line.remove(), error ? 12000 : 7000);
  },
};
window.heliostat = app;

let socket, number = 0, wait = 500, told = 0, first = true;
const sent = new Map();
const panels = new Panels(app);
const overlay = new Overlay(app);

function connect() {
  const scheme = location.protocol === 'https:' ? 'wss:' : 'ws:';
  socket = new WebSocket(`${scheme}//${location.host}${app.address('/socket')}`);
  socket.binaryType = 'arraybuffer';
  socket.onmessage = event => typeof event.data === 'string' ? hear(JSON.parse(event.data)) : show(event.data);
  socket.onclose = event => {
    status(event.reason || 'connection lost; trying again …');
    app.company = null;
    setTimeout(connect, wait);
    wait = Math.min(2 * wait, 5000);
  };
}

function status(text) { $('status').textContent = text; }

function hear(message) {
  if (message.welcome) {
    app.key = message.welcome.key;
    wait = 500;
    sent.clear();
  } else if (message.state) {
    app.state = message.state;
    $('title').textContent = app.state.title;
    document.title = app.state.title ? `${app.state.title} – Heliostat` : 'Heliostat';
    for (const { number, error, text } of app.state.messages) {
      if (number > told) app.say(text, error);
    }
    // A server that was started anew counts from one again.
    told = app.state.messages.at(-1)?.number ?? 0;
    loading(app.state.loading);
    panels.update();
  } else if (message.viewers) {
    const held = app.company?.holder === app.company?.you && app.company;
    app.company = message.viewers;
    const holds = app.company.holder === app.company.you;
    status(holds ? '' : 'watching');
    if (holds && !held) takeOver();
    panels.company();
  } else if (message.refused) {
    app.say(message.refused, true);
  }
}

/** The controls are ours: say how large the picture is, and, on arriving, which view the address asks for. */
function takeOver() {
  resize();
  const view = new URLSearchParams(location.hash.slice(1)).get('view');
  if (view && (first || app.header)) app.send({ do: 'view', text: view });
  first = false;
}

function loading(progress) {
  // Between the scene and its first picture there is nothing to count.
  const first = !progress && app.state.scene && !app.header;
  $('loading').hidden = !(progress || first);
  if (first) { $('loading-text').textContent = 'making the first picture …'; $('loading-bar').removeAttribute('value'); }
  if (!progress) return;
  $('loading-text').textContent = `opening ${progress.title} … ${progress.seconds.toFixed(1)} s`;
  const bar = $('loading-bar');
  if (progress.total > 0) { bar.max = progress.total; bar.value = progress.done; } else bar.removeAttribute('value');
}

async function show(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const packed = new Blob([new Uint8Array(buffer, 4 + length)], { type: header.kind });
  // One that a browser cannot decode, as when it is out of memory, is left out like one that came too late.
  const bitmap = await createImageBitmap(packed).catch(() => null);
  app.tell({ shown: header.number });
  if (!bitmap) return;
  // Decoding takes a while: a later picture may have come in between.
  if (app.header && header.number < app.header.number && app.header.number - header.number < 1000) return bitmap.close();
  app.box = fitting(header);
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(bitmap, ...app.box);
  bitmap.close();
  if (!app.header && !app.state?.loading) $('loading').hidden = true;
  app.header = header;
  app.pictures += 1;
  const at = sent.get(header.input);
  if (at) {
    app.latency = performance.now() - at;
    for (const key of [...sent.keys()]) if (key <= header.input) sent.delete(key);
  }
  overlay.update(header);
  panels.moment(header.time);
  remember(header.view);
}

/** Where a picture lies on the canvas: all over it, or, if it was made for another window, as large as its shape allows. */
function fitting({ width, height }) {
  const scale = Math.min(canvas.width / width, canvas.height / height), [w, h] = [width * scale, height * scale];
  // Small pictures are of the right shape only up to a pixel.
  const fits = w > 0.95 * canvas.width && h > 0.95 * canvas.height;
  return fits ? [0, 0, canvas.width, canvas.height] : [(canvas.width - w) / 2, (canvas.height - h) / 2, w, h];
}

let remembered = 0;
/** The view stays in the address, so that a link or a reload comes back to it. */
function remember(view) {
  clearTimeout(remembered);
  remembered = setTimeout(() => history.replaceState(null, '', `#view=${view}`), 300);
}

function resize() {
  const box = canvas.parentElement.getBoundingClientRect();
  const scale = Math.min(devicePixelRatio || 1, 2);
  const [width, height] = [box.width, box.height].map(n => Math.max(16, Math.round(n * scale)));
  if (canvas.width !== width || canvas.height !== height) {
    // Changing its size empties a canvas: keep what it shows until the next picture.
    const old = app.header && document.createElement('canvas');
    if (old) { [old.width, old.height] = [canvas.width, canvas.height]; old.getContext('2d').drawImage(canvas, 0, 0); }
    [canvas.width, canvas.height] = [width, height];
    if (old) context.drawImage(old, 0, 0, width, height);
  }
  overlay.resize(width, height);
  // Whoever watches sees the picture of the one who holds the controls.
  if (app.company?.holder === app.company?.you) app.send({ do: 'size', width, height });
}

new ResizeObserver(resize).observe(canvas.parentElement);
watchInput(app, canvas);
connect();
if (matchMedia('(pointer: coarse)').matches) $('hint').textContent = 'one finger turns, two shift and zoom · tap a thing to change it';
setTimeout(() => { $('hint').hidden = false; setTimeout(() => $('hint').remove(), 12000); }, 800);
