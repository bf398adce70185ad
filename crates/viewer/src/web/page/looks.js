// How the picture is shown: false colours on surfaces, pixel shaders and their parameters, the tone curve.
import { options, toHex, toLinear } from './fields.js';

const $ = id => document.getElementById(id);

export class Looks {
  constructor(app) {
    this.app = app;
    const send = input => app.send(input);
    $('surfaces').addEventListener('input', event => {
      const name = event.target.value;
      send(name === 'diffuse' ? { do: 'diffuse', on: true } : { do: 'surfaces', shader: name ? { name } : null });
    });
    $('tone').addEventListener('input', event => send({ do: 'tone', curve: event.target.value ? { name: event.target.value } : null }));
    $('effect').addEventListener('input', event => {
      const name = event.target.value;
      if (name) send({ do: 'effects', shaders: [...this.scene.effects, { name }] });
      event.target.value = '';
      event.target.blur();
    });
    $('plain').addEventListener('click', () => send({ do: 'plain' }));
  }

  get scene() { return this.app.state.scene; }

  /** Shows the state. */
  update() {
    const s = this.scene, find = (list, name) => list.find(shader => shader.name === name);
    options('surfaces', [['', 'as they are'], ['diffuse', 'all diffuse'], ...s.false_colors.map(shader => [shader.name, words(shader.name)])], s.surfaces?.name ?? (s.diffuse ? 'diffuse' : ''));
    const curves = s.pixel_shaders.filter(shader => shader.for_display);
    options('tone', [['', 'as usual'], ...curves.map(shader => [shader.name, shader.name])], s.tone?.name ?? '');
    options('effect', [['', 'choose …'], ...s.pixel_shaders.map(shader => [shader.name, shader.name])], $('effect').value);
    fields($('surface-fields'), s.surfaces ? [[s.surfaces, find(s.false_colors, s.surfaces.name)]] : [], ([shader]) => this.app.send({ do: 'surfaces', shader }));
    fields($('tone-fields'), s.tone ? [[s.tone, find(s.pixel_shaders, s.tone.name)]] : [], ([curve]) => this.app.send({ do: 'tone', curve }));
    fields($('effect-fields'), s.effects.map(effect => [effect, find(s.pixel_shaders, effect.name)]), shaders => this.app.send({ do: 'effects', shaders }), true);
    $('plain').disabled = !(s.surfaces || s.diffuse || s.tone || s.effects.length || s.plane || s.exposure !== null);
  }
}

/** `show-uv` → `false colours: uv`. */
const words = name => name.replace(/^show-/, 'false colours: ');

/** Fields for the parameters of shaders, given as pairs of what is set and what there is to know; built only when the shaders change. */
function fields(box, list, change, removable = false) {
  box.effects = list.map(([effect]) => effect);
  const mark = JSON.stringify(box.effects.map(effect => effect.name));
  if (box.dataset.mark !== mark) {
    box.dataset.mark = mark;
    box.replaceChildren(...list.flatMap(([effect, shader], index) => shader ? [heading(box, effect, shader, index, change, removable), ...shader.parameters.map(parameter => field(box, index, parameter, change))].filter(Boolean) : []));
  }
  for (const input of box.querySelectorAll('[data-parameter]')) {
    const value = box.effects[input.dataset.index]?.parameters?.[input.dataset.parameter] ?? JSON.parse(input.dataset.usual);
    const text = input.type === 'color' ? toHex([value].flat().length === 3 ? value : [value, value, value]) : String([value].flat()[0]);
    if (document.activeElement !== input && input.value !== text) input.value = text;
  }
}

function heading(box, effect, shader, index, change, removable) {
  if (!removable) return null;
  const line = document.createElement('p'), name = document.createElement('strong'), remove = document.createElement('button');
  name.textContent = effect.name;
  name.title = shader.about;
  remove.textContent = 'remove';
  remove.setAttribute('aria-label', `Remove ${effect.name}`);
  remove.addEventListener('click', () => change(box.effects.filter((_, i) => i !== index)));
  line.className = 'row';
  line.append(name, remove);
  return line;
}

function field(box, index, parameter, change) {
  const label = document.createElement('label'), input = document.createElement('input');
  const [low, high] = parameter.range;
  label.textContent = parameter.name.replace(/_/g, ' ') + (parameter.unit && parameter.unit !== 'W/(m²·sr)' ? ` (${parameter.unit})` : '') + ' ';
  label.title = parameter.about;
  // What spans many powers of ten is written, not dragged.
  input.type = parameter.triple ? 'color' : high - low <= 64 ? 'range' : 'number';
  if (!parameter.triple) Object.assign(input, { min: low, max: high, step: input.type === 'range' ? (high - low) / 200 : 'any' });
  Object.assign(input.dataset, { index, parameter: parameter.name, usual: JSON.stringify(parameter.triple ? parameter.default : parameter.default[0]) });
  input.addEventListener('input', () => {
    const value = parameter.triple ? toLinear(input.value) : Math.min(high, Math.max(low, +input.value));
    if (input.value === '' || Number.isNaN(value)) return;
    change(box.effects.map((effect, i) => i === index ? { ...effect, parameters: { ...effect.parameters, [parameter.name]: value } } : effect));
  });
  label.append(input);
  return label;
}
