// The picture: layers from the floor up to the robot, in the colours of the style sheet.
let colours = {}, waiting = false, showsField = false;
const dark = window.matchMedia("(prefers-color-scheme: dark)");

function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["map", "free", "wall", "swept", "ahead", "driven", "robot", "keepout", "zone", "other", "left", "ink", "faint", "accent", "card", ...[0, 1, 2, 3, 4, 5].map((tint) => `room${tint}`)]) {
    colours[name] = style.getPropertyValue(`--${name}`).trim();
  }
  for (const kind of ["map", "floor", "field"]) if (model[kind]) model[kind].image = null;
}
dark.addEventListener("change", () => { readColours(); redraw(); });

const channels = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
const SCALE = [[13, 8, 135], [84, 2, 163], [139, 10, 165], [185, 50, 137], [219, 92, 104], [244, 136, 73], [254, 188, 43]];

// Colour and opacity of each mark of a kind; the highest set bit counts.
function tints(kind) {
  const table = new Uint8ClampedArray(4 * 256);
  for (let mark = 1; mark < 256; mark++) {
    const level = 32 - Math.clz32(mark);
    let tint;
    if (kind === "map") tint = [...channels(mark & 2 ? colours.wall : colours.free), mark & 3 ? 255 : 0];
    else if (kind === "floor") tint = [...channels(colours.swept), 80 + 25 * Math.min(level, 7)];
    else tint = [...SCALE[Math.min(level, 7) - 1], 215];
    table.set(tint, 4 * mark);
  }
  return table;
}

function imageOf(grid) {
  if (!grid.image) grid.image = tinted(grid, tints(grid.kind));
  return grid.image;
}

// A grid as an image, with the colour and opacity of each mark from a table.
function tinted(grid, table) {
  const image = document.createElement("canvas");
  [image.width, image.height] = [grid.cols, grid.rows];
  const context = image.getContext("2d"), pixels = context.createImageData(grid.cols, grid.rows);
  const out = new Uint32Array(pixels.data.buffer), colour = new Uint32Array(table.buffer);
  for (let i = 0; i < grid.marks.length; i++) out[i] = colour[grid.marks[i]];
  context.putImageData(pixels, 0, 0);
  return image;
}

function drawGrid(context, grid) {
  if (!grid) return;
  context.save();
  context.translate(...toScreen(grid.x, grid.y));
  context.rotate(-grid.yaw);
  const size = grid.pixel * view.scale;
  // The first row is the southernmost, and the screen's y grows downwards.
  context.scale(size, -size);
  context.imageSmoothingEnabled = size < 1;
  context.drawImage(imageOf(grid), 0, 0);
  context.restore();
}

// Unswept floor with one reason; thin strips are drawn wider.
const beside = document.createElement("canvas");
const THICK = [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]];
const REST = 64, OUT_OF_REACH = 7;
function drawLeft(context, ratio) {
  if (!model.left) return;
  const { marks, places } = model.left;
  [beside.width, beside.height] = [canvas.width, canvas.height];
  const over = beside.getContext("2d");
  over.setTransform(ratio, 0, 0, ratio, 0, 0);
  const layers = marks === REST
    ? [["map", (mark) => (mark & 3) === 1], ["floor", (mark) => mark >= 8], ["unswept", (mark) => mark & OUT_OF_REACH]]
    : [["unswept", (mark) => mark & marks]];
  for (const [kind, holds] of layers) {
    if (!model[kind]) continue;
    over.globalCompositeOperation = kind === layers[0][0] ? "source-over" : "destination-out";
    drawGrid(over, { ...model[kind], image: maskOf(model[kind], marks, holds) });
  }
  for (const [x, y] of marks === REST ? THICK.slice(0, 1) : THICK) context.drawImage(beside, x, y, canvas.clientWidth, canvas.clientHeight);
  context.lineWidth = 3;
  context.strokeStyle = colours.ink;
  for (const [x, y] of places) {
    context.beginPath();
    context.arc(...toScreen(x, y), 14, 0, 2 * Math.PI);
    context.stroke();
  }
}

// The pixels of a grid with some marks, as an image, which is cached with the grid.
function maskOf(grid, marks, holds) {
  const key = `${marks} ${colours.left}`;
  if (grid.maskKey === key) return grid.mask;
  const table = new Uint8ClampedArray(4 * 256);
  for (let mark = 0; mark < 256; mark++) if (holds(mark)) table.set([...channels(colours.left), 255], 4 * mark);
  [grid.mask, grid.maskKey] = [tinted(grid, table), key];
  return grid.mask;
}

function trace(context, points, closed, begins = true) {
  if (begins) context.beginPath();
  points.forEach(([x, y], i) => context[i ? "lineTo" : "moveTo"](...toScreen(x, y)));
  if (closed) context.closePath();
}

function drawArea(context, polygon, colour, name, dashed, opacity = 0.14) {
  trace(context, polygon, true);
  context.save();
  context.globalAlpha = opacity;
  context.fillStyle = colour;
  context.fill();
  context.restore();
  context.setLineDash(dashed ? [6, 5] : []);
  context.lineWidth = 2;
  context.strokeStyle = colour;
  context.stroke();
  context.setLineDash([]);
  if (!name) return;
  // Below its upper edge, as rooms have their names in the middle.
  const corners = polygon.map(([x, y]) => toScreen(x, y)), across = corners.map(([px]) => px);
  const wide = Math.max(...across) - Math.min(...across);
  const text = name === picked ? name : fitting(context, name, 1.3 * wide);
  const middle = across.reduce((sum, px) => sum + px, 0) / across.length;
  if (text) drawLabel(context, text, middle, Math.min(...corners.map(([, py]) => py)) + 11, colour);
}

const LABEL_FONT = "600 13px system-ui, sans-serif";
function drawLabel(context, text, px, py, colour) {
  const shown = text.length > 24 ? `${text.slice(0, 23)}…` : text;
  context.font = LABEL_FONT;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineWidth = 4;
  context.strokeStyle = colours.card;
  // If its middle is on the screen, a label is shown in full.
  const half = context.measureText(shown).width / 2 + 4, width = canvas.clientWidth;
  const at = px < 0 || px > width ? px : Math.min(Math.max(px, half), Math.max(width - half, half));
  context.strokeText(shown, at, py);
  context.fillStyle = colour;
  context.fillText(shown, at, py);
}

function drawPath(context) {
  const path = model.path, pose = model.pose;
  if (!path || path.xy.length < 4) return;
  // After a restart of the daemon, the last path is no longer in force.
  if (pose && pose.path === 0 && path.revision > 0) return;
  const at = pose && pose.path === path.revision ? pose.at : 0;
  const points = [];
  for (let i = 0; i < path.xy.length; i += 2) points.push([path.x + path.xy[i], path.y + path.xy[i + 1]]);
  context.lineJoin = context.lineCap = "round";
  const width = Math.min(Math.max(0.05 * view.scale, 1.2), 3);
  const line = (some, colour, wide) => {
    if (some.length < 2) return;
    trace(context, some, false);
    context.lineWidth = wide;
    context.strokeStyle = colour;
    context.stroke();
  };
  if (!model.track) line(points.slice(0, at + 1), colours.driven, width);
  const ahead = points.slice(at + 1);
  if (pose) ahead.unshift([pose.x, pose.y]);
  line(ahead, colours.ahead, width);
}

// The driven track up to the time shown; for a live robot, only the driven part of its path is known.
function drawTrack(context) {
  const track = model.track;
  if (!track) return;
  let [x0, y0] = [NaN, NaN];
  context.beginPath();
  for (let i = 0; i < track.xy.length && track.xy[i + 2] <= model.at; i += 3) {
    const [x, y] = [track.x + track.xy[i], track.y + track.xy[i + 1]];
    context[Math.hypot(x - x0, y - y0) < track.jump ? "lineTo" : "moveTo"](...toScreen(x, y));
    [x0, y0] = [x, y];
  }
  context.lineJoin = context.lineCap = "round";
  context.lineWidth = Math.min(Math.max(0.05 * view.scale, 1.2), 3);
  context.strokeStyle = colours.driven;
  context.stroke();
}

function drawRobot(context) {
  const pose = model.pose;
  if (!pose) return;
  const radius = Math.max(((model.state && model.state.radius_m) || 0.18) * view.scale, 8);
  context.save();
  context.translate(...toScreen(pose.x, pose.y));
  context.rotate(-pose.yaw);
  context.beginPath();
  context.arc(0, 0, radius, 0, 2 * Math.PI);
  context.fillStyle = colours.robot;
  context.strokeStyle = colours.card;
  context.lineWidth = 2;
  context.fill();
  context.stroke();
  context.beginPath();
  context.moveTo(0.7 * radius, 0);
  context.lineTo(-0.45 * radius, 0.5 * radius);
  context.lineTo(-0.2 * radius, 0);
  context.lineTo(-0.45 * radius, -0.5 * radius);
  context.closePath();
  context.fillStyle = colours.card;
  context.fill();
  context.restore();
}

function drawOthers(context) {
  for (const other of model.others) {
    const [px, py] = toScreen(other.x, other.y);
    context.beginPath();
    context.arc(px, py, 8, 0, 2 * Math.PI);
    context.fillStyle = colours.other;
    context.fill();
    drawLabel(context, other.name, px, py - 18, colours.other);
  }
}

function drawHome(context) {
  const home = model.state && model.state.mission && model.state.mission.home;
  if (!home) return;
  const [px, py] = toScreen(...home);
  context.beginPath();
  context.moveTo(px - 8, py);
  context.lineTo(px, py - 8);
  context.lineTo(px + 8, py);
  context.lineTo(px + 5, py);
  context.lineTo(px + 5, py + 7);
  context.lineTo(px - 5, py + 7);
  context.lineTo(px - 5, py);
  context.closePath();
  context.lineWidth = 2;
  context.strokeStyle = colours.card;
  context.stroke();
  context.fillStyle = colours.ink;
  context.fill();
}

function drawScale(context) {
  const most = Math.min(canvas.clientWidth / 4, 140) / view.scale;
  const decade = 10 ** Math.floor(Math.log10(most));
  const metres = [5, 2, 1].map((digit) => digit * decade).find((length) => length <= most) || decade;
  const [x, y, width] = [canvas.clientWidth - 14, canvas.clientHeight - 14, metres * view.scale];
  context.lineWidth = 2;
  context.strokeStyle = colours.ink;
  context.beginPath();
  context.moveTo(x - width, y - 4);
  context.lineTo(x - width, y);
  context.lineTo(x, y);
  context.lineTo(x, y - 4);
  context.stroke();
  drawLabel(context, metres < 1 ? `${Math.round(100 * metres)} cm` : `${metres} m`, x - width / 2, y - 12, colours.ink);
}

// A room shows its own name.
const isRoom = (zone) => foundRooms().some((room) => room.title === zone.name);

function draw() {
  waiting = false;
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  if (view.fitted) fit();
  else if (view.follows && model.pose) [view.x, view.y] = [model.pose.x, model.pose.y];
  document.getElementById("empty").hidden = Boolean(model.map || model.floor);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.fillStyle = colours.map;
  context.fillRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  if (!view.scale) return;
  drawGrid(context, model.map);
  if (showsField) drawGrid(context, model.field);
  else {
    drawRooms(context);
    drawGrid(context, model.floor);
  }
  drawLeft(context, ratio);
  for (const zone of (model.areas && model.areas.zones) || []) drawArea(context, zone.polygon, colours.zone, isRoom(zone) ? "" : zone.name, zone.is === "standing", zone.is === "standing" || isRoom(zone) ? 0.03 : 0.14);
  for (const area of (model.areas && model.areas.keep_out) || []) drawArea(context, area.polygon, colours.keepout, area.name || "", area.is === "standing", area.name && area.name === picked ? 0.4 : 0.14);
  if (!showsField) drawTrack(context);
  if (!showsField) drawPath(context);
  drawRoomNames(context);
  drawHome(context);
  drawDrafts(context);
  drawOthers(context);
  drawRobot(context);
  drawScale(context);
}

function redraw() {
  if (!waiting) {
    waiting = true;
    requestAnimationFrame(draw);
  }
}
