// Panels: show the state, and turn what is done in them into inputs.
import { options, toHex, toLinear } from './fields.js';
import { Looks } from './looks.js';
import { chosen, open } from './upload.js';

const $ = id => document.getElementById(id);
/** Planes that count what pixels cost. */
const HEAT = ['nodes', 'triangles', 'cost'];
/** Light as a colour whose largest part is one, and a power of two. */
const split = rgb => { const most = Math.max(...rgb); return most > 0 ? { hex: toHex(rgb.map(v => v / most)), power: Math.log2(most) } : { hex: '#ffffff', power: -99 }; };
const join = (hex, power) => { const rgb = toLinear(hex), most = Math.max(...rgb, 1e-6); return rgb.map(v => v / most * 2 ** power); };

export class Panels {
  constructor(app) {
    this.app = app;
    this.gesture = 0;
    this.light = null;
    this.wire();
  }

  get scene() { return this.app.state?.scene; }

  /** Fields send while they are dragged; all of one drag is undone together. */
  field(id, act) {
    const element = $(id);
    element.addEventListener('pointerdown', () => { this.gesture += 1; });
    element.addEventListener('keydown', () => { this.gesture += 1; });
    element.addEventListener('input', () => { if (this.scene) act(element); });
  }

  button(id, act) { $(id).addEventListener('click', () => act($(id))); }

  change(change) { this.app.send({ do: 'change', change, gesture: 1000 * (this.app.company?.you ?? 0) + this.gesture }); }

  wire() {
    const { app } = this, send = input => app.send(input);
    this.button('undo', () => send({ do: 'undo' }));
    this.button('redo', () => send({ do: 'redo' }));
    this.button('help-button', () => $('help').showModal());
    this.button('menu', button => {
      const hidden = $('panels').toggleAttribute('data-hidden');
      button.setAttribute('aria-expanded', String(!hidden));
    });
    this.button('full', () => document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen());
    this.button('theme', () => {
      const dark = document.documentElement.dataset.theme ? document.documentElement.dataset.theme === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
      localStorage.setItem('theme', document.documentElement.dataset.theme = dark ? 'light' : 'dark');
    });
    const theme = localStorage.getItem('theme');
    if (theme) document.documentElement.dataset.theme = theme;
    this.button('ask', () => { app.tell({ ask: true }); app.say('asked for the controls'); });

    this.field('camera', e => { if (e.value !== '') send({ do: 'camera', index: +e.value }); });
    for (const name of ['mode', 'gizmo']) for (const radio of document.getElementsByName(name)) {
      radio.addEventListener('change', () => send({ do: name, mode: radio.value }));
    }
    this.field('field', e => send({ do: 'field', degrees: +e.value }));
    this.button('home', () => send({ do: 'home' }));
    this.button('focus', () => send({ do: 'focus' }));
    this.button('play', () => send({ do: 'play', playing: !this.scene?.playing }));
    this.field('time', e => { this.sought = performance.now(); send({ do: 'seek', time: +e.value }); });
    this.field('clip', e => send({ do: 'clip', index: +e.value }));

    this.field('thing', e => send({ do: 'select', what: e.value === '' ? null : { type: 'instance', instance: +e.value } }));
    this.button('holder', () => send({ do: 'select-holder' }));
    this.field('visible', e => { this.gesture += 1; this.change({ kind: 'show', instance: this.scene.selection.instance, visible: e.checked }); });
    for (const id of ['m-color', 'm-metallic', 'm-roughness', 'm-transmission', 'm-glow', 'm-strength']) this.field(id, () => this.material());

    this.field('light', e => { this.light = e.value === '' ? null : +e.value; send({ do: 'select', what: this.light === null ? null : { type: 'light', light: this.light } }); });
    for (const id of ['l-color', 'l-power', 'l-x', 'l-y', 'l-z', 'l-height', 'l-turn']) this.field(id, () => this.lamp());
    this.button('l-remove', () => { this.gesture += 1; this.change({ kind: 'light', light: this.light }); });
    this.button('add-light', () => send({ do: 'add-light' }));
    for (const id of ['sky', 'e-color', 'e-scale', 'e-turn', 'e-height', 'e-haze']) this.field(id, () => this.surroundings());

    this.field('renderer', e => send({ do: 'renderer', name: e.value }));
    this.field('plane', e => send({ do: 'show', plane: e.value || null }));
    this.looks = new Looks(app);
    this.field('auto', e => send({ do: 'exposure', stops: e.checked ? null : app.header?.exposure ?? 0 }));
    this.field('exposure', e => send({ do: 'exposure', stops: +e.value }));
    this.field('goal', e => send({ do: 'goal', frames_per_second: e.value ? +e.value : null }));

    const name = () => (this.app.state?.title || 'heliostat').replace(/\.[^.]*$/, '').replace(/[^\w-]+/g, '-');
    this.button('save-png', () => this.save('/picture.png', `${name()}.png`));
    this.button('save', () => $('save-png').click());
    this.button('save-exr', () => this.save('/picture.exr', `${name()}.exr`));
    this.button('save-replay', () => this.save('/replay.json', `${name()}.replay.json`));
    this.button('record', () => send({ do: 'record', on: !this.scene?.recording }));
    this.button('forget', () => send({ do: 'forget' }));
    $('file').addEventListener('change', () => { open(app, chosen($('file'))); $('file').value = ''; });
  }

  async save(path, name) {
    const answer = await fetch(this.app.address(path));
    if (!answer.ok) return this.app.say(await answer.text(), true);
    const link = document.createElement('a');
    link.href = URL.createObjectURL(await answer.blob());
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    this.app.say(`saved ${name}`);
  }

  material() {
    const selection = this.scene?.selection;
    if (!selection?.look) return;
    const strength = +$('m-strength').value;
    const look = {
      ...selection.look,
      base_color: [...toLinear($('m-color').value), selection.look.base_color[3]],
      metallic: +$('m-metallic').value, roughness: +$('m-roughness').value, transmission: +$('m-transmission').value,
      emissive: strength <= -4 ? [0, 0, 0] : join($('m-glow').value, strength),
    };
    this.change({ kind: 'material', material: selection.material, look });
  }

  lamp() {
    const light = this.scene?.lights.find(light => light.id === this.light);
    if (!light) return;
    const to = { ...light.lamp }, power = join($('l-color').value, +$('l-power').value);
    to[['intensity', 'irradiance', 'scale'].find(name => name in to)] = power;
    if ('position' in to) to.position = ['l-x', 'l-y', 'l-z'].map((id, i) => $(id).value === '' ? to.position[i] : +$(id).value);
    if (to.type === 'directional') {
      const [height, turn] = ['l-height', 'l-turn'].map(id => +$(id).value * Math.PI / 180);
      to.direction = [-Math.cos(height) * Math.sin(turn), -Math.sin(height), -Math.cos(height) * Math.cos(turn)];
    }
    this.change({ kind: 'light', light: light.id, name: light.name, to });
  }

  surroundings() {
    const scale = 2 ** +$('e-scale').value, color = toLinear($('e-color').value).map(v => v * scale);
    const turn = +$('e-turn').value * Math.PI / 180, elevation = +$('e-height').value * Math.PI / 180;
    const to = { sky: { type: 'sky', turbidity: +$('e-haze').value, elevation, azimuth: turn, scale: color }, own: { type: 'own', scale: color, turn }, constant: { type: 'constant', radiance: color }, dark: { type: 'dark' } }[$('sky').value];
    this.change({ kind: 'environment', to });
  }

  /** Shows the state. Fields that are being used keep their value. */
  update() {
    const s = this.scene;
    for (const element of document.querySelectorAll('#panels input, #panels select')) element.disabled = !s;
    if (!s) return;
    const put = (id, value) => { if (document.activeElement !== $(id) && $(id).value !== String(value)) $(id).value = value; };
    const check = (id, value) => { $(id).checked = value; };
    $('undo').disabled = !s.undo; $('redo').disabled = !s.redo;
    $('undo').title = `Undo ${s.undo ?? ''} (Ctrl+Z)`; $('redo').title = `Redo ${s.redo ?? ''} (Ctrl+Shift+Z)`;
    options('camera', [['', '—'], ...s.cameras.map((name, i) => [i, name || `camera ${i}`])], '');
    for (const [name, value] of [['mode', s.mode], ['gizmo', s.gizmo]]) for (const radio of document.getElementsByName(name)) radio.checked = radio.value === value;
    put('field', Math.round(s.field));
    $('time-panel').hidden = s.clips.length === 0;
    options('clip', s.clips.map(([name], i) => [i, name || `clip ${i}`]), s.clip);
    $('time').max = s.clips[s.clip]?.[1] ?? 1;
    $('play').textContent = s.playing ? 'Pause' : 'Play';
    $('play').setAttribute('aria-pressed', String(s.playing));

    const selection = s.selection, instance = selection?.type === 'instance' ? selection : null;
    const more = s.thing_count > s.things.length ? ` (of ${s.thing_count})` : '';
    options('thing', [['', `—${more}`], ...s.things.map(thing => [thing.id, thing.name])], s.things.some(t => t.id === instance?.instance) ? instance.instance : '');
    $('nothing').hidden = !!selection;
    $('selected').hidden = !instance;
    if (instance) {
      $('selected-name').textContent = instance.name;
      $('holder').hidden = !instance.has_holder;
      check('visible', instance.visible);
      $('material').hidden = !instance.look;
      $('material-name').textContent = instance.material_name + (instance.textured ? ' (textured)' : '');
      if (instance.look) {
        const { look } = instance, glow = split(look.emissive);
        put('m-color', toHex(look.base_color.slice(0, 3)));
        put('m-metallic', look.metallic); put('m-roughness', look.roughness); put('m-transmission', look.transmission);
        put('m-glow', glow.hex); put('m-strength', Math.max(-4, Math.min(10, glow.power)).toFixed(1));
      }
    }
    if (selection?.type === 'light') this.light = selection.light;
    const light = s.lights.find(light => light.id === this.light);
    options('light', [['', s.light_count > s.lights.length ? `— (of ${s.light_count})` : '—'], ...s.lights.map(l => [l.id, l.name])], light ? light.id : '');
    $('lamp').hidden = !light;
    if (light) {
      const { lamp } = light, { hex, power } = split(lamp.intensity ?? lamp.irradiance ?? lamp.scale);
      put('l-color', hex); put('l-power', Math.max(-10, Math.min(16, power)).toFixed(1));
      $('l-place').hidden = !lamp.position;
      $('l-sun').hidden = lamp.type !== 'directional';
      lamp.position?.forEach((v, i) => put(['l-x', 'l-y', 'l-z'][i], +v.toFixed(3)));
      if (lamp.type === 'directional') {
        const [x, y, z] = lamp.direction, length = Math.hypot(x, y, z), degrees = 180 / Math.PI;
        put('l-height', Math.round(Math.asin(-y / length) * degrees)); put('l-turn', Math.round(Math.atan2(-x, -z) * degrees));
      }
    }
    const around = s.surroundings;
    put('sky', around.type);
    const { hex, power } = split(around.radiance ?? around.scale ?? [1, 1, 1]);
    put('e-color', hex); put('e-scale', Math.max(-8, Math.min(6, power)).toFixed(1)); put('e-turn', Math.round((around.turn ?? around.azimuth ?? 0) * 180 / Math.PI));
    if (around.type === 'sky') { put('e-height', Math.round(around.elevation * 180 / Math.PI)); put('e-haze', around.turbidity); }
    $('e-sun').hidden = around.type !== 'sky';
    options('renderer', s.renderers.map(name => [name, name]), s.renderer);
    options('plane', [['', 'the picture'], ...s.planes.map(name => [name, HEAT.includes(name) ? `heat map: ${name}` : name])], s.plane ?? '');
    this.looks.update(); check('auto', s.exposure === null);
    put('exposure', s.exposure ?? (this.app.header?.exposure ?? 0).toFixed(1));
    put('goal', s.goal ?? '');
    $('record').textContent = s.recording ? 'End recording' : s.recorded === null ? 'Record path' : 'Record anew';
    $('forget').hidden = s.recorded === null;
    $('recorded').textContent = s.recorded === null ? '“Save replay” saves the view as it is, with all changes.' : s.recording ? 'Recording the path and all changes …' : `“Save replay” saves the recording of ${s.recorded.toFixed(1)} s.`;
    $('record').setAttribute('aria-pressed', String(s.recording));
  }

  moment(time) { if (!(performance.now() - this.sought < 500)) $('time').value = time; }

  company() {
    const { you, holder, all, asking } = this.app.company;
    $('watching').hidden = holder === you;
    $('viewers-panel').hidden = all.length < 2;
    $('viewers').replaceChildren(...all.map(id => {
      const item = document.createElement('li');
      item.textContent = `viewer ${id}${id === you ? ' (you)' : ''}${id === holder ? ', holds the controls' : ''}${asking.includes(id) ? ', asks for them' : ''} `;
      if (holder === you && id !== you) {
        const give = document.createElement('button');
        give.textContent = 'hand over';
        give.addEventListener('click', () => this.app.tell({ give: id }));
        item.append(give);
      }
      return item;
    }));
    if (holder === you && asking.length) this.app.say(`viewer ${asking[0]} asks for the controls (see Viewers)`);
  }
}
