// Mouse, touch, keys and dropped files become inputs.
import { dropped, open } from './upload.js';

const $ = id => document.getElementById(id);

export function watchInput(app, canvas) {
  pointers(app, canvas);
  keys(app, canvas);
  files(app, canvas.parentElement);
}

function pointers(app, canvas) {
  const held = new Map();
  let pinch = null;
  const at = event => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  const pointer = (phase, event) =>
    app.send({ do: 'pointer', phase, at: at(event), button: event.button === 2 || event.button === 1 || event.shiftKey ? 'pan' : 'turn' });
  // Several movements between two pictures are one; what waits is done before a finger comes or goes, or it would be lost.
  let waiting = null;
  const flush = () => { const last = waiting; waiting = null; if (last) move(last); };
  canvas.addEventListener('pointerdown', event => {
    flush();
    canvas.focus();
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, event);
    if (held.size === 1) pointer('down', event);
    // A second finger ends what the first one began.
    if (held.size === 2) { pointer('up', event); pinch = spread(held); }
    event.preventDefault();
  });
  canvas.addEventListener('pointermove', event => {
    if (!held.has(event.pointerId)) return;
    held.set(event.pointerId, event);
    if (!waiting) requestAnimationFrame(flush);
    waiting = event;
  });
  const move = event => {
    if (held.size === 1) return pointer('move', event);
    const now = spread(held), height = canvas.getBoundingClientRect().height;
    if (pinch) {
      app.send({ do: 'pan', by: [(now.x - pinch.x) / height, (now.y - pinch.y) / height] });
      app.send({ do: 'zoom', steps: Math.log(now.size / pinch.size) / Math.log(1 / 0.9) });
    }
    pinch = now;
  };
  const end = event => {
    flush();
    if (!held.delete(event.pointerId)) return;
    if (held.size === 0) { if (!pinch) pointer('up', event); pinch = null; }
  };
  canvas.addEventListener('pointerup', end);
  canvas.addEventListener('pointercancel', end);
  canvas.addEventListener('contextmenu', event => event.preventDefault());
  canvas.addEventListener('dblclick', event => app.send({ do: 'focus', at: at(event) }));
  canvas.addEventListener('wheel', event => {
    event.preventDefault();
    const lines = event.deltaMode === 0 ? event.deltaY / 100 : event.deltaY / 3;
    app.send({ do: 'zoom', steps: -Math.max(-5, Math.min(5, lines)) });
  }, { passive: false });
}

function spread(held) {
  const [a, b] = [...held.values()];
  return { x: (a.clientX + b.clientX) / 2, y: (a.clientY + b.clientY) / 2, size: Math.max(10, Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY)) };
}

const WAYS = { KeyD: [0, 1], KeyA: [0, -1], KeyE: [1, 1], KeyQ: [1, -1], KeyW: [2, 1], KeyS: [2, -1] };

function keys(app, canvas) {
  const down = new Set();
  let hurry = false;
  const drive = () => {
    const way = [0, 0, 0];
    for (const code of down) way[WAYS[code][0]] += WAYS[code][1];
    app.send({ do: 'drive', way, hurry });
  };
  const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const once = {
    Digit1: () => app.send({ do: 'mode', mode: 'orbit' }), Digit2: () => app.send({ do: 'mode', mode: 'fly' }),
    Digit3: () => app.send({ do: 'mode', mode: 'walk' }), KeyF: () => app.send({ do: 'focus' }), KeyH: () => app.send({ do: 'home' }),
    KeyG: () => app.send({ do: 'gizmo', mode: 'move' }), KeyR: () => app.send({ do: 'gizmo', mode: 'rotate' }),
    KeyX: () => app.send({ do: 'gizmo', mode: 'scale' }), KeyB: () => app.send({ do: 'select-holder' }),
    Escape: () => app.send({ do: 'select', what: null }), Space: () => $('play').click(), KeyL: () => app.send({ do: 'add-light' }),
    KeyC: () => nextCamera(app), KeyP: () => $('save-png').click(), KeyO: () => { $('overlay').hidden = !$('overlay').hidden; },
  };
  canvas.addEventListener('keydown', event => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.code in WAYS) {
      if (!down.has(event.code) || hurry !== event.shiftKey) { down.add(event.code); hurry = event.shiftKey; drive(); }
    } else if (event.code in arrow) {
      const [x, y] = arrow[event.code].map(n => 0.5 + 0.03 * n);
      const step = (phase, at) => app.send({ do: 'pointer', phase, at, button: event.shiftKey ? 'pan' : 'turn' });
      step('down', [-1, -1]); step('move', [x - 1.5, y - 1.5]); step('up', [x - 1.5, y - 1.5]);
    } else if (event.key === '+' || event.key === '-') {
      app.send({ do: 'zoom', steps: event.key === '+' ? 1 : -1 });
    } else if (event.code in once && !event.repeat) {
      once[event.code]();
    } else return;
    event.preventDefault();
  });
  canvas.addEventListener('keyup', event => { if (down.delete(event.code)) drive(); });
  canvas.addEventListener('blur', () => { if (down.size) { down.clear(); drive(); } });
  document.addEventListener('keydown', event => {
    const writing = event.target.matches?.('input[type=number], input[type=text], textarea');
    if (event.key === '?' && !writing) { $('help').open ? $('help').close() : $('help').showModal(); }
    if ((event.ctrlKey || event.metaKey) && event.code === 'KeyZ' && !writing) {
      app.send({ do: event.shiftKey ? 'redo' : 'undo' });
      event.preventDefault();
    }
  });
}

let camera = 0;
function nextCamera(app) {
  const count = app.state?.scene?.cameras.length ?? 0;
  if (count) app.send({ do: 'camera', index: camera = (camera + 1) % count });
}

function files(app, stage) {
  stage.addEventListener('dragover', event => { event.preventDefault(); stage.classList.add('dropping'); });
  stage.addEventListener('dragleave', () => stage.classList.remove('dropping'));
  stage.addEventListener('drop', async event => {
    event.preventDefault();
    stage.classList.remove('dropping');
    open(app, await dropped(event.dataTransfer));
  });
}
