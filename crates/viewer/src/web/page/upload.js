// Files of the user's: they go to the server's memory, under their names alone.

const SCENES = ['gltf', 'glb', 'obj', 'aff', 'nff', 'bsp', 'ply', 'ies'];
const kind = path => SCENES.indexOf(path.replace(/\.gz$/i, '').split('.').pop().toLowerCase());

/** Opens a scene: one file, or several of which one is the scene and the others are what it refers to; `[path, File]` each. */
export async function open(app, files) {
  const scene = files.filter(([path]) => kind(path) >= 0).sort(([a], [b]) => a.split('/').length - b.split('/').length || kind(a) - kind(b))[0] ?? files[0];
  if (!scene) return;
  const folder = scene[0].slice(0, scene[0].lastIndexOf('/') + 1);
  const name = scene[1].name, rest = files.filter(file => file !== scene);
  const all = [scene, ...rest], size = all.reduce((sum, [, file]) => sum + file.size, 0);
  app.say(`sending ${name}${rest.length ? ` and ${rest.length} more` : ''} (${(size / 1048576).toFixed(1)} MiB) …`);
  const header = new TextEncoder().encode(JSON.stringify(all.map(([path, file]) => [path.startsWith(folder) ? path.slice(folder.length) : path, file.size])));
  const length = new DataView(new ArrayBuffer(4));
  length.setUint32(0, header.length, true);
  const body = rest.length ? new Blob([length.buffer, header, ...all.map(([, file]) => file)]) : scene[1];
  try {
    const answer = await fetch(app.address('/upload', { name, key: app.key, ...(rest.length && { several: true }) }), { method: 'POST', body });
    if (!answer.ok) app.say(`${name}: ${await answer.text()}`, true);
  } catch (error) {
    app.say(`${name} could not be sent: ${error.message}`, true);
  }
}

/** What was chosen in a field for files. */
export const chosen = field => [...field.files].map(file => [file.webkitRelativePath || file.name, file]);

/** What was dropped, folders with all that is in them. */
export async function dropped(transfer) {
  const entries = [...transfer.items].map(item => item.webkitGetAsEntry?.()).filter(Boolean);
  if (!entries.length) return [...transfer.files].map(file => [file.name, file]);
  const found = [];
  const walk = async entry => {
    if (found.length >= 1000) return;
    if (entry.isFile) return void found.push([entry.fullPath.slice(1), await new Promise((yes, no) => entry.file(yes, no))]);
    const reader = entry.createReader();
    // A reader hands out a hundred at a time.
    for (let part; (part = await new Promise((yes, no) => reader.readEntries(yes, no))).length;) for (const inner of part) await walk(inner);
  };
  for (const entry of entries) await walk(entry);
  return found;
}
