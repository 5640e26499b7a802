// Orders: from what is drawn and chosen, the repeated last order, and what a start would forget.
const chosen = new Set();

function order() {
  const zones = [
    ...[...chosen].map(zoneOf),
    ...drafts.filter((draft) => draft.kind === "zone").map(({ name, polygon }) => ({ name: name.trim(), polygon })),
  ];
  return {
    zones,
    keep_out: drafts.filter((draft) => draft.kind === "keepout").map((draft) => draft.polygon),
    passes: passesIn("passes", "cross"),
    return_home: find("return").checked,
  };
}

// The last order is kept from its beginning on, so that it can be repeated after its end, also after
// a restart of the server.
function lastOrder(state) {
  const key = `last order of ${state.robot}`;
  try {
    if (state.again) localStorage.setItem(key, JSON.stringify(state.again));
    const kept = JSON.parse(localStorage.getItem(key));
    return kept && kept.zones ? kept : null;
  } catch (error) { return state.again && state.again.zones ? state.again : null; }
}

function inWords(order) {
  const names = order.zones.map((zone) => zone.name).join(", ") || "everything";
  return names + (often(order.passes) > 1 ? `, ${often(order.passes)} times` : "");
}

// Whether the robot is at work on an equal order, which a start would continue.
const often = (passes) => (Array.isArray(passes) ? passes.length : passes) || 1;
function goesOn(what) {
  const mission = (model.state || {}).mission || {}, zones = what.zones || [], areas = model.areas || { zones: [], keep_out: [] };
  const keptOut = areas.keep_out.filter((area) => area.is === "order").map((area) => area.polygon);
  if (mission.ordered !== "command" || mission.stage === "over" || JSON.stringify(what.keep_out || []) !== JSON.stringify(keptOut)) return false;
  if (Boolean(what.return_home) !== mission.return_home || zones.length !== mission.zones.length) return false;
  if (!zones.length) return often(what.passes) === mission.passes;
  const given = areas.zones.filter((area) => area.is === "ordered");
  return zones.every((zone, i) => {
    const room = roomOf(zone.room), passes = zone.passes || what.passes || (room && room.passes);
    const isThere = zone.name === mission.zones[i].name && often(passes) === mission.zones[i].passes;
    return isThere && (!zone.polygon || JSON.stringify(zone.polygon) === JSON.stringify((given[i] || {}).polygon));
  });
}

find("order").addEventListener("click", () => find("start").click());
find("start").addEventListener("click", () => start(order()));
find("again").addEventListener("click", () => start(lastOrder(model.state)));

// The robot refuses a start that would forget what is covered: the page then asks what to do.
let refused = null;
function start(what, discard = false) {
  const goes = what.keep_covered ? "It sweeps the rest." : discard ? "It begins anew." : "";
  const said = goesOn(what) ? "It goes on: it is at that already. To begin anew, Cancel first." : goes;
  command("start", { order: what, discard }, {
    said,
    taken: () => { drafts.length = 0; chosen.clear(); showDrafts(); pickRoom(0); },
    refused: (answer) => {
      if (answer.code !== "would_forget") return;
      refused = what;
      // Before there is a map, the robot counts all that it has swept, here or elsewhere.
      const swept = answer.text.match(/forgets (up to )?.*\(([\d.]+) m2\)/);
      const most = swept && swept[1] ? "Up to " : "";
      find("losstext").textContent = `${swept ? `${most}${swept[2]} m² of it` : "Some of it"} is swept already.`;
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
