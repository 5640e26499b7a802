// The state of the robot: the newest message of each kind, grids and path unpacked.
const model = {
  state: null, pose: null, areas: null, events: [], others: [], rooms: null, shares: null,
  map: null, floor: null, unswept: null, field: null, path: null, role: "viewer",
  // Of a recording: its description, the whole driven track, and the time shown.
  recording: null, track: null, at: 0,
  // The unswept floor that is shown on the map.
  left: null,
};

async function inflate(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Messages are handled in order: an old map must not replace a newer one.
async function take(data) {
  if (typeof data === "string") {
    const message = JSON.parse(data);
    if (message.kind === "events") model.events = message.entries;
    else if (message.kind === "others") model.others = message.robots;
    else if (["state", "pose", "areas", "recording", "rooms", "shares"].includes(message.kind)) model[message.kind] = message;
    return message;
  }
  const length = new DataView(data).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  const body = await inflate(new Uint8Array(data, 4 + length));
  if (head.kind === "path" || head.kind === "track") {
    head.xy = new Float32Array(body.buffer, 0, body.length >> 2);
  } else {
    head.marks = body;
    head.image = null;
  }
  model[head.kind] = head;
  return head;
}

// The bounds of the known map: [x0, y0, x1, y1] [m]; null without a map.
function knownBounds() {
  const map = model.map || model.floor;
  if (!map) return null;
  if (!map.known) {
    let [r0, r1, c0, c1] = [map.rows, -1, map.cols, -1];
    for (let row = 0; row < map.rows; row++) {
      for (let col = 0; col < map.cols; col++) {
        if (!map.marks[row * map.cols + col]) continue;
        r0 = Math.min(r0, row); r1 = Math.max(r1, row);
        c0 = Math.min(c0, col); c1 = Math.max(c1, col);
      }
    }
    if (r1 < 0) return null;
    const corners = [[c0, r0], [c1 + 1, r0], [c0, r1 + 1], [c1 + 1, r1 + 1]].map(([c, r]) => gridPoint(map, c, r));
    const xs = corners.map((p) => p[0]), ys = corners.map((p) => p[1]);
    map.known = [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
  }
  return map.known;
}

function gridPoint(grid, col, row) {
  const [u, v] = [col * grid.pixel, row * grid.pixel];
  const [cos, sin] = [Math.cos(grid.yaw), Math.sin(grid.yaw)];
  return [grid.x + cos * u - sin * v, grid.y + sin * u + cos * v];
}
