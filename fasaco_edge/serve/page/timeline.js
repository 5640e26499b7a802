// The time line of a recording: the page requests a time, and gets the messages of that time.
const line = { at: 0, asking: false, asked: -1, plays: false, ticked: 0 };
const longest = () => (model.recording ? model.recording.seconds : 0);

function clock(seconds) {
  const parts = [Math.floor(seconds / 3600), Math.floor(seconds / 60) % 60, Math.floor(seconds) % 60];
  return parts.map((part, i) => (i ? String(part).padStart(2, "0") : part)).join(":");
}

// The next time is requested after the answer to the last one: a slow link shows fewer times.
function goTo(at) {
  line.at = Math.min(Math.max(at, 0), longest());
  find("when").value = line.at;
  find("when").setAttribute("aria-valuetext", clock(line.at));
  find("clock").textContent = `${clock(line.at)} of ${clock(longest())}`;
  if (line.asking || line.asked === line.at) return;
  Object.assign(line, { asking: true, asked: line.at });
  send({ kind: "seek", at: line.at });
}

function play(plays) {
  if (plays && line.at >= longest()) goTo(0);
  Object.assign(line, { plays, ticked: performance.now() });
  find("play").textContent = plays ? "Pause" : "Play";
}

function tick() {
  const now = performance.now(), passed_s = (now - line.ticked) / 1000;
  line.ticked = now;
  if (!line.plays) return;
  goTo(line.at + passed_s * Number(find("speed").value));
  if (line.at >= longest()) play(false);
}

// A recording opens at its end, and after a reconnection at the last time shown.
function showRecording() {
  const { files, began_s, seconds, clock: simulated } = model.recording, isNew = find("timeline").hidden;
  find("timeline").hidden = false;
  find("film").textContent = `Recording ${files[0]}${files.length > 1 ? " and on" : ""}, begun ${new Date(1000 * began_s).toLocaleString()}${simulated ? `, ${simulated}` : ""}`;
  find("when").max = seconds;
  Object.assign(line, { asking: false, asked: -1 });
  goTo(isNew ? seconds : line.at);
}

// Remove what did not exist yet at that time.
function showTime(message) {
  for (const kind of ["map", "floor", "field", "path", "pose"]) if (!message.has.includes(kind)) model[kind] = null;
  model.at = message.at;
  find("figures").textContent = message.status === null ? "" : `; state and figures as of ${clock(message.status)}`;
  line.asking = false;
  goTo(line.at);
  redraw();
}

find("when").addEventListener("input", () => { play(false); goTo(Number(find("when").value)); });
find("play").addEventListener("click", () => play(!line.plays));
setInterval(tick, 100);
