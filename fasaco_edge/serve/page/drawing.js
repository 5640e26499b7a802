// Drawing by hand: areas and keep-outs, by dragging a rectangle or tapping its corners; and the line
// that splits a room.
const drawing = { kind: "", corners: [], from: null, to: null };
const drafts = [];
const TAP_PIXELS = 12, CLOSE_PIXELS = 24;

function beginDrawing(kind) {
  Object.assign(drawing, { kind, corners: [], from: null, to: null });
  if (kind) scrollToMap();
  showDrawing();
}

function beginStroke(at) { drawing.from = drawing.to = at; }
function dropStroke() { drawing.from = drawing.to = null; redraw(); }
function goOnStroke(at) {
  if (!drawing.from) return;
  drawing.to = at;
  redraw();
}

function endStroke(at) {
  const from = drawing.from;
  drawing.from = drawing.to = null;
  if (!from) return;
  if (Math.hypot(at[0] - from[0], at[1] - from[1]) > TAP_PIXELS) {
    if (drawing.kind === "cut") split([toMap(...from), toMap(...at)]);
    else if (!drawing.corners.length) finish(rectangle(from, at));
  } else {
    const first = drawing.corners[0] && toScreen(...drawing.corners[0]);
    const closes = drawing.corners.length >= 3 && Math.hypot(at[0] - first[0], at[1] - first[1]) < CLOSE_PIXELS;
    if (closes) finish(drawing.corners);
    else drawing.corners.push(toMap(...at));
    if (drawing.kind === "cut" && drawing.corners.length === 2) split(drawing.corners);
  }
  showDrawing();
}

const rectangle = ([ax, ay], [bx, by]) => [[ax, ay], [bx, ay], [bx, by], [ax, by]].map((at) => toMap(...at));
const WHAT = { zone: "area", keepout: "keep-out", cut: "line" };
const scrollToMap = () => document.querySelector("main").scrollIntoView({ block: "nearest" });
const rounded = (corners) => corners.map((corner) => corner.map((value) => Math.round(value * 100) / 100));

function finish(corners) {
  const kind = drawing.kind;
  const taken = new Set([...drafts, ...keptOut()].map((area) => area.name));
  const what = WHAT[kind];
  let number = 1;
  while (taken.has(`${what} ${number}`)) number++;
  drawn = { kind, polygon: rounded(corners), name: `${what} ${number}` };
  drafts.push(drawn);
  Object.assign(drawing, { kind: "", corners: [] });
  showDrafts();
}

// What was drawn last: the row below the map offers to use it.
let drawn = null;
document.getElementById("usedrawn").addEventListener("click", () => {
  if (drawn.kind === "keepout") apply(drawn);
  else start(order());
});
document.getElementById("undrawn").addEventListener("click", () => { drawn = null; showBars(); });

// Keep-outs in force. A keep-out with a name is the operator's: a tap on it offers to remove it.
const keptOut = () => (model.areas && model.areas.keep_out) || [];
let picked = "";

function isInside([x, y], polygon) {
  let inside = false;
  polygon.forEach(([ax, ay], i) => {
    const [bx, by] = polygon[(i + 1) % polygon.length];
    if (ay > y !== by > y && x < ax + ((y - ay) / (by - ay)) * (bx - ax)) inside = !inside;
  });
  return inside;
}

function pick(at) {
  const area = keptOut().find((each) => each.name && isInside(toMap(...at), each.polygon));
  drawn = null;
  picked = area && model.role === "operator" ? area.name : "";
  if (picked) scrollToMap();
  showPicked();
  pickRoom(picked ? 0 : roomAt(toMap(...at)));
}

function showPicked() {
  if (!keptOut().some((area) => area.name === picked)) picked = "";
  document.getElementById("pickname").textContent = picked;
  showBars();
}

// The row below the map: drawing, what was drawn, a keep-out, unswept floor, else the tools.
function showBars() {
  drawn = drafts.includes(drawn) ? drawn : null;
  if (drawn) {
    document.getElementById("drawnname").textContent = drawn.name;
    document.getElementById("usedrawn").textContent = drawn.kind === "keepout" ? "Apply now" : document.getElementById("order").textContent;
  }
  const bars = { drawbar: drawing.kind, drawnbar: drawn, pickbar: picked, roombar: pickedRoom, leftbar: model.left, tools: true };
  let taken = false;
  for (const [name, wanted] of Object.entries(bars)) {
    document.getElementById(name).hidden = taken || !wanted;
    taken = taken || Boolean(wanted);
  }
  if (model.left) {
    const byMarks = model.left.marks && !model.recording;
    const why = model.left.places.length || model.left.marks === REST ? "" : byMarks ? "" : " (where is not known)";
    document.getElementById("leftname").textContent = model.left.reason + why;
  }
  redraw();
}

function showDrawing() {
  const count = drawing.corners.length, what = WHAT[drawing.kind];
  const isLine = drawing.kind === "cut";
  const hint = isLine ? "Drag a line across the room, from wall to wall" : `Drag over the ${what}, or tap its corners`;
  const goOn = isLine ? "Tap the other end of the line" : `${count} corner${count > 1 ? "s" : ""} of the ${what}; tap the next`;
  document.getElementById("drawhint").textContent = count ? goOn : hint;
  document.getElementById("drawdone").hidden = count < 3;
  canvas.classList.toggle("draws", Boolean(drawing.kind));
  showBars();
}

function drawDrafts(context) {
  for (const draft of drafts) drawArea(context, draft.polygon, draft.kind === "zone" ? colours.zone : colours.keepout, draft.name, false);
  if (!drawing.kind) return;
  const colour = drawing.kind === "keepout" ? colours.keepout : colours.zone;
  if (drawing.kind === "cut" && drawing.from) {
    trace(context, [toMap(...drawing.from), toMap(...drawing.to)], false);
    context.lineWidth = 3;
    context.strokeStyle = colour;
    context.stroke();
  } else if (drawing.from && Math.hypot(drawing.to[0] - drawing.from[0], drawing.to[1] - drawing.from[1]) > TAP_PIXELS && !drawing.corners.length) {
    drawArea(context, rectangle(drawing.from, drawing.to), colour, "", false);
  }
  if (drawing.corners.length) {
    trace(context, drawing.corners, false);
    context.lineWidth = 2;
    context.strokeStyle = colour;
    context.stroke();
    for (const corner of drawing.corners) {
      context.beginPath();
      context.arc(...toScreen(...corner), 6, 0, 2 * Math.PI);
      context.fillStyle = colour;
      context.fill();
    }
  }
}

document.getElementById("unpick").addEventListener("click", () => { picked = ""; showPicked(); });
document.getElementById("draw-zone").addEventListener("click", () => beginDrawing("zone"));
document.getElementById("draw-keepout").addEventListener("click", () => beginDrawing("keepout"));
document.getElementById("drawdone").addEventListener("click", () => { finish(drawing.corners); showDrawing(); });
document.getElementById("drawstop").addEventListener("click", () => beginDrawing(""));
