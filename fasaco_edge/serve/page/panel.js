// The panel: state, progress, commands and events, in words. Text is only ever set as text.
const find = (id) => document.getElementById(id);
const LOOKS = { covering: "go", returning: "go", planning: "go", charging: "go", done: "go", blocked: "bad", degraded: "bad", paused: "wait" };
const WORDS = { covering: "sweeping", returning: "driving home", degraded: "in trouble" };

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

function showState() {
  const state = model.state;
  find("robot").textContent = state.robot;
  document.title = `${state.robot} · ${state.state || "waiting"}`;
  find("absent").hidden = !state.absent;
  const others = state.others.length ? `; on this bus: ${state.others.join(", ")}` : "";
  find("absent").textContent = state.absent && state.absent + (state.absent.includes("of the name") ? others : "");
  find("progress").hidden = !state.state;
  if (!state.state) {
    find("state").textContent = "waiting";
    find("state").className = "chip";
    return;
  }
  find("state").textContent = WORDS[state.state] || state.state;
  find("state").className = `chip ${state.in_trouble ? "bad" : LOOKS[state.state] || ""}`;
  find("reason").textContent = state.reason;
  showProgress(state);
  showBattery(state.battery);
  showList("faults", state.faults.map((text) => item(text)));
  const floor = state.floor || { left: [], out_of_reach: [] };
  showList("left", [
    ...state.unreached.map((area) => item(["span", "m2", squares(area.m2)], `${area.reason}, at ${area.x.toFixed(1)}, ${area.y.toFixed(1)}`)),
    ...floor.left.map((part) => item(["span", "m2", squares(part.m2)], part.reason)),
    ...floor.out_of_reach.map((part) => item(["span", "m2", squares(part.m2)], `out of reach: ${part.reason}`)),
  ]);
  showList("fleet", (state.fleet || []).map((member) => item(["b", "", `${member.name} `], member.away ? `away: ${member.away}` : member.state)));
  find("foot").textContent = `fasaco-edge ${state.version}`;
  showCommands();
}

function showProgress(state) {
  const floor = state.floor, knows = floor && floor.reachable_m2;
  const share = knows ? floor.reached_m2 / floor.reachable_m2 : state.cells;
  find("share").textContent = share === null || share === undefined ? "–" : percent(share);
  find("share-of").textContent = state.mission.zone ? "of this room" : knows ? "of the floor in reach" : "of the cells in reach";
  find("area").textContent = floor ? squares(knows ? floor.reached_m2 : floor.swept_m2) : "–";
  find("area-of").textContent = knows ? `of ${squares(floor.reachable_m2)}` : "swept";
  find("togo").textContent = state.to_go_s === null ? "–" : duration(state.to_go_s);
  find("bar").style.width = `${100 * Math.min(share || 0, 1)}%`;
  find("bar").parentElement.setAttribute("aria-valuenow", Math.round(100 * (share || 0)));
  const lines = state.mission.zones.map((zone) => {
    const pass = zone.passes > 1 ? `, pass ${zone.pass} of ${zone.passes}` : "";
    return item(["span", "", zone.name], ["span", "quiet", zone.pass ? `${percent(zone.share)}${pass}` : "to come"]);
  });
  if (!lines.length && state.mission.passes > 1) lines.push(item(["span", "", "everything"], ["span", "quiet", `pass ${state.mission.pass} of ${state.mission.passes}`]));
  find("zones").replaceChildren(...lines);
}

function showBattery(battery) {
  find("battery").hidden = !battery || battery.level === null;
  if (battery && battery.level !== null) find("battery").textContent = `${battery.power === "charging" ? "⚡ " : ""}${percent(battery.level)}`;
}

function showList(id, lines) {
  find(id).hidden = !lines.length;
  find(id).querySelector("ul").replaceChildren(...lines);
}

function showEvents() {
  const clock = (at) => new Date(1000 * at).toLocaleTimeString([], { hour12: false });
  find("lately").querySelector("ol").replaceChildren(
    ...model.events.map((entry) => item(["time", "", clock(entry.at_s)], ["span", entry.tone, entry.text])),
  );
}

// Commands: shown where they are allowed, and make sense.
function showCommands() {
  find("commands").hidden = model.role !== "operator";
  const state = model.state || {}, mission = state.mission || {};
  const underway = mission.ordered !== null && mission.stage !== "over" && mission.ordered !== undefined;
  const chose = drafts.length > 0 || chosen.size > 0;
  find("start").hidden = underway || mission.paused || chose;
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
    box.addEventListener("change", () => { (box.checked ? chosen.add(zone.name) : chosen.delete(zone.name)); showCommands(); });
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
    name.setAttribute("aria-label", isZone ? "name of the room" : "name of the keep-out");
    name.addEventListener("input", () => { draft.name = name.value; redraw(); });
    const remove = action("Remove", () => { drafts.splice(index, 1); showDrafts(); redraw(); });
    const now = isZone ? [] : [action("Apply now", () => apply(draft), "primary")];
    lines.push(draftLine(isZone ? "" : "out", name, ...now, remove));
  });
  find("drafts").replaceChildren(...lines);
  showCommands();
}

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

const chosen = new Set();

function order() {
  const zones = [
    ...[...chosen].map((name) => ({ name })),
    ...drafts.filter((draft) => draft.kind === "zone").map(({ name, polygon }) => ({ name: name.trim(), polygon })),
  ];
  return {
    zones,
    keep_out: drafts.filter((draft) => draft.kind === "keepout").map((draft) => draft.polygon),
    passes: Math.round(Number(find("passes").value)) || 1,
    return_home: find("return").checked,
  };
}

// An irreversible command asks for a second click.
let sure = null;
find("order").addEventListener("click", () => find("start").click());
find("start").addEventListener("click", () => start(order()));
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

// A start that would forget what is covered is refused: the page then asks what to do.
let refused = null;
function start(what, discard = false) {
  command("start", { order: what, discard }, {
    taken: () => { drafts.length = 0; chosen.clear(); showDrafts(); redraw(); },
    refused: (answer) => {
      if (answer.code !== "would_forget") return;
      refused = what;
      find("losstext").textContent = `${answer.text[0].toUpperCase()}${answer.text.slice(1)}.`;
      say("", "");
      find("loss").showModal();
    },
  });
}
find("loss").addEventListener("close", () => {
  const choice = find("loss").returnValue;
  find("loss").returnValue = "";
  if (choice === "forget") start(refused, true);
  if (choice === "keep") start({ ...refused, keep_covered: true });
});

// Keep-outs: the order under way goes on with them.
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

function say(text, tone) {
  find("answer").textContent = text;
  find("answer").className = tone;
}

function showAnswer(answer) {
  const then = awaited.get(answer.id) || {};
  awaited.delete(answer.id);
  say(answer.hint ? `${answer.text} (${answer.hint})` : answer.text, answer.ok ? "good" : "bad");
  const next = answer.ok ? then.taken : then.refused;
  if (next) next(answer);
}

find("trail").addEventListener("click", () => {
  showsField = !showsField;
  find("trail").setAttribute("aria-pressed", showsField);
  find("legend").hidden = showsField;
  find("legend-trail").hidden = !showsField;
  wants();
  redraw();
});
