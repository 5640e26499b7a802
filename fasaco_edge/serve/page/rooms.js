// Rooms that the robot has found: tints, names, settings; choosing, splitting and merging them.
let pickedRoom = 0;
const foundRooms = () => (model.rooms && model.rooms.rooms) || [];
const roomOf = (id) => foundRooms().find((room) => room.id === id);
const titleOf = (key) => (typeof key === "number" ? (roomOf(key) || { title: `room ${key}` }).title : key);
const shareOf = (room) => (model.shares ? model.shares.swept[room.id] : null);
// A room is ordered by number, as a configured zone may have its name.
const zoneOf = (key) => (typeof key === "number" ? { name: titleOf(key), room: key } : { name: key });

const hasShare = (room) => Number.isFinite(shareOf(room));
const figuresOf = (room) =>
  [squares(room.m2), hasShare(room) && `${percent(shareOf(room))} swept`, room.skip && "left out"].filter(Boolean).join(", ");

// The place of a room among the chosen ones, from 1; 0 if it is not chosen.
const turnOf = (id) => [...chosen].indexOf(id) + 1;

// The map. A tint darkens light pixels, or lightens dark ones, so that walls stay visible.
function drawRooms(context) {
  context.save();
  context.globalCompositeOperation = dark.matches ? "lighten" : "multiply";
  for (const room of foundRooms()) {
    trace(context, room.outline, true);
    // Rooms enclosed by a ring of corridors are not part of it.
    for (const inner of room.encloses.map(roomOf).filter(Boolean)) trace(context, inner.outline, true, false);
    context.fillStyle = colours[`room${room.tint}`];
    context.fill("evenodd");
  }
  context.restore();
}

function drawRoomNames(context) {
  for (const room of foundRooms()) {
    const isPicked = room.id === pickedRoom, turn = turnOf(room.id);
    trace(context, room.outline, true);
    context.lineWidth = isPicked ? 4 : turn ? 2.5 : 1;
    context.strokeStyle = isPicked || turn ? colours.accent : colours.faint;
    context.stroke();
  }
  for (const room of foundRooms()) {
    const isPicked = room.id === pickedRoom, turn = turnOf(room.id);
    if (!room.label) continue;
    const [x, y, wide] = room.label, [px, py] = toScreen(x, y);
    const mark = turn ? `${turn}. ` : "", most = isPicked ? Infinity : 1.3 * wide * view.scale;
    // A room without a name shows its number.
    const text = (!room.name && whole(context, mark + room.title, most)) || fitting(context, mark + (room.name || room.id), most);
    if (!text) continue;
    const below = room.skip ? "left out" : hasShare(room) ? percent(shareOf(room)) : "";
    drawLabel(context, text, px, below ? py - 8 : py, isPicked || turn ? colours.accent : colours.ink);
    if (below) drawLabel(context, below, px, py + 8, colours.faint);
  }
}

function whole(context, text, wide) {
  context.font = LABEL_FONT;
  return context.measureText(text).width <= wide ? text : "";
}

// The part of a name that fits into a room; "" if it is too short.
function fitting(context, text, wide) {
  if (whole(context, text, wide)) return text;
  for (let most = text.length - 1; most >= 3; most--) {
    const cut = `${text.slice(0, most)}…`;
    if (whole(context, cut, wide)) return cut;
  }
  return "";
}

function roomAt(at) {
  const there = foundRooms().filter((room) => isInside(at, room.outline));
  const inner = there.find((room) => !there.some((other) => room.encloses.includes(other.id)));
  return inner ? inner.id : 0;
}

// The card of the tapped room.
function pickRoom(id) {
  // A typed number belongs to the room picked until now: a field that loses focus sends its change.
  if (find("room").contains(document.activeElement)) document.activeElement.blur();
  pickedRoom = id;
  showRooms();
}

function showRooms() {
  if (model.state && model.state.state) showProgress(model.state);
  const room = roomOf(pickedRoom);
  if (!room) pickedRoom = 0;
  const mayCommand = model.role === "operator";
  find("room").hidden = !room || !mayCommand;
  find("chooseroom").hidden = !mayCommand;
  if (room) showRoom(room);
  showRoomList();
  showShares();
  showBars();
  showCommands();
}

function showRoom(room) {
  const isChosen = chosen.has(room.id), others = room.neighbours.map(roomOf).filter(Boolean);
  find("roomtitle").textContent = room.title;
  find("chooseroom").textContent = isChosen ? "Take out" : "Add";
  if (document.activeElement !== find("roomname")) find("roomname").value = room.name;
  find("roomname").placeholder = room.title;
  showPasses(room.passes);
  find("roomskip").checked = room.skip;
  if (document.activeElement !== find("roompriority")) find("roompriority").value = room.priority;
  find("roomnow").textContent = `Sweep ${room.title} now`;
  find("turns").textContent = chosen.size ? "" : "Several rooms? Add them below the map, one after the other.";
  find("roomnow").hidden = isChosen;
  find("roomnow").classList.toggle("primary", !chosen.size);
  find("roomsnow").hidden = !chosen.size;
  find("roomsnow").textContent = `Sweep ${[...chosen].map(titleOf).join(", then ")}`;
  find("mergerow").hidden = !others.length;
  const before = find("mergewith").value;
  find("mergewith").replaceChildren(...others.map((other) => new Option(other.title, other.id)));
  if (others.some((other) => String(other.id) === before)) find("mergewith").value = before;
}

function showPasses(passes) {
  const list = Array.isArray(passes) ? passes : [], isCross = list.length > 1 && list[0] === "auto" && list.slice(1).every((pass) => pass === "cross");
  if (document.activeElement !== find("roompasses")) find("roompasses").value = list.length || passes || 1;
  find("roomcross").checked = isCross;
  const words = list.map((pass) => (typeof pass === "string" ? pass : JSON.stringify(pass)));
  find("roomspecial").textContent = list.length && !isCross ? `Set by service: ${words.join(", ")}` : "";
}

function showShares() {
  for (const room of foundRooms()) {
    const line = find(`room-${room.id}`);
    if (line) line.textContent = figuresOf(room);
    if (room.id === pickedRoom) find("roomfigures").textContent = figuresOf(room);
  }
  redraw();
}

function showRoomList() {
  showList("rooms", foundRooms().map((room) => {
    const line = item(["i", `room${room.tint}`, ""]), label = document.createElement("label"), box = document.createElement("input");
    const figures = document.createElement("small"), turn = turnOf(room.id);
    figures.id = `room-${room.id}`;
    [box.type, box.checked] = ["checkbox", turn > 0];
    box.addEventListener("change", () => choose(room.id));
    label.className = "row name";
    const name = namedSpan(`${turn ? `${turn}. ` : ""}${room.title}`);
    name.append(figures);
    label.append(box, name);
    line.append(label, action("Show", () => { pickRoom(room.id); scrollToMap(); }));
    return line;
  }));
}

function choose(key) {
  if (!chosen.delete(key)) chosen.add(key);
  find("plan").open = true;
  keepDrafts();
  showRooms();
}

// The passes of orders and rooms as text: their number, or the kind of each.
function passesIn(count, cross) {
  const number = Math.round(Number(find(count).value)) || 0;
  return find(cross).checked && number > 1 ? ["auto", ...Array(Math.min(number, 100) - 1).fill("cross")] : number || undefined;
}

function twiceAtLeast(count, cross) {
  if (find(cross).checked && !(Number(find(count).value) > 1)) find(count).value = 2;
}

// The hint comes first, then the fault in brackets.
function roomFault(answer) {
  const what = answer.text.replace(/^room\.\w+: /, "").replace(/ m2\b/g, " m²");
  return answer.hint ? `${answer.hint[0].toUpperCase()}${answer.hint.slice(1)} (${what}).` : what;
}

const change = (name, members, then) => command(name, { room: { id: pickedRoom, ...members } }, then);
const setPasses = () => change("room_set", { passes: passesIn("roompasses", "roomcross") || 1 });
const rename = () => {
  const name = find("roomname").value.trim();
  change("room_name", { name }, name ? {} : { said: "It has no name any more." });
  find("roomname").blur();
};

find("unroom").addEventListener("click", () => pickRoom(0));
find("chooseroom").addEventListener("click", () => choose(pickedRoom));
find("roomnow").addEventListener("click", () => start({ zones: [zoneOf(pickedRoom)], return_home: find("return").checked }));
find("roomsnow").addEventListener("click", () => find("start").click());
find("rename").addEventListener("click", rename);
find("roomname").addEventListener("keydown", (event) => event.key === "Enter" && rename());
find("roompasses").addEventListener("change", setPasses);
find("roomcross").addEventListener("change", () => { twiceAtLeast("roompasses", "roomcross"); setPasses(); });
find("cross").addEventListener("change", () => { twiceAtLeast("passes", "cross"); keepDrafts(); });
find("roomskip").addEventListener("change", () => change("room_set", { skip: find("roomskip").checked }));
find("roompriority").addEventListener("change", ({ target }) => target.value && change("room_set", { priority: Math.round(target.value) }));
find("merge").addEventListener("click", (event) => {
  const both = [pickedRoom, Number(find("mergewith").value)];
  if (!isSure(event.target)) return;
  // The merged room keeps the smaller number.
  const taken = () => { chosen.delete(Math.max(...both)); pickRoom(Math.min(...both)); };
  change("room_merge", { others: [both[1]] }, { taken });
});
find("split").addEventListener("click", () => beginDrawing("cut"));

// A line that ends in the room is extended to its walls, and into them.
const INTO_WALL_M = 0.3;
function toWalls([from, to], outline) {
  const length = Math.hypot(to[0] - from[0], to[1] - from[1]) || 1;
  const along = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
  const crossings = outline.flatMap(([ax, ay], i) => {
    const [bx, by] = outline[(i + 1) % outline.length];
    const det = along[0] * (by - ay) - along[1] * (bx - ax);
    if (!det) return [];
    const on = (along[0] * (from[1] - ay) - along[1] * (from[0] - ax)) / det;
    return on >= 0 && on < 1 ? [((ax - from[0]) * (by - ay) - (ay - from[1]) * (bx - ax)) / det] : [];
  });
  const before = crossings.filter((way) => way < 0), behind = crossings.filter((way) => way > length);
  const [start, end] = [
    isInside(from, outline) && before.length ? Math.max(...before) - INTO_WALL_M : 0,
    isInside(to, outline) && behind.length ? Math.min(...behind) + INTO_WALL_M : length,
  ];
  return [start, end].map((way) => [from[0] + way * along[0], from[1] + way * along[1]]);
}

function split(ends) {
  const room = roomOf(pickedRoom);
  if (room) change("room_split", { cut: rounded(toWalls(ends, room.outline)) });
  beginDrawing("");
}
