// Figures, their history, and the lines over the picture.
const $ = id => document.getElementById(id);
const COLORS = { x: '#ff5a5a', y: '#6ee36e', z: '#6aa5ff', selection: '#ffc24a', light: '#fff27a' };

export class Overlay {
  constructor(app) {
    this.app = app;
    this.times = [];
    this.rebuilt = [];
    this.lines = $('lines').getContext('2d');
    this.plot = $('plot').getContext('2d');
  }

  resize(width, height) {
    [$('lines').width, $('lines').height] = [width, height];
    if (this.app.header) this.draw(this.app.header.lines);
  }

  update(header) {
    this.draw(header.lines);
    const s = header.stats;
    this.times.push(s.render);
    if (this.times.length > 90) this.times.shift();
    if (s.rebuilt.length) this.rebuilt = s.rebuilt;
    const ms = n => n.toFixed(1).padStart(7);
    const rows = [
      `${header.width}×${header.height}  ${header.still ? `${header.frames} frames${header.done ? ', done' : ''}` : `${s.fps.toFixed(1)} fps`}`,
      `${(s.rays_per_second / 1e6).toFixed(1)} Mrays/s  ${(s.rays / 1e6).toFixed(2)} M rays`,
      `render ${ms(s.render)} ms (${Math.round(100 * s.query_share)} % rays)`,
      `edits  ${ms(s.apply)} ms`, `tone   ${ms(s.tone)} ms`, `encode ${ms(header.encode)} ms ${header.quality ? 'JPEG ' + header.quality : 'PNG'}`,
      `latency${ms(this.app.latency)} ms`,
    ];
    if (s.light_paths) rows.push(`${s.light_paths} light paths`);
    if (s.counts) rows.push(`${this.app.state?.scene?.plane ?? 'counts'} ${s.counts[0].toFixed(1)}, white ${s.counts[1].toFixed(0)}`);
    for (const [what, time] of this.rebuilt.slice(0, 3)) rows.push(`↻ ${what.slice(0, 26)} ${time.toFixed(1)} ms`);
    $('figures').textContent = rows.join('\n');
    this.history();
  }

  history() {
    const { plot } = this, { width, height } = plot.canvas, most = Math.max(...this.times, 1);
    plot.clearRect(0, 0, width, height);
    plot.fillStyle = '#ffb74a';
    this.times.forEach((time, i) => { const h = height * time / most; plot.fillRect(2 * i, height - h, 1.5, h); });
  }

  draw(lines) {
    const { lines: c } = this, [left, top, width, height] = this.app.box ?? [0, 0, c.canvas.width, c.canvas.height];
    c.resetTransform();
    c.clearRect(0, 0, c.canvas.width, c.canvas.height);
    c.translate(left, top);
    for (const { kind, points } of lines) {
      c.beginPath();
      points.forEach(([x, y], i) => i ? c.lineTo(x * width, y * height) : c.moveTo(x * width, y * height));
      const axis = 'xyz'.includes(kind);
      for (const [style, thickness] of [['#000a', axis ? 6 : 4], [COLORS[kind], axis ? 3.5 : 2]]) {
        c.strokeStyle = style;
        c.lineWidth = thickness;
        c.stroke();
      }
      const last = points.at(-1);
      if (axis && points.length === 2) { c.fillStyle = COLORS[kind]; c.fillRect(last[0] * width - 5, last[1] * height - 5, 10, 10); }
    }
  }
}
