// The view: the part of the map frame that the canvas shows; moved by finger, mouse and wheel.
const canvas = document.getElementById("map");
const view = { x: 0, y: 0, scale: 0, fitted: true, follows: false };

// The scale is in pixels of the screen per metre; y grows upwards on the map, downwards on the screen.
const toScreen = (x, y) => [
  canvas.clientWidth / 2 + (x - view.x) * view.scale,
  canvas.clientHeight / 2 - (y - view.y) * view.scale,
];
const toMap = (px, py) => [
  view.x + (px - canvas.clientWidth / 2) / view.scale,
  view.y - (py - canvas.clientHeight / 2) / view.scale,
];

function fit() {
  const bounds = knownBounds();
  if (!bounds || !canvas.clientWidth) return;
  const [x0, y0, x1, y1] = bounds;
  const room = [canvas.clientWidth - 24, canvas.clientHeight - 52];
  view.scale = Math.max(Math.min(room[0] / (x1 - x0), room[1] / (y1 - y0)), 0.01);
  view.x = (x0 + x1) / 2;
  view.y = (y0 + y1) / 2 - 14 / view.scale;  // below it is the scale
  if (view.follows && model.pose) [view.x, view.y] = [model.pose.x, model.pose.y];
}

function zoom(factor, px, py) {
  if (!view.scale) return;
  const [x, y] = toMap(px, py);
  view.scale = Math.min(Math.max(view.scale * factor, 0.05), 2000);
  const [nx, ny] = toMap(px, py);
  view.x += x - nx;
  view.y += y - ny;
  view.fitted = false;
  redraw();
}

function moveBy(dx, dy) {
  if (!view.scale) return;
  view.x -= dx / view.scale;
  view.y += dy / view.scale;
  view.fitted = view.follows = false;
  showTools();
  redraw();
}

// Fingers and mouse: one pointer moves or draws, two zoom.
const fingers = new Map();
let tapped = null;
const place = (event) => {
  const box = canvas.getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
};

canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, place(event));
  tapped = fingers.size === 1 && !drawing.kind ? place(event) : null;
  if (fingers.size === 1 && drawing.kind) beginStroke(place(event));
  if (fingers.size === 2) dropStroke();
});
canvas.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const now = place(event);
  if (fingers.size === 1) {
    if (drawing.kind) goOnStroke(now);
    else moveBy(now[0] - before[0], now[1] - before[1]);
  } else {
    const [other] = [...fingers.entries()].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
    const apart = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]);
    moveBy((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    zoom(Math.max(apart(now), 8) / Math.max(apart(before), 8), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
  }
  fingers.set(event.pointerId, now);
});
for (const name of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(name, (event) => {
    const at = place(event);
    if (fingers.size === 1 && drawing.kind && name === "pointerup") endStroke(at);
    if (tapped && name === "pointerup" && Math.hypot(at[0] - tapped[0], at[1] - tapped[1]) < TAP_PIXELS) pick(at);
    tapped = null;
    fingers.delete(event.pointerId);
  });
}
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(-event.deltaY / 400), ...place(event));
}, { passive: false });

function showTools() {
  document.getElementById("follow").setAttribute("aria-pressed", view.follows);
}
document.getElementById("fit").addEventListener("click", () => {
  Object.assign(view, { fitted: true, follows: false });
  showTools();
  redraw();
});
document.getElementById("follow").addEventListener("click", () => {
  view.follows = !view.follows;
  if (view.follows && view.fitted) { view.fitted = false; view.scale *= 2; }
  showTools();
  redraw();
});
new ResizeObserver(() => redraw()).observe(canvas);
