// The panel: state, progress, commands and events as text, never as HTML.
const find = (id) => document.getElementById(id);

function item(...parts) {
  const line = document.createElement("li");
  for (const part of parts) {
    if (typeof part === "string") line.append(part);
    else {
      const node = document.createElement(part[0]);
      node.className = part[1];
      node.textContent = part[2];
      line.append(node);
    }
  }
  return line;
}

const percent = (share) => `${Math.floor(Math.min(share, 1) * 100)} %`;
const squares = (m2) => `${m2 < 100 ? m2.toFixed(1) : Math.round(m2)} m²`;

function duration(seconds) {
  if (seconds < 60) return `${Math.round(seconds)} s`;
  const minutes = Math.round(seconds / 60);
  return minutes < 120 ? `${minutes} min` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

// What the figures refer to: all that is ordered, or a part of it.
function partOf({ mission }) {
  const places = mission.zone ? [mission.zone] : mission.zones.map((zone) => zone.name);
  const what = places.every((name) => foundRooms().some((room) => room.title === name)) ? "room" : "area";
  return { pass: "in this pass", place: `in this ${what}`, places: `in these ${what}s` }[mission.part];
}

// The time of day at which the robot will be done.
function ends(state) {
  if (state.mission.more) return `to go ${partOf(state)}`;
  if (state.to_go_s === null || state.to_go_s < 60 || state.state === "paused" || model.recording || !(state.time_scale > 0)) return state.grows ? "to go at least" : "to go";
  const end = new Date(Date.now() + (1000 * state.to_go_s) / state.time_scale);
  // The remaining time is too short while the robot still discovers rooms.
  return `${state.grows ? "not before" : "done at"} ${end.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", hour12: false })}`;
}

// Without a connection, the last message of the server is old.
function showAbsent() {
  const { absent, others } = model.state || { absent: "", others: [] };
  const named = absent.includes("No robot named") && others.length ? ` There are: ${others.join(", ")}.` : "";
  find("absent").textContent = isLinked() ? absent + named : "No connection; trying again";
  find("absent").hidden = !find("absent").textContent;
}

function showState() {
  const state = model.state;
  find("robot").textContent = state.robot;
  document.title = `${state.robot} · ${state.word || "waiting"}`;
  showAbsent();
  find("progress").hidden = !state.state;
  if (!state.state) {
    find("state").textContent = "waiting";
    find("state").className = "chip";
    showList("technical", state.bus ? [item(`waits for the bus at ${state.bus}`)] : []);
    return;
  }
  find("state").textContent = state.word;
  find("state").className = `chip ${state.look}`;
  find("does").textContent = state.does;
  showList("needs", state.needs.map((text) => item(text)));
  showProgress(state);
  showBattery(state.battery);
  showLeft(state);
  find("fleet").hidden = !state.fleet;
  showList("robots", (state.fleet || []).map((member) => item(["b", "", `${member.name} `], member.does)));
  showTechnical(state);
  showCommands();
}

// Details in an engineer's words, opened by a tap.
function showTechnical(state) {
  const away = (state.fleet || []).filter((member) => member.away).map((member) => `${member.name} is away: ${member.away}`);
  const bus = state.bus ? [`waits for the bus at ${state.bus}`] : [];
  const lines = [`${state.state}: ${state.reason || "no reason"}`, ...bus, ...state.faults, ...away];
  showList("technical", lines.map((text) => item(text)));
  find("foot").textContent = [`fasaco-edge ${state.version}`, state.simulated].filter(Boolean).join(", ");
}

// Unswept floor: a tap on a line shows it on the map; the list opens by itself at the end.
let wasOver = null;
function showLeft(state) {
  const parts = state.left, isOver = ["over", null].includes(state.mission.stage);
  find("left").hidden = !parts.length;
  find("left-what").textContent = isOver ? "Not swept" : "Left out so far";
  const isKnown = parts.every((part) => part.m2 !== null);
  find("left-m2").textContent = isKnown ? `: ${squares(parts.reduce((sum, part) => sum + part.m2, 0))}` : "";
  find("left").querySelector("ul").replaceChildren(...parts.map((part) => {
    const line = item(["span", "m2", part.m2 === null ? "" : squares(part.m2)], part.reason);
    // A recording has no places of unswept floor, except of areas with a point.
    if (model.recording && !part.places.length) return line;
    const show = action("", () => showOnMap(part));
    show.append(...line.childNodes);
    line.append(show);
    return line;
  }));
  find("left-hint").hidden = !find("left").querySelector("button");
  // Before the first order there is no end.
  if (isOver && !wasOver && (state.mission.stage || wasOver === false)) find("left").open = true;
  wasOver = isOver;
  const shown = model.left && parts.find((part) => part.reason === model.left.reason);
  if (model.left) { model.left = shown || null; showBars(); if (!shown) wants(); }
}

function showOnMap(part) {
  model.left = part;
  picked = "";
  Object.assign(view, { fitted: true, follows: false });
  showTools();
  showBars();
  wants();
  scrollToMap();
}
find("unleft").addEventListener("click", () => { model.left = null; showBars(); wants(); });

function showProgress(state) {
  const floor = state.floor, knows = floor && floor.reachable_m2;
  const share = knows ? floor.reached_m2 / floor.reachable_m2 : state.cells;
  find("share").textContent = share === null || share === undefined ? "–" : percent(share);
  find("area").textContent = floor ? squares(knows ? floor.reached_m2 : floor.swept_m2) : "–";
  find("share-of").textContent = partOf(state) || "of the floor in reach";
  find("area-of").textContent = knows ? `of ${squares(floor.reachable_m2)}` : "swept";
  find("togo").textContent = duration(state.to_go_s || 0);
  find("togo").parentElement.hidden = state.to_go_s === null;
  find("togo-of").textContent = state.state === "returning" ? "to get there" : ends(state);
  find("bar").style.width = `${100 * Math.min(share || 0, 1)}%`;
  find("bar").parentElement.setAttribute("aria-valuenow", Math.round(100 * (share || 0)));
  const lines = state.mission.zones.map((zone) => {
    const pass = zone.passes > 1 ? `, pass ${zone.pass} of ${zone.passes}` : "";
    // The figures above refer to the current one.
    const share = zone.name === state.mission.zone ? "now" : zone.share === null ? "–" : percent(zone.share);
    return item(["span", "", zone.name], ["span", "quiet", zone.pass ? `${share}${pass}` : "to come"]);
  });
  if (!lines.length && state.mission.passes > 1) lines.push(item(["span", "", "everything"], ["span", "quiet", `pass ${state.mission.pass} of ${state.mission.passes}`]));
  for (const name of state.mission.left_out) lines.push(item(["span", "", name], ["span", "quiet", "left out"]));
  if (state.mission.time_left_s !== null) lines.push(item(["span", "", "home in"], ["span", "quiet", duration(state.mission.time_left_s)]));
  find("zones").replaceChildren(...lines);
}

function showBattery(battery) {
  find("battery").hidden = !battery || battery.level === null;
  if (battery && battery.level !== null) find("battery").textContent = `${battery.power === "charging" ? "⚡ " : ""}${percent(battery.level)}`;
}

function showList(id, lines) {
  find(id).hidden = !lines.length;
  find(id).replaceChildren(...lines);
}

function showEvents() {
  const clock = (at) => new Date(1000 * at).toLocaleTimeString([], { hour12: false });
  find("lately").replaceChildren(
    ...model.events.map((entry) => item(["time", "", clock(entry.at_s)], ["span", entry.tone, entry.text])),
  );
}

// Commands: shown if they are allowed and have an effect.
function showCommands() {
  find("commands").hidden = model.role !== "operator";
  const state = model.state || {}, mission = state.mission || {};
  const underway = mission.ordered !== null && mission.stage !== "over" && mission.ordered !== undefined;
  const chose = drafts.length > 0 || chosen.size > 0;
  find("start").hidden = underway || mission.paused || chose;
  const again = state.state ? lastOrder(state) : null;
  find("again").hidden = !again || underway || mission.paused || chose;
  find("chose").hidden = !chose || underway || mission.paused;
  find("chose").textContent = `You chose or drew ${[...[...chosen].map(titleOf), ...drafts.map((draft) => draft.name)].join(", ")}: start or apply it below, or take it out. Then Start is here again.`;
  if (again) find("again").textContent = `Last order again: ${inWords(again)}`;
  find("order").textContent = chose && underway ? "Start anew with these" : chose ? "Start with these" : underway ? "Start anew with everything" : "Start with everything";
  find("pause").hidden = Boolean(mission.paused) || !underway;
  find("resume").hidden = !mission.paused;
  find("cancel").hidden = !underway;
  find("home").disabled = !state.state || state.state === "returning";
}

function showDrafts() {
  const standing = ((model.areas && model.areas.zones) || []).filter((zone) => zone.is === "standing");
  const lines = standing.map((zone) => {
    const line = item(["i", "", ""]), label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.checked = chosen.has(zone.name);
    box.addEventListener("change", () => { choose(zone.name); });
    label.className = "row name";
    label.append(box, zone.name);
    line.append(label);
    return line;
  });
  for (const area of keptOut().filter((each) => each.name)) {
    lines.push(draftLine("out", namedSpan(`${area.name}, in force`), action("Remove", (event) => isSure(event.target) && drop(area.name))));
  }
  drafts.forEach((draft, index) => {
    const name = document.createElement("input"), isZone = draft.kind === "zone";
    name.className = "name";
    name.value = draft.name;
    name.maxLength = 64;
    name.setAttribute("aria-label", isZone ? "name of the area" : "name of the keep-out");
    name.addEventListener("input", () => { draft.name = name.value; keepDrafts(); showBars(); });
    const remove = action("Remove", () => { drafts.splice(index, 1); showDrafts(); redraw(); });
    const now = isZone ? [] : [action("Apply now", () => apply(draft), "primary")];
    lines.push(draftLine(isZone ? "" : "out", name, ...now, remove));
  });
  find("drafts").replaceChildren(...lines);
  keepDrafts();
  showCommands();
  showBars();
}

// Areas drawn and rooms chosen, but not ordered yet, survive a reload of the page.
function keepDrafts() {
  const kept = { drafts, chosen: [...chosen], passes: find("passes").value, cross: find("cross").checked, home: find("return").checked };
  try { sessionStorage.setItem("drafts", JSON.stringify(kept)); } catch (error) { /* a browser that keeps nothing */ }
}

function takeUpDrafts() {
  try {
    const kept = JSON.parse(sessionStorage.getItem("drafts"));
    if (!kept) return;
    drafts.push(...kept.drafts);
    kept.chosen.forEach((name) => chosen.add(name));
    find("passes").value = kept.passes;
    find("cross").checked = kept.cross;
    find("return").checked = kept.home;
    find("plan").open = drafts.length > 0 || chosen.size > 0;
  } catch (error) { /* nothing was kept */ }
}
for (const name of ["passes", "return"]) find(name).addEventListener("change", keepDrafts);

function draftLine(kind, ...parts) {
  const line = item(["i", kind, ""]);
  line.append(...parts);
  return line;
}

function namedSpan(text) {
  const span = document.createElement("span");
  span.className = "name";
  span.textContent = text;
  return span;
}

function action(text, act, look = "") {
  const button = document.createElement("button");
  button.textContent = text;
  button.className = look;
  button.addEventListener("click", act);
  return button;
}

// An irreversible command asks for a second click.
let sure = null;
for (const name of ["pause", "resume", "home", "cancel"]) {
  find(name).addEventListener("click", () => {
    if (name !== "cancel" || isSure(find(name))) command(name);
  });
}

function isSure(button) {
  const again = sure === button;
  calm();
  if (again) return true;
  sure = button;
  button.dataset.text = button.textContent;
  button.textContent = "Tap again";
  button.classList.add("sure");
  setTimeout(() => sure === button && calm(), 4000);
  return false;
}

function calm() {
  if (sure) {
    sure.textContent = sure.dataset.text;
    sure.classList.remove("sure");
  }
  sure = null;
}

// Keep-outs: the current order continues with them.
function apply(draft) {
  command("keep_out_add", { keep_out: { name: draft.name.trim(), polygon: draft.polygon } }, {
    taken: () => { drafts.splice(drafts.indexOf(draft), 1); showDrafts(); redraw(); },
  });
}

function drop(name) {
  picked = "";
  showPicked();
  command("keep_out_remove", { keep_out: { name } });
}
find("unkeep").addEventListener("click", () => drop(picked));

// An answer is shown over the page for a while; a tap shows the engineer's words for it.
const SAID_MS = 8000, WHY_MS = 30000;
let forgetting = 0;
function say(text, tone, why = "") {
  clearTimeout(forgetting);
  find("answer").textContent = why ? "" : text;
  find("answer").className = tone;
  if (why) {
    const details = document.createElement("details"), summary = document.createElement("summary");
    summary.textContent = text;
    details.append(summary, why);
    find("answer").append(details);
  }
  forgetting = setTimeout(() => say("", ""), why ? WHY_MS : SAID_MS);
}
find("answer").addEventListener("click", (event) => event.target.closest("details") || say("", ""));

const TAKEN = {
  start: "It begins.", pause: "It stops.", resume: "It goes on.", home: "It comes home.", cancel: "It has ended.",
  room_name: "It knows the room by that name.", room_set: "It will do so.",
  room_split: "These are two rooms now.", room_merge: "These are one room now.",
  keep_out_add: "It stays out of there.", keep_out_remove: "It may go there again.",
};
const REFUSED = { not_now: "That is not possible now.", bad_order: "It cannot do it like that." };
function showAnswer(answer) {
  const then = awaited.get(answer.id) || {};
  awaited.delete(answer.id);
  if (answer.ok) say([then.said || TAKEN[then.name] || "", answer.needs].filter(Boolean).join(" "), answer.needs ? "" : "good");
  // Faults about a room are worded for the owner, who can correct them.
  else if (answer.code === "bad_order" && then.name.startsWith("room_")) say(roomFault(answer), "bad");
  else say(REFUSED[answer.code] || "That did not work.", "bad", answer.hint ? `${answer.text} (${answer.hint})` : answer.text);
  const next = answer.ok ? then.taken : then.refused;
  if (next) next(answer);
}

find("trail").addEventListener("click", () => {
  showsField = !showsField;
  find("trail").setAttribute("aria-pressed", showsField);
  find("trail").textContent = showsField ? "Hide the pheromone trail" : "Show the pheromone trail";
  find("legend").hidden = showsField;
  find("legend-trail").hidden = !showsField;
  wants();
  redraw();
});
